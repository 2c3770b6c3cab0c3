"""What a robot did, from its record alone; see `legs`."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.metrics.columns import (
    COMMAND_COLUMNS,
    JOINT_COLUMNS,
    MOTORS,
    RATE_COLUMNS,
    Record,
    side_by_side,
)
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.columns import FORCE_COLUMNS, TRUNK_COLUMNS
from fivebar_sim.robots.hips.motors import column
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

    Raises:
        RunDirectoryError: A run on uneven ground.
    """
    on_floor = isinstance(planned.scene, Floor)
    if isinstance(planned.scene, Floor) and not planned.scene.ground.level:
        raise RunDirectoryError(
            "of uneven ground a record has the forces, but not where they act: run scenario.toml "
            "again"
        )

    pose = TRUNK_COLUMNS[:OF_POSE] if on_floor else ()
    rates = TRUNK_COLUMNS[OF_POSE:] if on_floor else ()

    hips = planned.robot.hip_motors
    angles = [column("theta", motor) for motor in hips]
    turning = [column("theta_dot", motor) for motor in hips]
    q = side_by_side(record, [*pose, *_of_legs([*angles, *JOINT_COLUMNS])])
    v = side_by_side(record, [*rates, *_of_legs([*turning, *RATE_COLUMNS])])

    before = np.concatenate([planned.start[None], q])
    states = legs.of_columns(
        planned.model,
        q=before,
        v=v,
        time=record["time"],
        ctrl=np.concatenate(
            [planned.besides, side_by_side(record, _of_legs(COMMAND_COLUMNS))], axis=1
        ),
        ground=_forces(record, on_floor),
        applied=_applied(planned, record, v) + _pushed(planned, before, v),
        unsolved=unsolved,
    )
    return of_states(planned, states)


def _applied(planned: RobotPlan, record: Record, v: Array) -> Array:
    """Return the joint forces of all motors and of viscous friction in each step, (N, nv)."""
    model = planned.model
    found = np.zeros_like(v)
    for leg in LEGS:
        for motor in (*MOTORS, *(each.letter for each in planned.robot.hip_motors)):
            place = int(model.joint(f"{leg}_{motor}").dofadr[0])
            found[:, place] = record[f"{leg}_torque_{motor}"]
            if motor in MOTORS:
                found[:, place] -= planned.scenario.servo.gear.viscous * v[:, place]
    return found


def _pushed(planned: RobotPlan, q: Array, v: Array) -> Array:
    """Return the joint forces of the pushes on the trunk in each step, (N, nv)."""
    model = planned.model
    data = mujoco.MjData(model)
    jac = np.empty((3, model.nv))
    found = np.zeros_like(v)

    for k in np.flatnonzero(planned.pushes.any(axis=1)):
        data.qpos[:] = q[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for i, force in enumerate(planned.pushes[k].reshape(-1, 3)):
            mujoco.mj_jacSite(model, data, jac, None, model.site(f"push_{i}").id)
            found[k] += force @ jac
    return found


def _forces(record: Record, on_floor: bool) -> Array:
    """Return the floor's forces on all feet [N], (N, 12); (N, 0) of a robot that is held."""
    if not on_floor:
        return np.empty((len(record["time"]), 0))
    return side_by_side(record, _of_legs(FORCE_COLUMNS))


def _of_legs(names: Sequence[str]) -> list[str]:
    """Return the columns of some names of all legs, leg by leg."""
    return [f"{leg}_{name}" for leg in LEGS for name in names]
