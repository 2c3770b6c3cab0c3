"""Warnings that a run's numbers owe something to its timestep, where no guard fails it for that.

A run is taken again at half its timestep and, where that leaves a doubt, at a quarter, from where
its metrics are extrapolated. What costs less is in the record of the run itself, but no such sign
saw all runs that were off: they only say why, where one of them shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.control import Feedback
from fivebar_sim.errors import FiveBarError
from fivebar_sim.metrics import guards, tracking
from fivebar_sim.metrics.catalogue import ABSOLUTE, SHOWN, shown
from fivebar_sim.metrics.columns import MOTORS, motors
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.runs.extrapolation import converge
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.refined import brief, refined, repeats, shortened
from fivebar_sim.scenario.run import JudgedRun
from fivebar_sim.scenario.scenes import Ground

BAR = 0.05
"""Largest part of a metric that the timestep may cause."""

DOUBT = 0.2
"""Part of what is allowed from which on half a timestep is not enough, and a quarter is tried.

There an error of first order is half as much again, and an impact's peak may be anything: on a
belt one differed by 1.04 % at half the timestep, and by 6.4 % at a quarter.
"""

CHECKED = 0.6
"""The same of what a table [converge] allows: `fivebar converge` has looked at that metric."""

NEAR = 1e-3
"""Part of the leg's size by which tracking may differ: fed forward, it is all the step's error."""

FAINTEST = 1e-12
"""No difference counts below this, of whatever unit: it is rounding."""

LONGEST = 20_000
"""Steps of a run that are taken again; of a longer one, those that it begins with."""

PARTS = {2: "half", 4: "a quarter"}
"""Into how many parts a timestep is cut, and what each is of it."""

WATCHED = (
    *("tracking.rms", "tracking.max"),
    *(f"load.{name}.{motor}" for name in ("torque_rms", "torque_peak") for motor in MOTORS),
    *(f"whole.torque_peak.{motor}" for motor in MOTORS),
    "load.share_A",
)
"""Metrics that are compared, besides those that have a limit."""

NUMERICAL = ("closure.rms", "closure.max")
"""Metrics that are left out: the loop's gap is an error of the step itself, and its limit is 0."""

JOLTED = 0.05
"""Part of the largest torque that lasts a single step from which on peaks are off because of it."""

OPENED = 0.5
"""The same of the loop's gap, as a part of the tracking error."""

SPRUNG = 0.15
"""The same of what `discrete` adds to the servos' damping, as a part of it."""

ALIKE = 0.01
"""Part of its limit by which a metric of a run's beginning may differ from that of all of it."""

FIRST = 10
"""Steps in which a run starts: what is held, and perhaps moves, sets in at once."""


def warnings(result: JudgedRun, again: Callable[[Scenario], JudgedRun]) -> list[str]:
    """Return what a run's numbers owe to its timestep, for people; often nothing.

    Args:
        result: The run. One whose guards tripped has failed: nothing more is said about it.
        again: Runs a scenario.
    """
    if guards.tripped(result.measured.guards):
        return []

    scenario = result.scenario
    longest = shortened(scenario, LONGEST)
    begun = brief(scenario)
    # The brief one is run anew as it is, too: it must save half of the steps at least.
    if 3 * begun.steps < longest.steps and repeats(scenario, result.record):
        owed = _owed(result, again, begun, repeating=True)
        if owed is not None:
            return owed
    return _owed(result, again, longest) or []


def _owed(
    result: JudgedRun,
    again: Callable[[Scenario], JudgedRun],
    begun: Scenario,
    *,
    repeating: bool = False,
) -> list[str] | None:
    """Return what `warnings` does, of the beginning of a run.

    It is None where the run repeats itself, and yet its beginning does not tell of all of it.
    """
    scenario = result.scenario
    first = result if begun is scenario else again(begun)
    said = "" if begun is scenario else f", in the first {begun.duration:g} s,"
    tables = [first.metrics]
    for parts, part in PARTS.items():
        when = f"at {part} of it{said}"
        try:
            finer = again(refined(begun, parts, scenario.sim.integrator))
        except FiveBarError as error:
            return [f"the timestep is too long: {when} the run ends: {error}"]

        tripped = guards.tripped(finer.measured.guards)
        if repeating and not tripped and not _tells(result, first, finer):
            return None
        fails = [*tripped, *_flipped(first, finer)]
        if fails:
            return [f"the timestep is too long: {when} the run fails: {'; '.join(fails)}"]

        tables.append(finer.metrics)
        found = differences(scenario, tables)
        off = [each for each in found if each.used > 1.0]
        if off:
            run_there = parts == min(PARTS)
            where = when if run_there else f"with ever shorter ones{said}"
            named = ", ".join(_named(off, "is" if run_there else "is about"))
            why = "".join(f"; {each}" for each in _reasons(first))
            return [f"numbers depend on the timestep: {where} {named}{why}"]
        if not any(each.doubtful for each in found):
            return []
    return []


def _tells(result: JudgedRun, first: JudgedRun, finer: JudgedRun) -> bool:
    """Return whether the beginning of a run that repeats itself tells of all its limits.

    It does where it repeats itself in shorter steps too, no metric with a limit adds up over the
    run, and none is so near to its limit that the first period's part in it would decide.

    Args:
        result: The run.
        first: Its beginning.
        finer: The same in shorter steps.
    """
    if not repeats(finer.scenario, finer.record):
        return False
    for whole, was, now in zip(result.limits, first.limits, finer.limits, strict=True):
        if whole.value is None or was.value is None or now.value is None:
            return False
        # Twice what shorter steps do.
        moved = whole.value + 2.0 * (now.value - was.value)
        if not whole.low <= moved <= whole.high:
            return False
        bounds = [bound for bound in (whole.low, whole.high) if np.isfinite(bound)]
        if any(abs(was.value - whole.value) > ALIKE * abs(bound) for bound in bounds):
            return False
    return True


