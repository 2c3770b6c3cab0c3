"""Scenarios run within a user's tests: loading, driving by a controller, and assertions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

from fivebar_sim import rollout
from fivebar_sim.checks import check_number
from fivebar_sim.control import Feedback, Setpoints
from fivebar_sim.errors import ArgumentError, ConfigError, FiveBarError, unknown
from fivebar_sim.files import tables
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import SHOWN, shown
from fivebar_sim.metrics.columns import Record
from fivebar_sim.metrics.limits import Limit, bounds, has, judge
from fivebar_sim.metrics.measured import Verdict
from fivebar_sim.regression import comparison
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario


@dataclass(frozen=True, slots=True)
class LegRun:
    """The result of a run, with assertions.

    Attributes:
        result: As `fivebar_sim.run` returns it.
    """

    result: Result

    def __repr__(self) -> str:
        """Return name and verdict: pytest prints it in full with a failure."""
        return f"LegRun({self.scenario.name}: {self.verdict})"

    @property
    def scenario(self) -> Scenario:
        """What was run."""
        return self.result.scenario

    @property
    def record(self) -> Record:
        """The columns of rollout.parquet, each (N,), SI."""
        return self.result.record

    @property
    def metrics(self) -> dict[str, Any]:
        """What metrics.json says."""
        return self.result.metrics

    @property
    def limits(self) -> list[Limit]:
        """Every limit with its value."""
        return self.result.limits

    @property
    def verdict(self) -> Verdict:
        """Either "pass", "fail", or "not judged" where guards hold but no limits are set."""
        return self.result.verdict

    def assert_limits(self) -> None:
        """Fail unless the verdict is "pass": all limits hold, and no guard tripped.

        Raises:
            AssertionError: One line for every broken limit and every guard that tripped.
            ConfigError: The scenario has no limits, so that nothing would be asserted.
        """
        __tracebackhide__ = True
        failures = comparison.compare(self.result, None).failures
        if failures:
            raise AssertionError("\n  ".join([f"{self.scenario.name} fails:", *failures]))
        if not self.limits:
            raise ConfigError(f"{self.scenario.name} has no [limits]: there is nothing to assert")

    def assert_metric(
        self, key: str, *, low: float | None = None, high: float | None = None
    ) -> None:
        """Fail unless low <= metric <= high, in SI units, and no guard tripped.

        Args:
            key: The metric's dotted key, as in [limits]: "tracking.rms".
            low: Least value that passes; None is no lower bound.
            high: Greatest value that passes; None is no upper bound.

        Raises:
            AssertionError: Names the metric with its value and bounds, or the guards that tripped.
            ArgumentError: No such metric in this run, no bound, or low > high.
        """
        __tracebackhide__ = True
        # A scene without a ground has no metrics of one.
        known = [each for each in SHOWN if has(self.metrics, each)]
        if key not in known:
            raise ArgumentError(unknown("metric", key, known))
        if low is None and high is None:
            raise ArgumentError(f"{key} needs a bound: give low, high or both")

        if low is not None:
            check_number("low", low, "")

        if high is not None:
            check_number("high", high, "", low=-inf if low is None else low)

        # A number of a run whose physics does not hold proves nothing, whatever it is.
        tripped = guards.tripped(self.result.measured.guards)
        if tripped:
            raise AssertionError("\n  ".join([f"{self.scenario.name} fails:", *tripped]))

        allowed = (-inf if low is None else low, inf if high is None else high)
        (judged,) = judge(self.metrics, {key: allowed})
        if not judged.ok:
            legal = bounds(judged) if high is not None else f">= {shown(key, low)}"
            line = f"{SHOWN[key][0]}: {shown(key, judged.value)}, limit {legal}"
            raise AssertionError(f"{self.scenario.name} fails:\n  {line}")


@dataclass(frozen=True, slots=True)
class LegRunner:
    """Runs scenarios for tests: the value of the fixture `leg_run`.

    Attributes:
        place: Returns the folder of the test file, beside which scenarios are looked up, and the
            list of results that the plugin may keep.
    """

    place: Callable[[], tuple[Path, list[Result]]] = field(repr=False)

    def __call__(
        self,
        scenario: str | Path,
        *,
        controller: Setpoints | Feedback | None = None,
        settings: Sequence[str] = (),
    ) -> LegRun:
        """Run a scenario and return its result.

        Args:
            scenario: A TOML file, relative to the test file's folder; or the name of one that
                ships with fivebar-sim.
            controller: Drives the motors instead of the scenario's [controller].
            settings: Changes "KEY=VALUE" with dotted keys, as for `fivebar run --set`.

        Raises:
            ConfigError: The scenario, a setting or the controller is not valid.
            UnreachableError: The path leaves what the leg can reach.
            DivergedError: The simulation broke down; says when.
        """
        __tracebackhide__ = True
        folder, runs = self.place()
        try:
            result = rollout.run(_load(folder, str(scenario), controller, settings))
        except FiveBarError as error:
            # Shows the test's line and what is wrong, not the inside of fivebar_sim.
            raise error.with_traceback(None) from None
        runs.append(result)
        return LegRun(result)


def _load(
    folder: Path,
    source: str,
    controller: Setpoints | Feedback | None,
    settings: Sequence[str],
) -> Scenario:
    """Return the scenario of a file in a folder, or a shipped one, with changes."""
    # A string is a sequence of strings too: each letter would be taken as a setting.
    if isinstance(settings, str):
        raise ConfigError(f'settings must be a list of "KEY=VALUE", got {settings!r}')
    place = folder / source if source.endswith(".toml") else source
    if controller is None:
        return Scenario.load(place, settings)
    for setting in settings:
        if tables.parse_setting(setting)[0][0] == "controller":
            raise ConfigError(f"settings change the controller, and one is given: {setting!r}")
    return Scenario.load(place, [*settings, "controller={}"]).driven_by(controller)
