"""Limits of the joints' angles and rates."""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array

C_STOP = float(np.radians(2.0))
"""Distance of the stops of the angle at C from 0 and from 180 deg [rad]."""

MOTOR_RANGE = 2.0 * np.pi
"""Range of the motors to either side of theta = 0 [rad]."""

SPEED_LIMIT = 1e4
"""Joint rate beyond which a simulation counts as diverged [rad/s]: a hundred thousand rpm."""


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
