"""A robot's run: simulated, recorded, measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.control.servo import MotorStep, applied_torque
from fivebar_sim.errors import DivergedError
from fivebar_sim.metrics.columns import COLUMNS, MOTOR_JOINTS, Record
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.measure import Fall, Trunk, falls
from fivebar_sim.simulation.steps import States, check_states, simulate
from fivebar_sim.walking.plan import RobotPlan

TRUNK_COLUMNS = (
    *("trunk_x", "trunk_y", "trunk_z"),
    *("trunk_qw", "trunk_qx", "trunk_qy", "trunk_qz"),
)
"""Where the trunk's origin is [m], and how it is turned."""

FORCE_COLUMNS = ("ground_x", "ground_y", "ground_z")
"""The floor's force on a foot, along the world's axes [N]."""


class Walk(NamedTuple):
    """What a robot did.

    Attributes:
        plan: What was simulated.
        record: Every step, SI: `time`, of a robot on a floor `TRUNK_COLUMNS`, and of each leg the
            columns of a leg alone and `FORCE_COLUMNS`, with the leg's name in front, `FL_foot_x`;
            targets and feet in the hip frames.
        trunk: The trunk after each step; None where it is held.
        falls: When it fell, and why.
    """

    plan: RobotPlan
    record: Record
    trunk: Trunk | None
    falls: list[Fall]

    def __repr__(self) -> str:
        """Return what it is of: the record would fill pages."""
        fell = f", fell at {self.falls[0].time:g} s" if self.falls else ""
        return f"Walk({self.plan.robot.name!r}: {len(self.record['time'])} steps{fell})"


def walk(planned: RobotPlan) -> Walk:
    """Return what a robot does.

    Raises:
        DivergedError: The simulation broke down; says when.
    """
    states = simulate(planned.model, planned.start[None], planned.setpoints[None])
    try:
        check_states(states, planned.sim.timestep)
    except DivergedError as error:
        raise DivergedError(f"{planned.robot.name}: {error}", error.time) from None

    record: Record = {"time": states.time[0]}
    body = None
    if isinstance(planned.scene, Floor):
        body = Trunk(states.time[0], states.qpos[0, :, :3], states.qpos[0, :, 3:7])
        pose = np.concatenate([body.position, body.quaternion], axis=1)
        record |= dict(zip(TRUNK_COLUMNS, np.ascontiguousarray(pose.T), strict=True))
    for k, leg in enumerate(LEGS):
        record |= {f"{leg}_{name}": column for name, column in _leg(planned, states, k).items()}

    box = planned.robot.trunk
    fell = [] if body is None else falls(body, box.size, np.array(box.center))
    return Walk(planned, record, body, fell)


def _leg(planned: RobotPlan, states: States, k: int) -> Record:
    """Return the columns of leg k, without its name and the time."""
    wanted = planned.motions[k]
    # The legs' joints are the last of the robot's, four each.
    joints = slice(4 * (k - len(LEGS)), 4 * (k + 1 - len(LEGS)) or None)
    q = states.qpos[0, :, joints]
    v = states.qvel[0, :, joints]
    ctrl = states.ctrl[0, :, 2 * k : 2 * k + 2]

    points = kinematics.chain_points(planned.robot.leg, q)
    gap = points.C_right - points.C_left
    before = np.concatenate([wanted.q[:1], q[:-1]])
    step = MotorStep(
        planned.sim.integrator,
        ctrl,
        before[:, MOTOR_JOINTS],
        q[:, MOTOR_JOINTS],
        v[:, MOTOR_JOINTS],
    )
    torque = applied_torque(planned.robot.servo, step)

    vectors = [*wanted.foot[1:].T, *points.F.T, *q.T, *v.T, *ctrl.T, *torque.T]
    record = dict(zip(COLUMNS[1:], [*vectors, np.hypot(gap[:, 0], gap[:, 1])], strict=True))
    if states.ground.shape[-1]:
        record |= dict(zip(FORCE_COLUMNS, states.ground[0, :, 3 * k : 3 * k + 3].T, strict=True))
    return {name: np.ascontiguousarray(column) for name, column in record.items()}
