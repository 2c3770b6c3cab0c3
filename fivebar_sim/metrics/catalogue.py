"""The metrics of a run: a row for each, with its label, unit and tolerance.

A new metric is a row here and the function that the row names; nothing else lists metrics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import ground, load, tracking
from fivebar_sim.metrics.columns import MOTORS

Function = Callable[[FiveBar, Mapping[str, Array], slice], Any]
"""Takes the leg, the record and the rows to measure; returns a number, None where it is undefined,
or what has a number for each of several rows: see `Metric.part`."""

WINDOW = "measured window"
"""Whole periods after the ramp, or all of a landing: see `Scenario.window`."""

RUN = "whole run"
"""Every step, also those before the measured window."""

DEGREES = math.degrees(1.0)
"""Of a radian."""


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
        part: The attribute of what the function returns; "" where that is the number itself. One
            call measures all rows that have the function.
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
    part: str = ""
    low: float = -math.inf
    window: str = WINDOW
    whole: str = ""
    at: str = ""
    same_as: str = ""


def _both(key: str, label: str, scale: float, unit: str, **others: Any) -> Iterator[Metric]:
    """Yield a metric of A, then that of E; key and label have {} for the motor."""
    for motor in MOTORS:
        yield Metric(key.format(motor), label.format(motor), scale, unit, **others)


def _peak(
    name: str,
    label: str,
    scale: float,
    unit: str,
    tolerance: float | None = None,
    *,
    less: bool = False,
    old: str = "",
    old_whole: str = "",
    function: Function | None = None,
) -> Iterator[Metric]:
    """Yield a peak over the window, then over the whole run.

    Args:
        name: Key of the peak in the table `Peaks`.
        label: Name for people.
        scale: The factor from SI to the shown unit.
        unit: The shown unit.
        tolerance: Absolute tolerance; None where baselines leave the peak out.
        less: Whether it fails only when it grows.
        old: An older key of the peak over the window: limits and baselines know it by that.
        old_whole: An older key of the peak over the whole run.
        function: Measures the peak over the whole run; None where `Peaks` has it.
    """
    own = old or name
    whole = old_whole or f"whole.{name}"
    # The whole run's peak sizes a motor, so that is what a baseline watches.
    kept = tolerance if old else None
    yield Metric(own, label, scale, unit, kept, less_is_better=bool(old), whole=whole)

    if old:
        yield Metric(name, label, scale, unit, same_as=own)

    yield Metric(
        key=whole,
        label=label,
        scale=scale,
        unit=unit,
        tolerance=tolerance,
        less_is_better=less,
        function=function,
        low=-math.inf if function is None else 0.0,
        window=RUN,
        at=f"whole.at.{name}",
    )
    if old_whole:
        yield Metric(f"whole.{name}", label, scale, unit, window=RUN, same_as=whole)


def _peaks() -> Iterator[Metric]:
    """Yield the peaks of both motors: torque, speed, power."""
    for m in MOTORS:
        old = f"load.torque_peak.{m}"
        label = f"torque {m} peak"
        yield from _peak(f"torque_peak.{m}", label, 1e3, "mN m", 1e-6, less=True, old=old)
    for m in MOTORS:
        yield from _peak(f"speed_peak.{m}", f"speed {m} peak", 1.0, "rad/s")
    for m in MOTORS:
        yield from _peak(f"power_peak.{m}", f"power {m} peak", 1.0, "W", 1e-5, less=True)


def _ground_forces() -> Iterator[Metric]:
    """Yield the largest ground forces along x and z."""
    for axis in ("x", "z"):
        label = f"ground force {axis}"
        old = f"ground.force_max.{axis}"
        yield from _peak(f"ground_peak.{axis}", label, 1.0, "N", 1e-3, old_whole=old)


def _works() -> Iterator[Metric]:
    """Yield what each motor gave, took, and both together."""
    for motor in MOTORS:
        for way, word in (("positive", "given"), ("negative", "taken"), ("net", "net")):
            label = f"work {motor} {word}"
            yield Metric(f"load.work.{motor}.{way}", label, 1e3, "mJ", detail=True)


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
    *_peak(
        name="gap_peak",
        label="loop gap max",
        scale=1e6,
        unit="um",
        tolerance=1e-9,
        less=True,
        old_whole="closure.max",
        function=tracking.gap_max,
    ),
    *_both("load.torque_rms.{}", "torque {} RMS", 1e3, "mN m", tolerance=1e-6),
    *_peaks(),
    *_both("load.heat.{}", "heat {}", 1.0, "W"),
    *_both("load.temperature.{}", "winding {} for good", 1.0, "deg C"),
    *_both("load.continuous.{}", "continuous torque {}", 1e2, "%", detail=True),
    Metric("load.survives", "survives up to 100 %", 1e2, "%"),
    *_both("load.line.{}", "torque-speed line {}", 1e2, "%"),
    # 2e-3 of a share of steps: three steps of 1500.
    Metric("load.share_A", "load share A", 1e2, "%", tolerance=2e-3),
    Metric("load.thermal_share_A", "thermal share A", 1e2, "%", tolerance=2e-3),
    Metric("load.peak_ratio", "peak torque ratio", 1.0, "", detail=True),
    Metric("load.rms_ratio", "torque RMS ratio", 1.0, "", detail=True),
    *_works(),
    Metric("load.opposing.fraction", "motors opposed", 1e2, "%", detail=True),
    Metric("load.opposing.energy", "energy motor to motor", 1e3, "mJ", detail=True),
    Metric(
        key="load.serial_heat",
        label="heat of a serial leg's",
        scale=1e2,
        unit="%",
        detail=True,
        function=load.serial,
        part="heat",
        low=0.0,
    ),
    Metric(
        key="load.serial_friction",
        label="gear work of a serial leg's",
        scale=1e2,
        unit="%",
        detail=True,
        function=load.serial,
        part="friction",
        low=0.0,
    ),
    *_both(
        key="load.saturated.{}",
        label="motor {} saturated",
        scale=1e2,
        unit="%",
        tolerance=2e-3,
        less_is_better=True,
        hidden_at_zero=True,
    ),
    *_ground_forces(),
    Metric("ground.stance_share", "time in stance", 1e2, "%", tolerance=2e-3),
    Metric("ground.slip", "slip, all stances", 1e3, "mm", tolerance=1e-6, less_is_better=True),
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
"""Every metric of a leg that a scenario may set a limit on, in the order in which they are shown.

