"""The guards of a robot: those of each leg, the worst one counts; its energy, its falls, its floor.

What one leg's guard says names the leg.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.dynamics.heat import Heating
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.branch import Branch
from fivebar_sim.metrics.columns import Record
from fivebar_sim.metrics.energy import Balance
from fivebar_sim.metrics.guards import Evidence, Found, Guard
from fivebar_sim.robots import places
from fivebar_sim.robots.measure import lowest
from fivebar_sim.simulation import jolts
from fivebar_sim.simulation import record as recorded
from fivebar_sim.walking.walk import Walk

OF_ROBOT = ("energy", "constraints", "step", "solver")
"""Guards that look at the whole robot."""

OF_LEGS = ("branch", "loop", "torque", "chatter", "stops", "heat", "feedback", "jolts")
"""Guards that look at one leg."""


class Seen(NamedTuple):
    """What guards see of one leg.

    Attributes:
        name: One of `LEGS`.
        record: Its columns as a leg alone has them, without any ground.
        branch: How it was folded.
        saturated: Whether the torque limit clipped A and E in each step, (N, 2).
        heated: The heat of its motors; None where the winding is not known.
        height: Height of the foot's ball above the floor [m], (N,); None in the air.
    """

    name: str
    record: Record
    branch: Branch
    saturated: Bools
    heated: Heating | None
    height: Array | None


def judge(went: Walk, legs: list[Seen], balance: Balance) -> list[Guard]:
    """Return every guard of a robot's run, in the order of a leg's.

    Args:
        went: What the robot did.
        legs: Its legs.
        balance: Works and energies of each step.
    """
    evidence = [_evidence(went, k, leg, balance) for k, leg in enumerate(legs)]
    found: dict[str, Found] = {}
    for rule in guards.GUARDS:
        if rule.name in OF_ROBOT:
            whole = rule.function(evidence[0])
            assert whole is not None
            found[rule.name] = whole
        elif rule.name in OF_LEGS:
            each = {leg.name: rule.function(run) for leg, run in zip(legs, evidence, strict=True)}
            known = {name: one for name, one in each.items() if one is not None}
            if known:
                found[rule.name] = worst(known)

    if went.trunk is not None:
        found |= _on_floor(went, legs, evidence[0])
    return [Guard(name=name, **one._asdict(), ok=one.time is None) for name, one in found.items()]


def worst(legs: dict[str, Found]) -> Found:
    """Return the worst value of all legs, and which was the first above its bound."""
    values = [found.value for found in legs.values() if found.value is not None]
    high = next(iter(legs.values())).high
    times = {name: found.time for name, found in legs.items() if found.time is not None}
    value = max(values, default=None)
    if not times:
        return Found(value, high, None)
    first = min(times, key=lambda name: times[name])
    part = legs[first].part
    return Found(value, high, times[first], f"{first} {part}" if part else first)


def _evidence(went: Walk, k: int, leg: Seen, balance: Balance) -> Evidence:
    """Return what a leg's guards look at."""
    planned = went.plan
    states = went.states

    return Evidence(
        bounds=planned.scenario.guards,
        leg=planned.robot.leg,
        record=leg.record,
        branch=leg.branch,
        saturated=leg.saturated,
        balance=balance,
        unsolved=states.iterations[0] >= planned.model.opt.iterations,
        command=planned.scenario.command,
        ranges=recorded.ranges(planned.model, f"{leg.name}_"),
        trunk=0.0,
        heating=leg.heated,
        growth=recorded.growth(planned.legs[k], _grounded(went, leg)),
        jolts=jolts.jolts(planned.legs[k], leg.record),
    )


def _grounded(went: Walk, leg: Seen) -> Record:
    """Return a leg's record with the floor's force on its foot, if there is a floor."""
    if went.trunk is None:
        return leg.record
    return {**leg.record, "ground_z": went.record[f"{leg.name}_ground_z"]}


def _on_floor(went: Walk, legs: list[Seen], run: Evidence) -> dict[str, Found]:
    """Return the guards of a robot on a floor: its feet's depth, what else is in it, its falls."""
    robot = went.plan.robot
    bounds = run.bounds
    fell = went.falls

    feet, parts = _in_floor(went, legs) if went.depths is None else _in_ground(went.depths)
    return {
        "ground": guards.first_of(run, feet, bounds.ground * 2.0 * robot.leg.foot_radius),
        "floor": guards.first_of(run, parts, bounds.floor * robot.leg.size),
        "fall": Found(
            float(len(fell)),
            0.0,
            fell[0].time if fell else None,
            fell[0].why.replace(",", "") if fell else None,
        ),
    }


def _in_floor(went: Walk, legs: list[Seen]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return how deep feet, and all other parts, are in a flat floor [m], (N,) by their names."""
    robot = went.plan.robot
    trunk = went.trunk
    assert trunk is not None
    feet = {leg.name: np.maximum(-leg.height, 0.0) for leg in legs if leg.height is not None}
    parts: dict[str, Array] = {}
    for leg in legs:
        own = places.depths(robot, trunk, robot.hips[leg.name], leg.record)
        parts |= {f"{leg.name} {part}": depth for part, depth in own.items()}
    box = lowest(trunk, robot.trunk.size, np.array(robot.trunk.center))
    parts["trunk"] = np.maximum(-box, 0.0)
    return feet, parts


def _in_ground(depths: dict[str, Array]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return the same of uneven ground."""
    feet = {name.split()[0]: deep for name, deep in depths.items() if name.endswith("foot")}
    parts = {name: deep for name, deep in depths.items() if not name.endswith("foot")}
    return feet, parts
