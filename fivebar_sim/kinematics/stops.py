"""Limits of the joints' angles and rates."""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.reach import foot_radius_and_angle

C_STOP = float(np.radians(2.0))
"""Distance of the stops of the angle at C from 0 and from 180 deg [rad]."""

MOTOR_RANGE = 2.0 * np.pi
"""Range of the motors to either side of theta = 0 [rad]."""

SPEED_LIMIT = 1e4
"""Joint rate beyond which a simulation counts as diverged [rad/s]: a hundred thousand rpm."""


def stops_at_B(leg: FiveBar, rest: Array) -> tuple[float, float]:
    """Return the range of theta_B, a turn wide, about a rest pose (4,) [rad].

    It ends on either side where the foot is folded back over the motor, theta_B + phi = +-pi, phi
    the angle from BC to BF: there the working mode of side A ends.

    Args:
        leg: The leg.
        rest: (theta_A, theta_B, theta_E, theta_D) [rad], (4,).
    """
    # With a bent extension BF is not along BC: a range of +-180 deg would cut the mode in two.
    phi = foot_radius_and_angle(leg)[1]
    turn = 2.0 * np.pi
    middle = turn * float(np.round((rest[1] + phi) / turn)) - phi
    return middle - np.pi, middle + np.pi


def angle_at_C(q: Array) -> Array:
    """Return theta_A + theta_B - theta_E - theta_D, from L3's direction to L2's [rad].

    It is a multiple of pi where B, C and D are in line; between two such, the leg keeps one
    assembly mode.

    Args:
        q: (theta_A, theta_B, theta_E, theta_D) [rad], (..., 4).
    """
    return q[..., 0] + q[..., 1] - q[..., 2] - q[..., 3]


def stops_at_C(rest: Array) -> tuple[float, float]:
    """Return the range of the angle at C in the assembly mode of a rest pose (4,) [rad]."""
    # Between two multiples of pi there is one assembly mode; the rest pose tells which two.
    straight = float(np.floor(angle_at_C(rest) / np.pi) * np.pi)
    return straight + C_STOP, straight + np.pi - C_STOP