A robot has them too, of its four legs together.
"""

ROBOTS = (
    Metric("robot.speed", "robot's speed", 1.0, "m/s", tolerance=1e-4),
    Metric("robot.body_lengths_per_second", "body lengths a second", 1.0, "1/s", tolerance=1e-3),
    Metric("robot.drift", "speed to the left", 1.0, "m/s", tolerance=1e-3),
    Metric("robot.turn_rate", "turning to the left", 1.0, "rad/s", tolerance=1e-2),
    Metric("robot.lean", "trunk leans up to", DEGREES, "deg", tolerance=1e-3, less_is_better=True),
    Metric("robot.bob", "trunk bobs by", 1e3, "mm", tolerance=1e-5, less_is_better=True),
    Metric("robot.falls", "falls", 1.0, "", tolerance=0.5, less_is_better=True, window=RUN),
    Metric("robot.recovery", "up again after", 1.0, "s", 1e-2, less_is_better=True, window=RUN),
    Metric("robot.jump_height", "jump height", 1.0, "m", tolerance=1e-3, window=RUN),
    Metric("robot.agility", "jump agility", 1.0, "m/s", tolerance=5e-3, window=RUN),
    Metric("robot.cost_of_transport", "cost of transport", 1.0, ""),
    Metric("robot.cost_of_transport_electric", "the same with heat", 1.0, ""),
)
"""The metrics that only a robot has."""

PUSH_KEYS = ("robot.recovery",)
"""The metrics of a robot that is pushed."""

JUMP_KEYS = ("robot.jump_height", "robot.agility")
"""The metrics of a robot whose path does not repeat."""

EVERY = (*ROBOTS, *CATALOGUE)
"""Every metric there is, in the order in which they are shown."""

LIMIT_KEYS = tuple(metric.key for metric in CATALOGUE)
"""The metrics that a leg's scenario may set limits on."""

ROBOT_KEYS = tuple(metric.key for metric in EVERY if not metric.key.startswith("ground.rail"))
"""The metrics that a robot's scenario may set limits on: no rail ends under its trunk."""

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

BY_KEY = {metric.key: metric for metric in EVERY}
"""Every metric by its key."""

SHOWN = {
    metric.key: (
        f"{metric.label} (run)" if metric.window == RUN else metric.label,
        metric.scale,
        metric.unit,
    )
    for metric in EVERY
}
"""Label, factor from SI to the shown unit, and shown unit of each metric, by key.

A label that ends with "(run)" is of the whole run, any other of the measured window.
"""

LISTED = tuple(metric.key for metric in EVERY if not metric.same_as)
"""The metrics that a table of all of them lists: those that repeat no other."""

BESIDE = {metric.whole: metric.key for metric in EVERY if metric.whole}
"""Metrics of the whole run that tables show beside one of the window: their keys, and its key."""

ABSOLUTE = {metric.key: metric.tolerance for metric in EVERY if metric.tolerance is not None}
"""Absolute tolerance of the metrics of a baseline, in SI units, by key."""

LESS_IS_BETTER = tuple(metric.key for metric in EVERY if metric.less_is_better)
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
    found: dict[tuple[Function, str], Any] = {}

    for metric in MEASURED:
        # No floor, no metric of it: a 0 would look measured.
        if metric.key in GROUND_KEYS and "ground_z" not in record:
            continue
        assert metric.function is not None
        table, _, name = metric.key.partition(".")
        rows = slice(None) if metric.window == RUN else window
        asked = (metric.function, metric.window)
        if asked not in found:
            found[asked] = metric.function(leg, record, rows)
        value = getattr(found[asked], metric.part) if metric.part else found[asked]
        tables.setdefault(table, {})[name] = value
    return tables
