"""The record of a robot's run: the columns of rollout.parquet, from the simulated states."""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.dynamics.gears import Foot, bars
from fivebar_sim.metrics.columns import Record
from fivebar_sim.model.feet import POSE, Hips, walking
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.columns import FORCE_COLUMNS, TRUNK_COLUMNS
from fivebar_sim.robots.hips.motors import QUANTITIES, column
from fivebar_sim.simulation import record as recorded
from fivebar_sim.simulation.record import Part
from fivebar_sim.simulation.steps import States
from fivebar_sim.walking.plan import RobotPlan


def columns(planned: RobotPlan, part: Part) -> Record:
    """Return rows of the record: row k is the state at t = (k + 1) h, with the torques to it.

    Args:
        planned: The plan that was simulated.
        part: Its steps, all or some.
    """
    states = part.states
    record: Record = {"time": np.ascontiguousarray(states.time[0])}
    if isinstance(planned.scene, Floor):
        pose = np.concatenate([states.qpos[0, :, :7], states.qvel[0, :, :6]], axis=1)
        record |= dict(zip(TRUNK_COLUMNS, np.ascontiguousarray(pose.T), strict=True))
    for k, leg in enumerate(LEGS):
        record |= {f"{leg}_{name}": column for name, column in _leg(planned, part, k).items()}
    return record


def _leg(planned: RobotPlan, part: Part, k: int) -> Record:
    """Return the columns of leg k, without its name and the time."""
    own = of_leg(planned, part, k)
    record = recorded.columns(planned.legs[k], own, recorded.points(planned.legs[k], own))
    del record["time"]
    for i in range(len(planned.robot.hip_motors)):
        record |= _turned(planned, part, k, i)
    # Held out of reach of the floor, a foot has a sensor of its force too.
    if isinstance(planned.scene, Floor):
        force = wrench(part.states, k)[:, : len(FORCE_COLUMNS)]
        record |= dict(zip(FORCE_COLUMNS, force.T, strict=True))
    return {name: np.ascontiguousarray(column) for name, column in record.items()}


def _turned(planned: RobotPlan, part: Part, k: int, i: int) -> Record:
    """Return the columns of motor i of the hip of leg k.

    tau = kp (u - theta) - kd theta_dot,   at a step's end; under `implicitfast` theta at its start
    """
    motor = planned.robot.hip_motors[i]
    place = planned.robot.joints * (k - len(LEGS)) + i
    theta = part.states.qpos[0, :, place]
    rate = part.states.qvel[0, :, place]
    command = planned.swings[part.begin : part.begin + len(theta), k, i]

    late = planned.sim.integrator == "discrete"
    acting = theta if late else np.concatenate([part.before[place][None], theta[:-1]])
    torque = motor.kp * (command - acting) - motor.kd * rate
    names = [column(quantity, motor) for quantity in QUANTITIES]
    return dict(zip(names, (theta, rate, command, torque), strict=True))


def wrench(states: States, k: int) -> Array:
    """Return the floor's force on foot k, and on uneven ground its torque and place, (N, 3 or 9).

    The torque is about the place, and all along the world's axes [N], [N m], [m].
    """
    width = states.ground.shape[-1] // len(LEGS)
    return states.ground[0, :, width * k : width * (k + 1)]


def of_leg(planned: RobotPlan, part: Part, k: int) -> Part:
    """Return steps of leg k, as if it were alone."""
    # The legs' joints are the last of the robot's; those of its hip come before a leg's four.
    width = planned.robot.joints
    last = width * (k + 1 - len(LEGS))
    joints = slice(last - 4, last or None)
    motors = slice(2 * (k - len(LEGS)), 2 * (k + 1 - len(LEGS)) or None)

    states = part.states
    own = states._replace(
        qpos=states.qpos[..., joints],
        qvel=states.qvel[..., joints],
        ctrl=states.ctrl[..., motors],
        constraint=states.constraint[..., joints],
    )
    return Part(own, part.begin, part.before[joints], _foot(planned, part, k))


def _foot(planned: RobotPlan, part: Part, k: int) -> Foot | None:
    """Return what the floor does to foot k in each step, where the gears' share is told from it."""
    if not isinstance(planned.scene, Floor) or not planned.robot.servo.records_friction:
        return None
    q = before(part.before, part.states.qpos[0])
    joints = q[:, None, POSE + 4 * k : POSE + 4 * k + 4]
    force = part.states.ground[0, :, None, 3 * k : 3 * k + 3]
    hips = Hips.of([planned.model], [f"{LEGS[k]}_"])
    return walking(bars(planned.robot.leg), hips, joints, q[:, :POSE], force)


def before(start: Array, after: Array) -> Array:
    """Return values before each step, of those after each and the first, (N, n)."""
    return np.concatenate([start[None], after[:-1]])
