"""Least squares: the numbers with which simulated legs say what logs say, and how sure they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.identify.intervals import Spread, newey_west
from fivebar_sim.identify.measured import Measured
from fivebar_sim.identify.parameters import Parameter, put
from fivebar_sim.identify.predict import Predicted, predict
from fivebar_sim.scenario import Scenario

STEP = 1e-3
"""Step of the finite differences, as a part of each number's doubt."""

ANGLE_NOISE = 1e-3
"""Noise of angles that a fit begins with [rad]."""

Tell = Callable[[int, float], None]
"""Is told the number of an evaluation, and the RMS of the angles' residuals [rad]."""


class Fit(NamedTuple):
    """The result of a fit.

    Attributes:
        parameters: What was identified.
        values: Their numbers, (p,).
        spread: How far from the truth these may be.
        jacobian: Derivatives of the weighted residuals by numbers in doubts, (m, p).
        rms: RMS of the angles' residuals in each log, [rad].
        rms_before: The same with the scenario's own numbers [rad].
        evaluations: How many batches were simulated.
    """

    parameters: list[Parameter]
    values: Array
    spread: Spread
    jacobian: Array
    rms: list[float]
    rms_before: list[float]
    evaluations: int

    @property
    def half_widths(self) -> Array:
        """Half of each 95 % interval, in the numbers' units, (p,)."""
        return self.spread.half_widths

    @property
    def correlations(self) -> Array:
        """Correlation of each two numbers, (p, p); 0 where one is exact, or nothing tells it."""
        covariance = self.spread.covariance
        sd = np.sqrt(np.diag(covariance))
        known = np.flatnonzero(np.isfinite(sd) & (sd > 0.0))
        pairs = np.ix_(known, known)
        found = np.eye(len(sd))
        found[pairs] = covariance[pairs] / np.outer(sd[known], sd[known])
        return found


class _Problem:
    """Residuals and their derivatives, of a batch for every set of numbers.

    Args:
        scenario: Where the numbers start.
        chosen: What is identified.
        logs: The logs.
        nthread: Threads.
        tell: Is told of every evaluation.
    """

    def __init__(
        self,
        scenario: Scenario,
        chosen: list[Parameter],
        logs: Sequence[Measured],
        nthread: int,
        tell: Tell | None,
    ) -> None:
        self._scenario = scenario
        self._chosen = chosen
        self._logs = logs
        self._nthread = nthread
        self._tell = tell
        self.doubt = np.array([each.doubt for each in chosen])
        self.start = np.array([each.start for each in chosen])
        self.noise = {"theta": ANGLE_NOISE, "current": 1.0}
        self.evaluations = 0
        self._known: dict[bytes, tuple[list[Array], Array]] = {}

    def values(self, x: Array) -> Array:
        """Return the numbers of a point, which counts doubts from the start."""
        return self.start + x * self.doubt

    def rows(self, x: Array) -> tuple[list[Array], Array]:
        """Return the residuals of each channel, and the derivatives of all, weighted."""
        key = x.tobytes()
        if key not in self._known:
            self._known[key] = self._simulated(x)
        return self._known[key]

    def residuals(self, x: Array) -> Array:
        """Return the weighted residuals, (m,)."""
        return np.concatenate(self.rows(x)[0])

    def jacobian(self, x: Array) -> Array:
        """Return their derivatives, (m, p)."""
        return self.rows(x)[1]

    def reweigh(self, x: Array) -> None:
        """Take the noise of each channel from the residuals at a point."""
        found = self._unweighted(self._predictions(x[None])[0])
        self.noise = {name: max(_rms(each), 1e-12) for name, each in found.items()} | {
            name: value for name, value in self.noise.items() if name not in found
        }
        self._known.clear()

    def angles(self, x: Array) -> list[float]:
        """Return the RMS of the angles' residuals in each log [rad]."""
        predicted = self._predictions(x[None])[0]
        return [
            _rms((log.theta - each.theta)[log.used])
            for log, each in zip(self._logs, predicted, strict=True)
        ]

    def _simulated(self, x: Array) -> tuple[list[Array], Array]:
        # Forward differences, backward where the range ends.
        high = np.array([each.high for each in self._chosen])
        side = np.where(self.values(x) + STEP * self.doubt > high, -1.0, 1.0)
        points = np.concatenate([x[None], x + np.diag(STEP * side)])

        every = [self._weighted(each) for each in self._predictions(points)]
        first = np.concatenate(every[0])
        columns = [
            (np.concatenate(each) - first) / (STEP * s)
            for each, s in zip(every[1:], side, strict=True)
        ]
        self.evaluations += 1
        if self._tell is not None:
            self._tell(self.evaluations, _rms(every[0][0]) * self.noise["theta"])
        return every[0], np.stack(columns, axis=1)

    def _predictions(self, points: Array) -> list[list[Predicted]]:
        cases = [put(self._scenario, self._chosen, self.values(x)) for x in points]
        return predict(cases, self._logs, self._nthread)

    def _weighted(self, predicted: Sequence[Predicted]) -> list[Array]:
        found = self._unweighted(predicted)
        return [found[name] / self.noise[name] for name in found]

    def _unweighted(self, predicted: Sequence[Predicted]) -> dict[str, Array]:
        """Return model less log of each channel: log after log, A then E."""
        theta = []
        current = []
        for log, each in zip(self._logs, predicted, strict=True):
            theta.append((each.theta - log.theta)[log.used].T.ravel())
            if log.current is not None and each.current is not None:
                current.append((each.current - log.current)[log.used].T.ravel())
        found = {"theta": np.nan_to_num(np.concatenate(theta), nan=10.0, posinf=10.0, neginf=-10.0)}
        if current:
            found["current"] = np.nan_to_num(np.concatenate(current), nan=10.0)
        return found


