"""Limits of the joints' angles and rates."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.reach import foot_radius_and_angle

Ranges = Mapping[str, tuple[float, float]]
"""The ranges of joints' angles [rad], by joint; that of C is of `angle_at_C`."""

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


def beyond(q: Array, ranges: Ranges) -> dict[str, Array]:
    """Return how far each joint is beyond its range [rad], by joint, each (N,); 0 within it.

    A stop is a soft constraint: it can push only while the angle is beyond the range.

    Args:
        q: (theta_A, theta_B, theta_E, theta_D) [rad], (N, 4).
        ranges: The joints' ranges; a joint that is left out has no stop.
    """
    angles = {"A": q[:, 0], "B": q[:, 1], "E": q[:, 2], "D": q[:, 3], "C": angle_at_C(q)}
    return {
        joint: np.maximum(np.maximum(low - angles[joint], angles[joint] - high), 0.0)
        for joint, (low, high) in ranges.items()
    }


def in_turn(leg: FiveBar, rest: Array, q: Array, begun: Array) -> Array:
    """Return angles (n, 4) with the motors in the turns that bring `begun` next to the rest pose.

    Theta_E is put in the turn in which the angle at C is between its stops, as in the rest pose.

    Args:
        leg: The leg.
        rest: The rest pose [rad], (4,).
        q: The angles [rad], (n, 4).
        begun: The pose that decides for all of them, (4,), or one for each, (n, 4).
    """
    turn = 2.0 * np.pi
    turns = np.zeros_like(begun)
    middle_B = 0.5 * sum(stops_at_B(leg, rest))
    turns[..., 1] = turn * np.round((middle_B - begun[..., 1]) / turn)
    turns[..., [0, 2]] = turn * np.round((rest - begun) / turn)[..., [0, 2]]
    q = q + turns
    # A and E were shifted separately; the stops at C decide which turn E is really in.
    middle = 0.5 * sum(stops_at_C(rest))
    q[:, 2] += turn * np.round((angle_at_C(begun + turns) - middle) / turn)
    return q


def in_range(q: Array, low: Array, high: Array) -> Array:
    """Return angles (n, 4) with both motors in a turn that keeps them in their range, if any does.

    Turning both by as much changes no pose, and keeps the angle at C.

    Args:
        q: The angles [rad], (n, 4).
        low: The least of each joint's angles, over all rows, (4,), or of every row, (n, 4).
        high: The greatest, likewise.
    """
    shift = np.zeros(low.shape[:-1])
    for turn in (-2.0 * np.pi, 2.0 * np.pi):
        better = ~_fits(low, high) & _fits(low + turn, high + turn)
        shift = np.where(better, turn, shift)

    q = q.copy()
    q[:, 0] += shift
    q[:, 2] += shift
    return q


def _fits(low: Array, high: Array) -> Bools:
    """Return where both motors stay in their range."""
    fits = (low >= -MOTOR_RANGE) & (high <= MOTOR_RANGE)
    return fits[..., 0] & fits[..., 2]
