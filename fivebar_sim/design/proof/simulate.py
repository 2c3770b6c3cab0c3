"""Simulates designs, and measures of each what the closed form predicted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.design.proof.scenarios import Case, cases
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import FiveBarError
from fivebar_sim.metrics.columns import side_by_side
from fivebar_sim.rollout import Result, execute, run_all
from fivebar_sim.simulation.plan import Plan, plan
from fivebar_sim.workers.here import Here, Workers
from fivebar_sim.workers.here import Task as Work

BLOCK = 8
"""Designs that are simulated together."""


class Ran(NamedTuple):
    """What a motion's motors did in the part of a run that is measured.

    Attributes:
        torque: Of A and E [N m], (N, 2).
        speed: [rad/s], (N, 2).
        weight: Share of the motion, relative to the others'.
        seconds: How long the part lasts [s].
    """

    torque: Array
    speed: Array
    weight: float
    seconds: float


class Simulated(NamedTuple):
    """What came of a design.

    Attributes:
        measured: Objectives by name, as far as a simulation measures them; empty if it broke down.
        guards: Guards that tripped.
        error: Why there is no result; "" if there is one.
    """

    measured: dict[str, float]
    guards: tuple[str, ...]
    error: str


def simulate(designs: Sequence[Sequence[Case]]) -> list[Simulated]:
    """Return what comes of designs, each given by its runs."""
    planned = [_planned(each) for each in designs]
    plans = [one for each in planned if not isinstance(each, str) for one in each]
    results = iter(_results(plans))
    found = []
    for runs, each in zip(designs, planned, strict=True):
        if isinstance(each, str):
            found.append(Simulated({}, (), each))
        else:
            found.append(_simulated(runs, [next(results) for _ in each]))
    return found


def simulated(
    task: Task,
    values: Array,
    workers: Workers | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> list[Simulated]:
    """Return what comes of designs of a task in MuJoCo.

    Args:
        task: The task.
        values: The designs, (n, d).
        workers: Who simulates; None is this process.
        watch: Is told how many designs are done, and how many there are.
    """
    found: dict[int, list[Simulated]] = {}
    for k, block in (workers or Here()).results(simulate, _blocks(task, values)):
        found[k] = block
        if watch is not None:
            watch(sum(map(len, found.values())), len(values))
    return [each for k in sorted(found) for each in found[k]]


def _blocks(task: Task, values: Array) -> Iterator[Work]:
    """Yield the runs of some designs after the other."""
    for k, start in enumerate(range(0, len(values), BLOCK)):
        yield k, [cases(task, row) for row in values[start : start + BLOCK]]


def _planned(runs: Sequence[Case]) -> list[Plan] | str:
    """Return the plans of a design, or why there are none."""
    try:
        return [plan(case.scenario) for case in runs]
    except FiveBarError as error:
        return str(error)


def _results(plans: Sequence[Plan]) -> list[Result | FiveBarError]:
    try:
        return [*run_all(plans)]
    # The batch ends as a whole; one by one the others still get their results, bit for bit.
    except FiveBarError:
        return [_alone(planned) for planned in plans]


def _alone(planned: Plan) -> Result | FiveBarError:
    try:
        return execute(planned)
    except FiveBarError as error:
        return error


def _simulated(runs: Sequence[Case], results: Sequence[Result | FiveBarError]) -> Simulated:
    """Return what came of a design."""
    ran: list[Ran] = []
    guards: list[str] = []
    for case, result in zip(runs, results, strict=True):
        if isinstance(result, FiveBarError):
            return Simulated({}, (), str(result))
        guards += [guard.name for guard in result.measured.guards if not guard.ok]
        ran.append(_ran(case, result))
    servo = runs[0].scenario.servo
    return Simulated(measured(ran, servo), tuple(dict.fromkeys(guards)), "")


def _ran(case: Case, result: Result) -> Ran:
    """Return what the motors did in the last part of a run."""
    rows = slice(-round(case.seconds / case.scenario.sim.timestep), None)
    torque = side_by_side(result.record, ("torque_A", "torque_E"))[rows]
    speed = side_by_side(result.record, ("theta_dot_A", "theta_dot_E"))[rows]
    return Ran(torque, speed, case.weight, case.seconds)


def measured(ran: Sequence[Ran], servo: Servo) -> dict[str, float]:
    """Return the objectives that a simulation measures, as `objectives.CATALOGUE` defines them."""
    total = sum(each.weight for each in ran)

    def mean(values: Callable[[Ran], Array]) -> Array:
        parts = [each.weight / total * values(each).mean(axis=0) for each in ran]
        return np.sum(parts, axis=0)

    squares = mean(lambda each: each.torque**2)
    shares = mean(lambda each: np.abs(each.torque))
    work = mean(lambda each: each.seconds * np.maximum(each.torque * each.speed, 0.0))
    found = {
        "torque_peak": float(max(np.abs(each.torque).max() for each in ran)),
        "torque_rms": float(np.sqrt(squares.max())),
        "energy": float(work.sum()),
        "balance": float(abs(shares[0] - shares[1]) / (shares.sum() or 1.0)),
    }
    if servo.winding is not None:
        assert servo.kt is not None
        assert servo.resistance is not None
        found["heat"] = float(squares.sum() * servo.resistance / servo.kt**2)
    return found
