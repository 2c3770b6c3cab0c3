"""Torque that lasts a single step: no timestep that is any longer than it gets it right."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fivebar_sim import dynamics
from fivebar_sim.arrays import Array, blocks, largest_of_rows
from fivebar_sim.metrics import lasting
from fivebar_sim.metrics.columns import MOTOR_JOINTS, Record, motors
from fivebar_sim.simulation import sampling
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.record import drive

FAINTEST = 1e-9
"""Largest torque of a run in which nothing moves or weighs anything [N m]: it is all rounding."""


def jolts(planned: Plan, record: Record) -> Array | None:
    """Return the torque that lasts a single step, as a part of the run's largest, (N,).

    So does torque that should, but that the run does not show: what a bus makes of a jump by
    chance, missing it or holding it for many steps, and what dies out within the step. In torque
    drive a torque lasts for a period: there only corners of the reference count, else it is None.
    """
    torque = motors(record, "torque")
    largest = float(np.abs(torque).max())
    found = np.zeros_like(torque)
    if drive(planned) == "position":
        found = lasting.lone(torque, np.zeros(2))

    # The targets' own rates are those of a formula; those of projected ones are differences.
    if planned.asked is None and planned.scenario.path.outside == "nearest":
        found = np.maximum(found, _referred(planned))
    elif drive(planned) == "torque":
        return None

    sent = planned.setpoints
    asked = planned.asked
    if sent is not None and asked is not None and sent is not asked:
        found = np.maximum(found, _fed(planned, asked))
        found = np.maximum(found, _missed(planned, sent, torque, largest))
    return largest_of_rows(found) / max(largest, FAINTEST)


def _referred(planned: Plan) -> Array:
    """Return the torque for a single step that a feedback takes from its reference, (N, 2).

    A corner of projected targets has such an acceleration; not every controller uses it.
    """
    wanted = planned.motion
    theta, rate, acceleration = (
        q[1:, MOTOR_JOINTS] for q in (wanted.q, wanted.q_dot, wanted.q_ddot)
    )
    leg = planned.scenario.leg
    force = wanted.force[1:]
    needed = np.empty_like(theta)
    for rows in blocks(len(needed)):
        needed[rows] = dynamics.inverse(
            leg,
            theta[rows],
            rate[rows],
            acceleration[rows],
            force[rows],
            payload=wanted.payload,
        )

    found = lasting.lone(needed, np.zeros(2))
    worst = int(np.argmax(largest_of_rows(found)))
    used = sampling.accelerated(planned.scenario, wanted, worst + 1)
    return found if (2.0 * used > found[worst]).any() else np.zeros_like(found)


def _fed(planned: Plan, asked: Array) -> Array:
    """Return the torque for a single step that setpoints feed forward [N m], (N, 2)."""
    start = planned.motion.q[0, MOTOR_JOINTS]
    told = planned.scenario.servo.kp * lasting.lone(asked, start)
    # In both: the motion needs it, and a setpoint asks for it. One alone may turn round as fast.
    needed = np.zeros(asked.shape)
    rows = _beside(told)
    for part in blocks(len(rows)):
        needed[rows[part]] = _needed(planned, rows[part])
    return np.minimum(told, lasting.lone(needed, np.zeros(2)))


def _beside(values: Array) -> NDArray[np.intp]:
    """Return the rows of (N, 2) with a number other than 0, and those before and after them."""
    near = (values[:, 0] != 0.0) | (values[:, 1] != 0.0)
    beside = near.copy()
    beside[1:] |= near[:-1]
    beside[:-1] |= near[1:]
    return np.flatnonzero(beside)


def _needed(planned: Plan, steps: NDArray[np.intp]) -> Array:
    """Return the torques that the planned motion needs in some steps [N m], (n, 2)."""
    wanted = planned.motion
    # A step's acceleration is known from the one before it; before the first one the leg rests.
    pairs = steps[:, None] + np.array([-1, 0])
    before = np.maximum(pairs, 0)
    found = dynamics.LegDynamics(planned.scenario.leg, payload=wanted.payload).step_torques(
        wanted.q[np.concatenate([before, pairs[:, 1:] + 1], axis=1)],
        wanted.timestep,
        wanted.force[before],
    )
    return found[:, 1]


def _missed(planned: Plan, sent: Array, torque: Array, largest: float) -> Array:
    """Return by how much jumps of the setpoints ask for more than the run shows [N m], (N, 2).

    Before the motor moves, a jump by d asks for kp d more than there was.

    Args:
        planned: The plan that was simulated.
        sent: Its setpoints.
        torque: The torque of every step [N m], (N, 2).
        largest: The largest size of it [N m].
    """
    servo = planned.scenario.servo
    often = planned.scenario.command == 1
    if often and servo.resolution == 0.0:
        return np.zeros_like(torque)

    start = planned.motion.q[:1, MOTOR_JOINTS]
    jump = servo.kp * np.diff(sent, axis=0, prepend=start)
    if often:
        # Sent in every step, the rest of it is the motion, which a motor sees coming.
        jump = np.clip(jump, -servo.kp * servo.resolution, servo.kp * servo.resolution)

    before = np.concatenate([np.zeros((1, 2)), torque[:-1]])
    asked = np.abs(before + jump)
    if servo.limit is not None:
        asked = np.minimum(asked, servo.limit)
    return np.where(jump != 0.0, np.maximum(asked - largest, 0.0), 0.0)
