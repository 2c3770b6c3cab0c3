"""What a robot did, from its record alone; see `legs`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.metrics.columns import (
    COMMAND_COLUMNS,
    JOINT_COLUMNS,
    RATE_COLUMNS,
    TORQUE_COLUMNS,
    Record,
    side_by_side,
)
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.columns import FORCE_COLUMNS, TRUNK_COLUMNS
from fivebar_sim.runs.anew import legs
from fivebar_sim.walking.plan import RobotPlan
from fivebar_sim.walking.walk import Walk, of_states

OF_POSE = 7
"""Columns of the trunk that are of its pose; the others are its rates."""


def walk(planned: RobotPlan, record: Record, unsolved: Bools) -> Walk:
    """Return what a robot did.

    Args:
        planned: The plan that was simulated.
        record: The columns of rollout.parquet.
        unsolved: Whether MuJoCo's solver ran out of iterations in each step, (N,).
    """
    on_floor = isinstance(planned.scene, Floor)
    pose = TRUNK_COLUMNS[:OF_POSE] if on_floor else ()
    rates = TRUNK_COLUMNS[OF_POSE:] if on_floor else ()
    q = side_by_side(record, [*pose, *_of_legs(JOINT_COLUMNS)])
    v = side_by_side(record, [*rates, *_of_legs(RATE_COLUMNS)])
    torque = side_by_side(record, _of_legs(TORQUE_COLUMNS))
    # The joints of the motors, in the order of ctrl.
    driven = planned.model.jnt_dofadr[planned.model.actuator_trnid[:, 0]]
    applied = np.zeros_like(v)
    applied[:, driven] = torque - planned.scenario.servo.gear.viscous * v[:, driven]
    states = legs.of_columns(
        planned.model,
        q=np.concatenate([planned.start[None], q]),
        v=v,
        time=record["time"],
        ctrl=side_by_side(record, _of_legs(COMMAND_COLUMNS)),
        ground=_forces(record, on_floor),
        applied=applied,
        unsolved=unsolved,
    )
    return of_states(planned, states)


def _forces(record: Record, on_floor: bool) -> Array:
    """Return the floor's forces on all feet [N], (N, 12); (N, 0) of a robot that is held."""
    if not on_floor:
        return np.empty((len(record["time"]), 0))
    return side_by_side(record, _of_legs(FORCE_COLUMNS))


def _of_legs(names: Sequence[str]) -> list[str]:
    """Return the columns of some names of all legs, leg by leg."""
    return [f"{leg}_{name}" for leg in LEGS for name in names]
