"""The metrics of a run: a row for each, with its label, unit and tolerance.

A new metric is a row here and the function that the row names; nothing else lists metrics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.dynamics import antagonism
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import ground, tracking
from fivebar_sim.metrics.columns import MOTORS

Function = Callable[[FiveBar, Mapping[str, Array], slice], float | None]
"""Takes the leg, the record and the rows to measure; None is undefined."""

WINDOW = "measured window"
"""Whole periods after the ramp, or all of a landing: see `Scenario.window`."""

RUN = "whole run"
"""Every step, also those before the measured window."""


class Metric(NamedTuple):
    """One metric.

    Attributes:
        key: Its dotted key in metrics.json, in SI units; "table.name" of a row with a function.
        label: Name for people.
        scale: The factor from SI to the shown unit.
        unit: The shown unit.
        tolerance: Absolute part of its tolerance in baselines, in its SI unit; None where baselines
            leave it out.
        less_is_better: Whether it fails only when it grows. All others fail when they change: less
            torque over a whole run, or another share of it, is not what the leg needs for its
            path, until someone accepts it.
        detail: Shown only where it has a limit.
        hidden_at_zero: Shown only where it has a limit or is not 0.
        function: Measures it. None where a table of metrics is measured as a whole: load, peaks,
            ground, energy and branch.
        low: Lowest possible value of a row with a function; metrics.json with a lower one is
            refused.
        window: What it is measured over: `WINDOW` or `RUN`.
        whole: Key of the same over the whole run, which tables show beside it; "" for none.
        at: Key of the time at which it occurs; "" for none.
        same_as: Key of a metric that always has the same value; this one is shown only where it has
            a limit.
    """

    key: str
    label: str
    scale: float
    unit: str
    tolerance: float | None = None
    less_is_better: bool = False
    detail: bool = False
    hidden_at_zero: bool = False
    function: Function | None = None
    low: float = -math.inf
    window: str = WINDOW
    whole: str = ""
    at: str = ""
    same_as: str = ""


def _peaks(
    name: str, label: str, scale: float, unit: str, tolerance: float | None, old: str = ""
) -> Iterator[Metric]:
    """Yield a peak of both motors over the window, then over the whole run.

    Args:
        name: Name of the peak, of the table `Peaks`.
        label: Name for people, with {} for the motor.
        scale: The factor from SI to the shown unit.
        unit: The shown unit.
        tolerance: Absolute tolerance over the whole run; None where baselines leave it out.
        old: An older key of the peak over the window: limits and baselines know it by that.
    """
    # The whole run's peak sizes a motor, so that is what a baseline watches.
    kept = tolerance if old else None
    for motor in MOTORS:
        called = label.format(motor)
        own = f"{old or name}.{motor}"
        whole = f"whole.{name}.{motor}"
        yield Metric(own, called, scale, unit, kept, less_is_better=bool(old), whole=whole)

        if old:
            yield Metric(f"{name}.{motor}", called, scale, unit, same_as=own)

        less = tolerance is not None
        at = f"whole.at.{name}.{motor}"
        yield Metric(whole, called, scale, unit, tolerance, less, window=RUN, at=at)


def _ground_forces(axis: str) -> Iterator[Metric]:
    """Yield the largest ground force along an axis over the window, then over the whole run."""
    label = f"ground force {axis}"
    whole = f"ground.force_max.{axis}"
    at = f"whole.at.ground_peak.{axis}"
    yield Metric(f"ground_peak.{axis}", label, 1.0, "N", whole=whole)
    yield Metric(whole, label, 1.0, "N", tolerance=1e-3, window=RUN, at=at)
    yield Metric(f"whole.ground_peak.{axis}", label, 1.0, "N", window=RUN, same_as=whole)


CATALOGUE = (
    Metric(
        key="tracking.rms",
        label="tracking RMS",
        scale=1e3,
        unit="mm",
        tolerance=1e-9,
        less_is_better=True,
        function=tracking.rms,
        low=0.0,
    ),
    Metric(
        key="tracking.max",
        label="tracking max",
        scale=1e3,
        unit="mm",
        tolerance=1e-9,
        less_is_better=True,
        function=tracking.largest,
        low=0.0,
    ),
    Metric(
        key="closure.rms",
        label="loop gap RMS",
        scale=1e6,
        unit="um",
        tolerance=1e-9,
        less_is_better=True,
        function=tracking.gap_rms,
        low=0.0,
        window=RUN,
    ),
    Metric("gap_peak", "loop gap max", 1e6, "um", whole="closure.max"),
    Metric(
        key="closure.max",
        label="loop gap max",
        scale=1e6,
        unit="um",
        tolerance=1e-9,
        less_is_better=True,
        function=tracking.gap_max,
        low=0.0,
        window=RUN,
        at="whole.at.gap_peak",
    ),
    Metric("whole.gap_peak", "loop gap max", 1e6, "um", window=RUN, same_as="closure.max"),
    Metric("load.torque_rms.A", "torque A RMS", 1e3, "mN m", tolerance=1e-6),
    Metric("load.torque_rms.E", "torque E RMS", 1e3, "mN m", tolerance=1e-6),
    *_peaks("torque_peak", "torque {} peak", 1e3, "mN m", 1e-6, "load.torque_peak"),
    *_peaks("speed_peak", "speed {} peak", 1.0, "rad/s", None),
    *_peaks("power_peak", "power {} peak", 1.0, "W", 1e-5),
    Metric("load.heat.A", "heat A", 1.0, "W"),
    Metric("load.heat.E", "heat E", 1.0, "W"),
    Metric("load.temperature.A", "winding A for good", 1.0, "deg C"),
    Metric("load.temperature.E", "winding E for good", 1.0, "deg C"),
    Metric("load.continuous.A", "continuous torque A", 1e2, "%", detail=True),
    Metric("load.continuous.E", "continuous torque E", 1e2, "%", detail=True),
    Metric("load.survives", "survives up to 100 %", 1e2, "%"),
    Metric("load.line.A", "torque-speed line A", 1e2, "%"),
    Metric("load.line.E", "torque-speed line E", 1e2, "%"),
    # 2e-3 of a share of steps: three steps of 1500.
    Metric("load.share_A", "load share A", 1e2, "%", tolerance=2e-3),
    Metric("load.thermal_share_A", "thermal share A", 1e2, "%", tolerance=2e-3),
    Metric("load.peak_ratio", "peak torque ratio", 1.0, "", detail=True),
    Metric("load.rms_ratio", "torque RMS ratio", 1.0, "", detail=True),
    Metric("load.work.A.positive", "work A given", 1e3, "mJ", detail=True),
    Metric("load.work.A.negative", "work A taken", 1e3, "mJ", detail=True),
    Metric("load.work.A.net", "work A net", 1e3, "mJ", detail=True),
    Metric("load.work.E.positive", "work E given", 1e3, "mJ", detail=True),
    Metric("load.work.E.negative", "work E taken", 1e3, "mJ", detail=True),
    Metric("load.work.E.net", "work E net", 1e3, "mJ", detail=True),
    Metric("load.opposing.fraction", "motors opposed", 1e2, "%", detail=True),
    Metric("load.opposing.energy", "energy motor to motor", 1e3, "mJ", detail=True),
    Metric(
        key="load.serial_heat",
        label="heat of a serial leg's",
        scale=1e2,
        unit="%",
        detail=True,
        function=antagonism.heat,
        low=0.0,
    ),
    Metric(
        key="load.serial_friction",
        label="gear work of a serial leg's",
        scale=1e2,
        unit="%",
        detail=True,
        function=antagonism.friction,
        low=0.0,
    ),
    Metric(
        key="load.saturated.A",
        label="motor A saturated",
        scale=1e2,
        unit="%",
        tolerance=2e-3,
        less_is_better=True,
        hidden_at_zero=True,
    ),
    Metric(
        key="load.saturated.E",
        label="motor E saturated",
        scale=1e2,
        unit="%",
        tolerance=2e-3,
        less_is_better=True,
        hidden_at_zero=True,
    ),
    *_ground_forces("x"),
    *_ground_forces("z"),
    Metric("ground.stance_share", "time in stance", 1e2, "%", tolerance=2e-3),
    Metric("ground.slip", "slip in stance", 1e3, "mm", tolerance=1e-6, less_is_better=True),
    Metric("ground.foot_height_max", "foot height max", 1e3, "mm", tolerance=1e-6, window=RUN),
    Metric("ground.flight_max", "longest flight", 1e3, "ms", tolerance=2e-3, window=RUN),
    Metric(
        key="ground.foot_share",
        label="weight on the foot",
        scale=1e2,
        unit="%",
        tolerance=2e-3,
        function=ground.foot_share,
        low=0.0,
    ),
    Metric(
        key="ground.rail_end_max",
        label="rail's end force",
        scale=1.0,
        unit="N",
        tolerance=1e-3,
        less_is_better=True,
        hidden_at_zero=True,
        function=ground.rail_end_max,
        low=0.0,
        window=RUN,
    ),
    # Works and gains of the whole run: the guard of the energy balances them.
    Metric("energy.motor", "work of the motors", 1e3, "mJ", detail=True, window=RUN),
    Metric("energy.force", "work of the pushes", 1e3, "mJ", detail=True, window=RUN),
    Metric("energy.ground", "work of the ground", 1e3, "mJ", detail=True, window=RUN),
    Metric("energy.constraints", "work of loop, gears, ends", 1e3, "mJ", detail=True, window=RUN),
    Metric("energy.step", "given by the steps", 1e3, "mJ", detail=True, window=RUN),
    Metric("energy.kinetic", "kinetic energy gained", 1e3, "mJ", detail=True, window=RUN),
    Metric("energy.potential", "potential energy gained", 1e3, "mJ", detail=True, window=RUN),
    Metric("energy.turnover", "energy turned over", 1e3, "mJ", detail=True, window=RUN),
    Metric("energy.imbalance", "energy imbalance", 1e2, "%", window=RUN),
    Metric("branch.flips", "branch flips", 1.0, "", window=RUN),
    Metric("warnings", "MuJoCo warnings", 1.0, "", window=RUN),
)
"""Every metric that a scenario may set a limit on, in the order in which they are shown."""

LIMIT_KEYS = tuple(metric.key for metric in CATALOGUE)
"""The metrics that a scenario may set limits on."""

GROUND_KEYS = tuple(
    key for key in LIMIT_KEYS if key.startswith(("ground.", "ground_peak.", "whole.ground_peak."))
)
"""The metrics of scenes with a ground."""

HEAT_KEYS = ("load.heat.A", "load.heat.E")
"""The metrics of servos whose tables describe the winding."""

COOLING_KEYS = (
    *("load.temperature.A", "load.temperature.E"),
    *("load.continuous.A", "load.continuous.E", "load.survives"),
)
"""The metrics of servos whose tables say how the winding cools."""

LINE_KEYS = ("load.line.A", "load.line.E")
"""The metrics of servos with a torque-speed line."""

BY_KEY = {metric.key: metric for metric in CATALOGUE}
"""Every metric by its key."""

SHOWN = {
    metric.key: (
        f"{metric.label} (run)" if metric.window == RUN else metric.label,
        metric.scale,
        metric.unit,
    )
    for metric in CATALOGUE
}
"""Label, factor from SI to the shown unit, and shown unit of each metric, by key.

