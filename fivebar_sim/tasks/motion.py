"""The state of legs at the end of a control period, from qpos and qvel alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.leg_arrays import LegArrays
from fivebar_sim.kinematics.planar import end_velocity
from fivebar_sim.kinematics.stops import C_STOP, MOTOR_RANGE, angle_at_C

REASONS = np.array(["", "broken", "gap", "flip", "limit", "time"])
"""Why an episode is over, by number: not over; the physics broke down; the loop is open; the leg is
on another branch; a joint is out of its range; the task's duration is over."""

TIME = len(REASONS) - 1

WIDEST_GAP = 5e-3
"""Largest gap of the loop, relative to the leg's size."""

TOUCH = 1e-6
"""Height up to which the foot's ball counts as touching [m]: a standing pose is off by rounding."""


class Motion(NamedTuple):
    """States of n legs, all computed from the same qpos.

    Attributes:
        q: Joint angles A, B, E, D [rad], (n, 4).
        q_dot: Their rates [rad/s], (n, 4).
        foot: F, hip frame [m], (n, 2).
        foot_dot: Its velocity [m/s], (n, 2).
        hip: Height of the hip above the floor and its rate [m, m/s], (n, 2); (n, 0) where the hip
            is fixed.
        height: Height of the foot's ball above the floor [m], (n,); inf where the hip is fixed.
        torque: Motor torques in each step of the period [N m], (n, every, 2).
        reason: Why the leg has failed, index in REASONS, 0 if it has not, (n,).
    """

    q: Array
    q_dot: Array
    foot: Array
    foot_dot: Array
    hip: Array
    height: Array
    torque: Array
    reason: NDArray[np.int64]

    @property
    def contact(self) -> Bools:
        """Whether the foot touches the floor, (n,)."""
        return self.height <= TOUCH


def motion(
    leg: FiveBar | LegArrays, qpos: Array, qvel: Array, torque: Array, broken: Bools
) -> Motion:
    """Return the state of n legs.

    The foot's velocity is that of L2, which carries it, with AB and BF the vectors along side A:

        F_dot = perp(AB) theta_dot_A + perp(BF) (theta_dot_A + theta_dot_B)

    Args:
        leg: One leg for all rows, or a leg for each.
        qpos: The four joints, after the hip's height if it moves, (n, nq).
        qvel: Their rates, (n, nq).
        torque: Motor torques in each step of the period [N m], (n, every, 2).
        broken: Whether the physics broke down, (n,).
    """
    q = qpos[:, -4:]
    q_dot = qvel[:, -4:]
    p = kinematics.chain_points(leg, q)
    A, _ = kinematics.bases(leg)
    foot_dot = end_velocity(p.B - A, p.F - p.B, q_dot[:, 0], q_dot[:, 0] + q_dot[:, 1])
    hip = np.concatenate([qpos[:, :-4], qvel[:, :-4]], axis=1)
    height = np.full(len(q), np.inf)

    if hip.shape[1]:
        height = hip[:, 0] + p.F[:, 1] - leg.foot_radius

    reason = _reason(leg, q, p)
    # Last: a broken leg shows a sound state, that of the period before.
    reason[broken] = 1
    return Motion(q, q_dot, p.F, foot_dot, hip, height, torque, reason)


def _reason(leg: FiveBar | LegArrays, q: Array, p: kinematics.Points) -> NDArray[np.int64]:
    """Return why poses are not allowed, as indices in REASONS, 0 where they are allowed, (n,)."""
    gap = p.C_right - p.C_left
    wide = (np.hypot(gap[:, :1], gap[:, 1:]) > WIDEST_GAP * leg.size)[:, 0]
    s_A, s_E, assembly = kinematics.branch(leg, p)
    flipped = (s_A != leg.mode[0]) | (s_E != leg.mode[1]) | (assembly != leg.assembly)
    # One sine covers both stops, straight and folded, in whatever turn the angle is.
    beyond = np.abs(np.sin(angle_at_C(q))) < np.sin(C_STOP)
    beyond |= (np.abs(q[:, ::2]) > MOTOR_RANGE).any(axis=1)
    # The cause first, not what follows from it: with an open loop the branch means nothing.
    return np.where(wide, 2, np.where(flipped, 3, np.where(beyond, 4, 0)))