def fit(
    scenario: Scenario,
    chosen: list[Parameter],
    logs: Sequence[Measured],
    nthread: int = 0,
    tell: Tell | None = None,
) -> Fit:
    """Return the numbers that explain the logs best.

    Args:
        scenario: Where they start, and all the others.
        chosen: What is identified.
        logs: The logs; at least one.
        nthread: Threads; 0 is one for every processor.
        tell: Is told of every evaluation.

    Raises:
        ConfigError: SciPy is not installed, or the logs do not fit the leg at all.
    """
    optimize = _scipy()
    problem = _Problem(scenario, chosen, logs, nthread, tell)
    ends = [np.array([getattr(each, end) for each in chosen]) for end in ("low", "high")]
    bounds = tuple((end - problem.start) / problem.doubt for end in ends)
    x = np.clip(np.zeros(len(chosen)), *bounds)
    before = problem.angles(x)
    for tolerance in (1e-3, 1e-6):
        found = optimize.least_squares(
            problem.residuals,
            x,
            problem.jacobian,  # pyright: ignore[reportArgumentType] "or a function", in its docs
            bounds,
            xtol=tolerance,
            ftol=tolerance,
        )
        x = found.x
        # The noise of the channels is known from the first fit on.
        problem.reweigh(x)

    J = problem.jacobian(x)
    channels = problem.rows(x)[0]
    spread = newey_west(J, np.concatenate(channels), _lengths(logs, len(channels)))
    scale = np.outer(problem.doubt, problem.doubt)
    return Fit(
        parameters=chosen,
        values=problem.values(x),
        spread=spread._replace(covariance=spread.covariance * scale),
        jacobian=J,
        rms=problem.angles(x),
        rms_before=before,
        evaluations=problem.evaluations,
    )


def _lengths(logs: Sequence[Measured], channels: int) -> list[int]:
    """Return the samples of each stretch of residuals: log after log, A then E."""
    angles = [int(log.used.sum()) for log in logs for _ in "AE"]
    currents = [int(log.used.sum()) for log in logs if log.current is not None for _ in "AE"]
    return angles + (currents if channels > 1 else [])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _scipy():
    """Return scipy.optimize.

    Raises:
        ConfigError: It is not installed.
    """
    try:
        from scipy import optimize
    except ModuleNotFoundError:
        raise ConfigError("identify needs SciPy: pip install 'fivebar-sim[precise]'") from None
    return optimize