A label that ends with "(run)" is of the whole run, any other of the measured window.
"""

LISTED = tuple(metric.key for metric in CATALOGUE if not metric.same_as)
"""The metrics that a table of all of them lists: those that repeat no other."""

BESIDE = {metric.whole: metric.key for metric in CATALOGUE if metric.whole}
"""Metrics of the whole run that tables show beside one of the window: their keys, and its key."""

ABSOLUTE = {metric.key: metric.tolerance for metric in CATALOGUE if metric.tolerance is not None}
"""Absolute tolerance of the metrics of a baseline, in SI units, by key."""

LESS_IS_BETTER = tuple(metric.key for metric in CATALOGUE if metric.less_is_better)
"""Metrics of a baseline that fail only when they grow."""

MEASURED = tuple(metric for metric in CATALOGUE if metric.function is not None)
"""The metrics with a function of their own."""


def shown(key: str, value: float | None) -> str:
    """Return a metric's value in the unit that people read, and that fits its size."""
    _, scale, unit = SHOWN[key]
    return "undefined" if value is None else units.text(scale * value, unit)


def measure(
    leg: FiveBar, record: Mapping[str, Array], window: slice
) -> dict[str, dict[str, float | None]]:
    """Return the metrics that have a function, in tables by the first part of their keys.

    Those of the ground are left out of a run without one.

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        window: The rows of the measured window.
    """
    tables: dict[str, dict[str, float | None]] = {}
    for metric in MEASURED:
        # No floor, no metric of it: a 0 would look measured.
        if metric.key in GROUND_KEYS and "ground_z" not in record:
            continue
        assert metric.function is not None
        table, _, name = metric.key.partition(".")
        rows = slice(None) if metric.window == RUN else window
        tables.setdefault(table, {})[name] = metric.function(leg, record, rows)
    return tables
