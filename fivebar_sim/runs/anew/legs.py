"""The states of a run, from its record alone: what MuJoCo had after each step, read back.

Poses, rates, commands and forces of the ground are columns. The joint forces of constraints are
none, and follow from Newton's law: what torques, pushes and weight leave unexplained of a step,

    f = M(q) (v' - v) / h + c(q, v) - tau - J^T F + b v',

with M and c those of the model at the step's start, and b the gears' viscous friction.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.metrics.columns import (
    COMMAND_COLUMNS,
    GROUND_COLUMNS,
    HIP_COLUMNS,
    JOINT_COLUMNS,
    MOTORS_FROM_END,
    RATE_COLUMNS,
    Record,
    motors,
    side_by_side,
)
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.steps import States


def states(planned: Plan, record: Record, unsolved: Bools) -> States:
    """Return the states of a leg's run.

    Args:
        planned: The plan that was simulated.
        record: The columns of rollout.parquet.
        unsolved: Whether MuJoCo's solver ran out of iterations in each step, (N,).
    """
    moves = "hip_z" in record
    q = side_by_side(record, [*HIP_COLUMNS[:1] * moves, *JOINT_COLUMNS])
    v = side_by_side(record, [*HIP_COLUMNS[1:] * moves, *RATE_COLUMNS])

    applied = np.zeros_like(v)
    applied[:, MOTORS_FROM_END] = motors(record, "torque")
    applied[:, MOTORS_FROM_END] -= planned.scenario.servo.gear.viscous * v[:, MOTORS_FROM_END]

    return of_columns(
        planned.model,
        q=np.concatenate([planned.start[None], q]),
        v=v,
        time=record["time"],
        ctrl=np.column_stack([planned.pushes, side_by_side(record, COMMAND_COLUMNS)]),
        ground=side_by_side(record, GROUND_COLUMNS) if moves else np.empty((len(v), 0)),
        applied=applied,
        pushes=planned.pushes,
        unsolved=unsolved,
    )


def of_columns(
    model: mujoco.MjModel,
    *,
    q: Array,
    v: Array,
    time: Array,
    ctrl: Array,
    ground: Array,
    applied: Array,
    unsolved: Bools,
    pushes: Array | Sequence[Array] = (),
) -> States:
    """Return the states of one simulation from their parts.

    Args:
        model: What was simulated.
        q: qpos before the first step, then after each, (N + 1, nq).
        v: qvel after each step, which began at rest, (N, nv).
        time: Time after each step [s], (N,).
        ctrl: Commands, (N, nu).
        ground: As in `States`, of this simulation alone, (N, k).
        applied: Joint forces of motors and viscous friction in each step, (N, nv).
        unsolved: Whether MuJoCo's solver ran out of iterations in each step, (N,).
        pushes: Forces on the foot along the hip frame's x and z in each step [N], (N, 2), or empty.
    """
    h = float(model.opt.timestep)
    needed = _needed(model, q, np.concatenate([np.zeros((1, v.shape[1])), v]), h)
    constraint = needed - applied
    if np.size(pushes):
        constraint -= _pushed(model, q, np.asarray(pushes))
    iterations = np.where(unsolved, model.opt.iterations, 0)
    return States(
        time=time[None],
        qpos=q[None, 1:],
        qvel=v[None],
        ctrl=ctrl[None],
        ground=ground[None],
        constraint=constraint[None],
        iterations=iterations[None],
        # A run that MuJoCo warned about is no run.
        warnings=np.zeros(1),
    )


def _needed(model: mujoco.MjModel, q: Array, v: Array, h: float) -> Array:
    """Return M(q) (v' - v) / h + c(q, v) of each step, gravity included, (N, nv)."""
    data = mujoco.MjData(model)
    # MuJoCo takes rows that lie in one piece of memory.
    acceleration = np.ascontiguousarray(np.diff(v, axis=0)) / h
    found = np.empty_like(acceleration)
    bias = np.empty(model.nv)
    for k, wanted in enumerate(acceleration):
        data.qpos[:] = q[k]
        data.qvel[:] = v[k]
        # What the law needs of `mj_forward`, and no more.
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, bias)
        mujoco.mj_mulM(model, data, found[k], wanted)
        found[k] += bias
    return found


def _pushed(model: mujoco.MjModel, q: Array, pushes: Array) -> Array:
    """Return the joint forces of pushes on the foot in each step, (N, nv)."""
    data = mujoco.MjData(model)
    foot = model.site("foot").id
    jac = np.empty((3, model.nv))
    found = np.empty((len(pushes), model.nv))
    for k, (x, z) in enumerate(pushes):
        data.qpos[:] = q[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, jac, None, foot)
        found[k] = x * jac[0] + z * jac[2]
    return found
