"""The record of a run: the columns of rollout.parquet, from the simulated states."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.control import Feedback
from fivebar_sim.control.servo import Drive, MotorStep, applied_torque
from fivebar_sim.control.servo import saturated as clipped
from fivebar_sim.dynamics import gears
from fivebar_sim.kinematics.closure import points_along
from fivebar_sim.kinematics.stops import Ranges
from fivebar_sim.metrics.columns import (
    BELT_COLUMN,
    COLUMNS,
    FRICTION_COLUMNS,
    GROUND_COLUMNS,
    HIP_COLUMNS,
    JOINTS,
    MOTORS_FROM_END,
    RAIL_COLUMN,
    Record,
    motors,
)
from fivebar_sim.scenario.scenes import Ground, Treadmill
from fivebar_sim.simulation import sampling
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.steps import States


class Part(NamedTuple):
    """Some steps of one simulation that follow each other.

    Attributes:
        states: The states after each of them.
        begin: Index of the first.
        before: qpos before it, (nq,).
        foot: What the floor does to the foot of a robot's leg; None of a leg alone, whose ground
            `states` have.
    """

    states: States
    begin: int
    before: Array
    foot: gears.Foot | None = None


def points(
    planned: Plan, part: Part, along: tuple[Array, Array, Array, Array] | None = None
) -> kinematics.Points:
    """Return the joints after each step [m], hip frame, (N, 2) each, the loop open by its gap.

    Args:
        planned: The plan that was simulated.
        part: Its steps, all or some.
        along: Their `directions`, if somebody has them already.
    """
    # From qpos itself: MuJoCo's site positions are those before the step.
    q = _joints(part.states)[0]
    if along is None:
        return kinematics.chain_points(planned.scenario.leg, q)
    return points_along(planned.scenario.leg, q, along)


def columns(planned: Plan, part: Part, points: kinematics.Points) -> Record:
    """Return rows of the record: row k is the state at t = (k + 1) h, with the torques to it.

    Args:
        planned: The plan that was simulated.
        part: Its steps, all or some.
        points: Their `points`.
    """
    wanted = planned.motion
    begin = part.begin
    q, v, ctrl = _joints(part.states)
    # The plan starts at t = 0, the states one step later.
    rows = slice(begin + 1, begin + len(q) + 1)
    target = wanted.foot[rows]
    gap = points.C_right - points.C_left
    torque = _torque(planned, part)
    vectors = [*target.T, *points.F.T, *q.T, *v.T, *ctrl.T, *torque.T]
    values = [wanted.time[rows], *vectors, np.hypot(gap[:, 0], gap[:, 1])]
    record = dict(zip(COLUMNS, values, strict=True))
    return record | _rubbed(planned, part) | _surroundings(planned, part)


def forces(planned: Plan, part: Part) -> Array:
    """Return the joint forces of constraints and viscous friction in each step [N m], (N, nv).

    MuJoCo counts the latter as damping, which a motor has too.
    """
    states = part.states
    viscous = planned.scenario.servo.gear.viscous
    if viscous == 0.0:
        return states.constraint[0]
    found = states.constraint[0].copy()
    found[:, MOTORS_FROM_END] -= viscous * states.qvel[0, :, MOTORS_FROM_END]
    return found


def _rubbed(planned: Plan, part: Part) -> Record:
    """Return the columns of the gears' friction, where the servo's table describes it."""
    if not planned.scenario.servo.records_friction:
        return {}
    states = part.states
    before = np.concatenate([part.before[None], states.qpos[0, :-1]])
    hip = before[:, 0] if before.shape[1] > len(JOINTS) else np.zeros(len(before))

    bars = gears.bars(planned.scenario.leg)
    foot = part.foot
    if isinstance(planned.scenario.scene, Ground):
        foot = gears.standing(bars, before[:, -4:], states.ground[0], hip)
    found = gears.through(bars, before[:, -4:], states.constraint[0, :, -4:], foot).gear
    viscous = planned.scenario.servo.gear.viscous * states.qvel[0, :, MOTORS_FROM_END]
    return dict(zip(FRICTION_COLUMNS, (found - viscous).T, strict=True))


def _joints(states: States) -> tuple[Array, Array, Array]:
    """Return the leg's four joint angles, their rates, and the commands of A and E."""
    return states.qpos[0, :, -4:], states.qvel[0, :, -4:], states.ctrl[0, :, -2:]


def drive(planned: Plan) -> Drive:
    """Return what the commands of a plan are."""
    # A controller that plans has no `drive`: its setpoints are angles.
    return getattr(planned.scenario.controller, "drive", "position")


