"""Motions that would tell more: a few kinds are tried on the leg as it was identified."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import FiveBarError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.identify.findings import inflation
from fivebar_sim.identify.fit import STEP, Fit
from fivebar_sim.identify.intervals import NORMAL, unmoved
from fivebar_sim.identify.measured import Measured
from fivebar_sim.identify.parameters import put
from fivebar_sim.identify.predict import predict
from fivebar_sim.scenario import Scenario

SIZES = (0.6, 0.45, 0.3, 0.2, 0.1)
"""Swings that are tried [rad]: the largest that leaves the loop closed is taken."""

ROOM = 0.15
"""By how much further the loop has to close [rad]: the leg does not follow exactly."""

WAVES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "slow": ((0.11, 0.29), (0.17, 0.23)),
    "fast": ((2.3, 3.7), (2.9, 4.3)),
    "mixed": ((0.3, 0.9, 1.7, 3.1), (0.4, 1.1, 2.1, 3.7)),
}
"""Frequencies of the sines of A and of E [Hz]."""

HOLD = 0.4
"""Time between the jumps of the motion "steps" [s]."""


class Suggestion(NamedTuple):
    """A motion and what it would tell.

    Attributes:
        name: Its kind: slow, fast, mixed or steps.
        swing: Largest angle from the middle [rad].
        time: From 0 [s], (n,).
        ctrl: Setpoints of A and E [rad], (n, 2).
        half_widths: Half of each number's 95 % interval, in its unit, (p,).
    """

    name: str
    swing: float
    time: Array
    ctrl: Array
    half_widths: Array


def suggest(scenario: Scenario, fit: Fit, log: Measured, nthread: int = 0) -> list[Suggestion]:
    """Return motions as long as a log, the one that tells most about its worst number first.

    Args:
        scenario: The scenario of the fit.
        fit: What was identified.
        log: The log; the motions have its rate, and swing about its middle.
        nthread: Threads.
    """
    time: Array = log.interval * np.arange(len(log.time), dtype=np.float64)
    middle = log.ctrl.mean(axis=0)
    leg = put(scenario, fit.parameters, fit.values).scenario.leg
    tried = []
    for name, shape in _shapes(time).items():
        swing = _swing(leg, middle, shape)
        if swing > 0.0:
            ctrl = middle + swing * shape
            tried.append(
                (name, swing, Measured(name, time, np.repeat(ctrl[:1], len(time), 0), ctrl))
            )
    if not tried:
        return []

    doubt = np.array([each.doubt for each in fit.parameters])
    points = np.concatenate([fit.values[None], fit.values + np.diag(STEP * doubt)])
    cases = [put(scenario, fit.parameters, values) for values in points]
    said = predict(cases, [each for *_, each in tried], nthread)
    noise = max(float(np.mean(fit.rms)), 1e-12)
    wider = inflation(fit)
    found = []
    for i, (name, swing, motion) in enumerate(tried):
        first, *others = [each[i].theta[motion.used].ravel() for each in said]
        J = np.stack([(other - first) / STEP for other in others], axis=1) / noise
        variance = np.diag(np.linalg.pinv(J.T @ J, rcond=1e-14))
        half = NORMAL * wider * np.sqrt(np.where(unmoved(J), np.inf, variance)) * doubt
        found.append(Suggestion(name, swing, motion.time, motion.ctrl, half))
    return sorted(found, key=lambda each: float((each.half_widths / doubt).max()))


def _shapes(time: Array) -> dict[str, Array]:
    """Return setpoints of each kind, within -1 to 1, (n, 2)."""
    ramp = np.clip(time / 0.5, 0.0, 1.0)
    shapes = {}
    for name, each in WAVES.items():
        columns = []
        for k, frequencies in enumerate(each):
            waves = [
                np.sin(2.0 * np.pi * f * time + 1.3 * (i + k)) for i, f in enumerate(frequencies)
            ]
            columns.append(ramp * np.mean(waves, axis=0))
        shapes[name] = np.stack(columns, axis=1)

    rng = np.random.default_rng(0)
    held = rng.uniform(-1.0, 1.0, (int(time[-1] / HOLD) + 2, 2))
    shapes["steps"] = held[(time / HOLD).astype(np.int64)]
    return shapes


def _swing(leg: FiveBar, middle: Array, shape: Array) -> float:
    """Return the largest swing with which the loop stays closed [rad]; 0 where none does."""
    corners = [ROOM * np.array(sign) for sign in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    for size in SIZES:
        try:
            for corner in corners:
                kinematics.forward(leg, middle + size * shape + corner)
        except FiveBarError:
            continue
        return size
    return 0.0
