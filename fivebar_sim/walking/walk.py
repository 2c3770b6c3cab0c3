"""A robot's run: simulated and recorded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import DivergedError
from fivebar_sim.metrics.columns import Record
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.columns import trunk
from fivebar_sim.robots.jump import Jump, jump
from fivebar_sim.robots.measure import Fall, Trunk, falls
from fivebar_sim.simulation import record as recorded
from fivebar_sim.simulation.record import Part
from fivebar_sim.simulation.steps import States, Watch, check_states, simulate
from fivebar_sim.walking.plan import RobotPlan
from fivebar_sim.walking.record import columns, of_leg
from fivebar_sim.walking.steer import steered
from fivebar_sim.walking.touching import TRUNK, depths


class Walk(NamedTuple):
    """What a robot did.

    Attributes:
        plan: What was simulated.
        record: Every step, SI: `time`, of a robot on a floor `TRUNK_COLUMNS`, and of each leg the
            columns of a leg alone and `FORCE_COLUMNS`, with the leg's name in front, `FL_foot_x`;
            targets and feet in the hip frames.
        trunk: The trunk after each step; None where it is held.
        falls: When it fell, and why.
        states: What MuJoCo had after each step.
        depths: How deep each part is in uneven ground, see `touching.depths`; None of a flat floor.
    """

    plan: RobotPlan
    record: Record
    trunk: Trunk | None
    falls: list[Fall]
    states: States
    depths: dict[str, Array] | None = None

    def __repr__(self) -> str:
        """Return what it is of: the record would fill pages."""
        fell = f", fell at {self.falls[0].time:g} s" if self.falls else ""
        return f"Walk({self.plan.scenario.name!r}: {len(self.record['time'])} steps{fell})"


def walk(planned: RobotPlan, watch: Watch | None = None) -> Walk:
    """Return what a robot does.

    Args:
        planned: The plan.
        watch: Is shown the states as they come.

    Raises:
        DivergedError: The simulation broke down; says when.
    """
    if planned.setpoints is None:
        return of_states(planned, steered(planned, watch))
    table = np.concatenate([planned.besides, planned.setpoints], axis=1)
    states = simulate(planned.model, planned.start[None], table[None], watch=watch)
    return of_states(planned, states)


def walk_all(plans: Sequence[RobotPlan], nthread: int = 1) -> list[Walk]:
    """Return what robots do, simulated together: of one structure, timestep and duration.

    Args:
        plans: The plans.
        nthread: Threads; 0 is one for every processor.

    Raises:
        DivergedError: A simulation broke down; says which, and when.
    """
    tables = [
        np.concatenate([planned.besides, planned.setpoints], axis=1)
        for planned in plans
        if planned.setpoints is not None
    ]
    if len(tables) < len(plans):
        return [walk(planned) for planned in plans]

    states = simulate(
        [planned.model for planned in plans],
        np.stack([planned.start for planned in plans]),
        np.stack(tables),
        nthread,
    )
    return [
        of_states(planned, states.rows(slice(row, row + 1))) for row, planned in enumerate(plans)
    ]


def of_states(planned: RobotPlan, states: States) -> Walk:
    """Return what a robot did, of the states of its simulation.

    Raises:
        DivergedError: The simulation broke down; says when.
    """
    try:
        check_states(states, planned.sim.timestep)
    except DivergedError as error:
        raise DivergedError(f"{planned.scenario.name}: {error}", error.time) from None

    record = columns(planned, Part(states, 0, planned.start))
    body = trunk(record)
    box = planned.robot.trunk
    if body is None:
        return Walk(planned, record, None, [], states)

    scene = planned.scene
    deep = depth = None
    if isinstance(scene, Floor) and not scene.ground.level:
        deep = depths(planned.robot, scene, states.qpos[0])
        depth = deep[TRUNK]
    fell = falls(body, box.size, np.array(box.center), depth)
    return Walk(planned, record, body, fell, states, deep)


def jumped(went: Walk) -> Jump | None:
    """Return the highest jump of a run; None where the robot never left the floor upward."""
    if went.trunk is None:
        return None
    stands = np.any([went.record[f"{leg}_ground_z"] > 0.0 for leg in LEGS], axis=0)
    return jump(went.trunk, stands)


def saturated(went: Walk, k: int) -> Bools:
    """Return whether the torque limit clipped the motors of leg k in each step, (N, 2)."""
    whole = Part(went.states, 0, went.plan.start)
    return recorded.saturated(went.plan.legs[k], of_leg(went.plan, whole, k))