def _torque(planned: Plan, part: Part) -> Array:
    """Return the torque that each motor gave in each step [N m], (N, 2)."""
    return applied_torque(planned.scenario.servo, _steps(planned, part))


def _steps(planned: Plan, part: Part) -> MotorStep:
    """Return every step as the motors see it, (n, 2)."""
    q = part.states.qpos[0, :, MOTORS_FROM_END]
    return MotorStep(
        integrator=planned.scenario.sim.integrator,
        ctrl=_joints(part.states)[2],
        q=np.concatenate([part.before[None, MOTORS_FROM_END], q[:-1]]),
        q_next=q,
        v_next=part.states.qvel[0, :, MOTORS_FROM_END],
        drive=drive(planned),
    )


def growth(planned: Plan, record: Record) -> Array | None:
    """Return the decades by which errors of the feedback would have grown by each step, (N,).

    None without feedback, or where it cannot be told.
    """
    if not isinstance(planned.scenario.controller, Feedback):
        return None
    angles = motors(record, "theta")
    rates = motors(record, "theta_dot")
    stands = np.zeros(len(angles), dtype=bool)
    if "ground_z" in record:
        stands = record["ground_z"] > 0.0
    found = sampling.stability(planned.scenario, planned.motion, angles, rates, stands)
    return None if found is None else found.hidden(record["time"])


def lowest(built: mujoco.MjModel) -> float:
    """Return the height of the lowest point of hip and trunk above the hip frame's origin [m]."""
    # The trunk of a rail has its origin in the hip's; both carry boxes alone.
    kind = mujoco.mjtObj.mjOBJ_BODY
    bodies = [mujoco.mj_name2id(built, kind, name) for name in ("hip", "trunk")]
    geoms = np.flatnonzero(np.isin(built.geom_bodyid, bodies))
    turned = np.empty(9)
    below = []
    for i in geoms:
        mujoco.mju_quat2Mat(turned, built.geom_quat[i])
        reach = float(np.abs(turned[6:]) @ built.geom_size[i])
        below.append(float(built.geom_pos[i, 2]) - reach)
    return min(below)


def ranges(built: mujoco.MjModel, front: str = "") -> Ranges:
    """Return the ranges of the hinges that have stops, and that of the angle at C.

    Args:
        built: The model.
        front: What the names of a robot's leg begin with, "FL_".
    """
    ids = {joint: built.joint(f"{front}{joint}").id for joint in JOINTS}
    limited = {joint: built.jnt_range[i] for joint, i in ids.items() if built.jnt_limited[i]}
    tendon = built.tendon(f"{front}C_angle").id
    if built.tendon_limited[tendon]:
        limited["C"] = built.tendon_range[tendon]
    return {joint: (float(low), float(high)) for joint, (low, high) in limited.items()}


def saturated(planned: Plan, part: Part) -> Bools:
    """Return whether the torque limit clipped each motor in each step, (N, 2)."""
    return clipped(planned.scenario.servo, _steps(planned, part))


def _surroundings(planned: Plan, part: Part) -> Record:
    """Return the columns of hip, ground and belt, where the scene has them."""
    scene = planned.scenario.scene
    states = part.states
    begin = part.begin
    steps = states.time.shape[1]
    record: Record = {}

    if isinstance(scene, Ground):
        hip = (states.qpos[0, :, 0], states.qvel[0, :, 0])
        record |= dict(zip(HIP_COLUMNS, hip, strict=True))
        record |= dict(zip(GROUND_COLUMNS, states.ground[0].T, strict=True))
        record[RAIL_COLUMN] = _rail_end(planned, part)

    if isinstance(scene, Treadmill):
        record[BELT_COLUMN] = (
            -(scene.speed or 0.0) * planned.motion.time[begin + 1 : begin + steps + 1]
        )
    return record


def _rail_end(planned: Plan, part: Part) -> Array:
    """Return the force of the rail's lower end on the trunk in each step [N], (N,)."""
    slide = planned.model.joint("hip_z")
    states = part.states
    height = states.qpos[0, :, 0]
    if not planned.model.jnt_limited[slide.id]:
        return np.zeros_like(height)

    # Floor and rail's end are all that the world does to leg and trunk along z; the rest is inside.
    force = states.constraint[0, :, 0] - states.ground[0, :, 1]
    before = np.concatenate([part.before[:1], height[:-1]])
    # The end acts in steps that begin below it; elsewhere the difference is rounding.
    return np.where(before < slide.range[0], force, 0.0)
