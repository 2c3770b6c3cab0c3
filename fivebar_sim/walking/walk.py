"""A robot's run: simulated and recorded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.dynamics.gears import Foot, bars
from fivebar_sim.errors import DivergedError
from fivebar_sim.metrics.columns import Record
from fivebar_sim.model.feet import POSE, Hips, walking
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.columns import FORCE_COLUMNS, TRUNK_COLUMNS, trunk
from fivebar_sim.robots.hips.motors import QUANTITIES, column
from fivebar_sim.robots.jump import Jump, jump
from fivebar_sim.robots.measure import Fall, Trunk, falls
from fivebar_sim.simulation import record as recorded
from fivebar_sim.simulation.record import Part
from fivebar_sim.simulation.steps import States, Watch, check_states, simulate
from fivebar_sim.walking.plan import RobotPlan
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
        return of_states(planned, steered(planned))
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

    record: Record = {"time": np.ascontiguousarray(states.time[0])}
    if isinstance(planned.scene, Floor):
        pose = np.concatenate([states.qpos[0, :, :7], states.qvel[0, :, :6]], axis=1)
        record |= dict(zip(TRUNK_COLUMNS, np.ascontiguousarray(pose.T), strict=True))
    for k, leg in enumerate(LEGS):
        record |= {f"{leg}_{name}": column for name, column in _leg(planned, states, k).items()}

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


def _leg(planned: RobotPlan, states: States, k: int) -> Record:
    """Return the columns of leg k, without its name and the time."""
    part = _part(planned, states, k)
    record = recorded.columns(planned.legs[k], part, recorded.points(planned.legs[k], part))
    del record["time"]
    for i in range(len(planned.robot.hip_motors)):
        record |= _turned(planned, states, k, i)
    # Held out of reach of the floor, a foot has a sensor of its force too.
    if isinstance(planned.scene, Floor):
        force = wrench(states, k)[:, : len(FORCE_COLUMNS)]
        record |= dict(zip(FORCE_COLUMNS, force.T, strict=True))
    return {name: np.ascontiguousarray(column) for name, column in record.items()}


def _turned(planned: RobotPlan, states: States, k: int, i: int) -> Record:
    """Return the columns of motor i of the hip of leg k.

    tau = kp (u - theta) - kd theta_dot,   at a step's end; under `implicitfast` theta at its start
    """
    motor = planned.robot.hip_motors[i]
    place = planned.robot.joints * (k - len(LEGS)) + i
    theta = states.qpos[0, :, place]
    rate = states.qvel[0, :, place]
    command = planned.swings[:, k, i]
    late = planned.sim.integrator == "discrete"
    acting = theta if late else np.concatenate([planned.start[place][None], theta[:-1]])
    torque = motor.kp * (command - acting) - motor.kd * rate
    names = [column(quantity, motor) for quantity in QUANTITIES]
    return dict(zip(names, (theta, rate, command, torque), strict=True))


def wrench(states: States, k: int) -> Array:
    """Return the floor's force on foot k, and on uneven ground its torque and place, (N, 3 or 9).

    The torque is about the place, and all along the world's axes [N], [N m], [m].
    """
    width = states.ground.shape[-1] // len(LEGS)
    return states.ground[0, :, width * k : width * (k + 1)]


def jumped(went: Walk) -> Jump | None:
    """Return the highest jump of a run; None where the robot never left the floor upward."""
    if went.trunk is None:
        return None
    stands = np.any([went.record[f"{leg}_ground_z"] > 0.0 for leg in LEGS], axis=0)
    return jump(went.trunk, stands)


def saturated(went: Walk, k: int) -> Bools:
    """Return whether the torque limit clipped the motors of leg k in each step, (N, 2)."""
    return recorded.saturated(went.plan.legs[k], _part(went.plan, went.states, k))


def _part(planned: RobotPlan, states: States, k: int) -> Part:
    """Return all steps of leg k, as if it were alone."""
    # The legs' joints are the last of the robot's; those of its hip come before a leg's four.
    width = planned.robot.joints
    last = width * (k + 1 - len(LEGS))
    joints = slice(last - 4, last or None)
    motors = slice(2 * (k - len(LEGS)), 2 * (k + 1 - len(LEGS)) or None)
    own = states._replace(
        qpos=states.qpos[..., joints],
        qvel=states.qvel[..., joints],
        ctrl=states.ctrl[..., motors],
        constraint=states.constraint[..., joints],
    )
    return Part(own, 0, planned.legs[k].start, _foot(planned, states, k))


def _foot(planned: RobotPlan, states: States, k: int) -> Foot | None:
    """Return what the floor does to foot k in each step, where the gears' share is told from it."""
    if not isinstance(planned.scene, Floor) or not planned.robot.servo.records_friction:
        return None
    q = before(planned.start, states.qpos[0])
    joints = q[:, None, POSE + 4 * k : POSE + 4 * k + 4]
    force = states.ground[0, :, None, 3 * k : 3 * k + 3]
    hips = Hips.of([planned.model], [f"{LEGS[k]}_"])
    return walking(bars(planned.robot.leg), hips, joints, q[:, :POSE], force)


def before(start: Array, after: Array) -> Array:
    """Return values before each step, of those after each and the first, (N, n)."""
    return np.concatenate([start[None], after[:-1]])