class Difference(NamedTuple):
    """A metric in shorter steps.

    Attributes:
        key: Its dotted key.
        was: Its value.
        now: In shorter steps; from a quarter on, in ever shorter ones.
        used: The difference, as a part of what is allowed.
        doubtful: Whether it may be more than that in yet shorter steps.
    """

    key: str
    was: float
    now: float
    used: float
    doubtful: bool


def differences(scenario: Scenario, tables: Sequence[Mapping[str, Any]]) -> list[Difference]:
    """Return how metrics differ.

    Allowed is a part of the finer value, `BAR` or what the scenario's table [converge] says, or
    next to nothing.

    Args:
        scenario: The scenario that was run.
        tables: The metrics of a run, and those at half its timestep, or at half and a quarter.
    """
    found = []
    for key in dict.fromkeys((*WATCHED, *scenario.limits)):
        values = [value for value in (look_up(table, key) for table in tables) if value is not None]
        if len(values) < len(tables) or key in NUMERICAL:
            continue
        before = values[0]
        after = _end(values)
        change = abs(before - after)
        size = abs(after)
        near = NEAR * scenario.leg.size if key.startswith("tracking.") else ABSOLUTE.get(key, 0.0)
        least = max(near, BAR * size, FAINTEST)
        own = scenario.converge.get(key, 0.0) * size
        doubtful = change > max(DOUBT * least, CHECKED * own)
        found.append(Difference(key, before, after, change / max(least, own), doubtful))
    return found


def _end(values: Sequence[float]) -> float:
    """Return what a metric at h and h / 2, or at h, h / 2 and h / 4, comes to."""
    first, *finer = values
    limit = converge(values).limit if len(finer) > 1 else None
    # What does not converge is as far away as it was seen.
    return max(finer, key=lambda value: abs(value - first)) if limit is None else limit


def _named(off: Sequence[Difference], verb: str) -> Iterator[str]:
    """Yield what metrics are in shorter steps, and what they were."""
    seen = set()
    for key, was, now, *_ in off:
        # The whole run's peak is often that of the window.
        if (was, now) in seen:
            continue
        seen.add((was, now))
        part = 100.0 * abs(was - now) / abs(now) if now else np.inf
        by = f"{part:.0f}" if part > 10.0 else f"{part:.2g}"
        yield f"{SHOWN[key][0]} {verb} {shown(key, now)}, not {shown(key, was)} ({by} % off)"


def _flipped(first: JudgedRun, finer: JudgedRun) -> Iterator[str]:
    """Yield the limits that hold in a run, but not in shorter steps; see `differences`."""
    allowed = first.scenario.converge
    for was, now in zip(first.limits, finer.limits, strict=True):
        if not was.ok or now.ok:
            continue
        # An undefined metric differs by more than any part.
        change = np.inf if now.value is None else abs((was.value or 0.0) - now.value)
        if change > allowed.get(now.key, 0.0) * abs(now.value or 0.0):
            yield (
                f"{SHOWN[now.key][0]} is {shown(now.key, now.value)}, which breaks its limit, not "
                f"{shown(was.key, was.value)}"
            )


def _reasons(result: JudgedRun) -> Iterator[str]:
    """Yield what in a run may make its numbers depend on the timestep."""
    found = (_jolted(result), _started(result), _opened(result), _sprung(result))
    yield from (each for each in found if each is not None)


def _jolted(result: JudgedRun) -> str | None:
    """Return that torques last a single step."""
    jolts = next((each.value for each in result.measured.guards if each.name == "jolts"), None)
    if jolts is None or not jolts > JOLTED:
        return None
    return f"{100.0 * jolts:.3g} % of the largest torque lasted one step"


def _started(result: JudgedRun) -> str | None:
    """Return that the largest torque is that of the start."""
    # A feedback controller holds each torque for a period: it has no step of its own.
    if isinstance(result.scenario.controller, Feedback):
        return None
    at = np.abs(motors(result.record, "torque")).argmax(axis=0)
    if not (at < FIRST).any():
        return None
    motor = MOTORS[int(at.argmin())]
    return f"the largest torque of {motor} is that of the first {FIRST} steps, when the run starts"


def _opened(result: JudgedRun) -> str | None:
    """Return that tracking is no better than the loop's gap."""
    scenario = result.scenario
    gap = tracking.gap_rms(scenario.leg, result.record, scenario.window)
    error = tracking.rms(scenario.leg, result.record, scenario.window)
    if not gap > max(OPENED * error, NEAR * scenario.leg.size):
        return None
    return f"the loop is open by {1e3 * gap:.3g} mm, of an error of {1e3 * error:.3g} mm"


def _sprung(result: JudgedRun) -> str | None:
    """Return that the step damps the servos' springs, which jerks and contacts load.

    Under `discrete` a spring acts with the angle that a step ends in: as if kd were kp h larger.
    """
    scenario = result.scenario
    sim = scenario.sim
    servo = scenario.servo
    if isinstance(scenario.controller, Feedback) or sim.integrator != "discrete":
        return None

    added = servo.kp * sim.timestep
    jerked = isinstance(scenario.scene, Ground) or scenario.path.ramp == 0.0
    if not jerked or not added > SPRUNG * servo.damping:
        return None
    return (
        f"kp h = {added:.3g} N m s/rad adds to the servos' damping of {servo.damping:.3g} N m s/rad"
    )
