"""Positions from angles: knees, closure of the loop at C, foot, and the branch of a pose."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.arrays import Array, Bools, as_pairs, at, first_index
from fivebar_sim.errors import ArgumentError, LoopOpenError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.leg_arrays import LegArrays
from fivebar_sim.kinematics.planar import (
    Coordinates,
    angle_between,
    between,
    cross,
    joined,
    root,
    rotated,
    split,
    unit,
)

ROUNDING = float(16 * np.finfo(float).eps)
"""Slack of a squared distance d^2 at the edge of reach, relative to d times the coordinates of the
two points: just their rounding."""


class Points(NamedTuple):
    """The joints of a pose [m], hip frame, each (..., 2).

    C_left is the end of L2, C_right that of L3: one point when the loop is closed.
    """

    B: Array
    C_left: Array
    C_right: Array
    D: Array
    F: Array


class Corners(NamedTuple):
    """The joints of closed poses in separate coordinates [m], hip frame: see `planar.split`.

    C is the end of L2 and of L3.
    """

    A: Coordinates
    B: Coordinates
    C: Coordinates
    D: Coordinates
    E: Coordinates
    F: Coordinates


class Branch(NamedTuple):
    """The branch of poses: signs -1, 0 or +1, each of shape (...); 0 is singular."""

    s_A: NDArray[np.int_]
    s_E: NDArray[np.int_]
    assembly: NDArray[np.int_]


def bases(leg: FiveBar | LegArrays) -> tuple[Array, Array]:
    """Return the motor axes A and E [m], hip frame: -+ L5 / 2 (cos tilt, sin tilt).

    Those of one leg are kept, and cannot be written to.
    """
    return _kept_bases(leg) if isinstance(leg, FiveBar) else _bases(leg)


# A controller asks for the same leg at every control step. Typed, since 1.0 == True.
@lru_cache(maxsize=256, typed=True)
def _kept_bases(leg: FiveBar) -> tuple[Array, Array]:
    A, E = _bases(leg)
    A.flags.writeable = False
    E.flags.writeable = False
    return A, E


def _bases(leg: FiveBar | LegArrays) -> tuple[Array, Array]:
    half = 0.5 * leg.L5 * unit(leg.tilt)
    return -half, half


def knees(leg: FiveBar, theta: Array) -> tuple[Array, Array]:
    """Return B = A + L1 e(theta_A) and D = E + L4 e(theta_E) [m], each (..., 2)."""
    A, E = bases(leg)
    B, D = _knees(leg, A.tolist(), E.tolist(), theta)
    return joined(B, theta.shape), joined(D, theta.shape)


def _knees(
    leg: FiveBar, A: Sequence[float], E: Sequence[float], theta: Array
) -> tuple[Coordinates, Coordinates]:
    cos_A, cos_E = split(np.cos(theta))
    sin_A, sin_E = split(np.sin(theta))
    B = A[0] + leg.L1 * cos_A, A[1] + leg.L1 * sin_A
    return B, (E[0] + leg.L4 * cos_E, E[1] + leg.L4 * sin_E)


def corners(leg: FiveBar, theta: Array, assembly: int | None = None) -> Corners:
    """Return the joints of closed poses in separate coordinates.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Raises:
        LoopOpenError: The links do not meet in some pose.
    """
    A, E = (each.tolist() for each in bases(leg))
    B, D = _knees(leg, A, E, theta)
    C = loop_joint(leg, B, D, assembly, theta.shape[:-1])
    if leg.L6 == 0.0:
        return Corners(A, B, C, D, E, C)

    CF = rotated(between(B, C), leg.bend)
    part = leg.L6 / leg.L2
    return Corners(A, B, C, D, E, (C[0] + part * CF[0], C[1] + part * CF[1]))


def loop_joint(
    leg: FiveBar, B: Coordinates, D: Coordinates, assembly: int | None, batch: tuple[int, ...]
) -> Coordinates:
    """Return C, the crossing of the circles about B and D on the side that assembly names.

    With d = |BD|, u the unit vector along BD, and n = u turned by +90 deg:

        C = B + a u + assembly h n,   a = (d^2 + L2^2 - L3^2) / 2d,   h = sqrt(L2^2 - a^2)

    where h is computed as sqrt(((L2 + L3)^2 - d^2) (d^2 - (L2 - L3)^2)) / 2d.

    Args:
        leg: The leg.
        B: End of L1 [m].
        D: End of L4 [m].
        assembly: +1 or -1; None is the leg's own.
        batch: Shape of the poses, for the error's index.

    Raises:
        LoopOpenError: Unless |L2 - L3| <= d <= L2 + L3 and d > 0 in every pose.
    """
    sign = leg.assembly if assembly is None else assembly
    if sign not in (-1, 1):
        raise ArgumentError(f"assembly must be -1 or 1, got {assembly!r}")

    x, z = between(B, D)
    low = abs(leg.L2 - leg.L3)
    high = leg.L2 + leg.L3
    d2 = x * x + z * z
    # A pose at the very edge of reach counts as closed, whichever way it was rounded. B and D are
    # at most leg.size + L5 from the origin, so this bounds the rounding of their coordinates [m].
    rounding = ROUNDING * (leg.size + leg.L5)
    slack = rounding * high
    # B on D is open: any C at that distance would close the loop.
    closed = (d2 >= low**2 - slack) & (d2 <= high**2 + slack) & (d2 > rounding**2)
    if closed is not True and not np.all(closed):
        raise _loop_open(np.sqrt(d2).reshape(batch), ~np.reshape(closed, batch), low, high)

    # Factored, like the root below: a difference of two squares would lose digits.
    along = (d2 + (leg.L2 - leg.L3) * high) / (2.0 * d2)
    across = sign * (root((high**2 - d2) * (d2 - low**2)) / (2.0 * d2))
    return B[0] + along * x - across * z, B[1] + along * z + across * x


def _loop_open(d: Array, is_open: Bools, low: float, high: float) -> LoopOpenError:
    index = first_index(is_open)
    count = f"in {int(is_open.sum())} of {is_open.size} poses" if is_open.ndim else "here"
    return LoopOpenError(
        f"the loop is open {count}: |BD| must be above 0 and in [{low:g}, {high:g}] m, "
        f"got {float(d[index]):g} m{at(index)}",
        index,
    )


def closed_points(leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None) -> Points:
    """Return the joints of closed poses.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Raises:
        LoopOpenError: The links do not meet in some pose.
    """
    theta = as_pairs(theta, "theta")
    p = corners(leg, theta, assembly)
    B, C, D, F = (joined(each, theta.shape) for each in (p.B, p.C, p.D, p.F))
    return Points(B, C, C, D, F)


def forward(leg: FiveBar, theta: ArrayLike, assembly: int | None = None) -> Array:
    """Return the foot F at given motor angles; F is C if L6 = 0.

        F = C + (L6 / L2) R(bend) (C - B),   C as in `loop_joint`

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], anticlockwise from +x of the hip frame, (..., 2).
        assembly: +1 or -1, on which side of B->D the joint C lies; None is the leg's own.

    Returns:
        F [m], hip frame, (..., 2).

    Raises:
        LoopOpenError: Unless |L2 - L3| <= |BD| <= L2 + L3 and |BD| > 0 in every pose; `.index`
            is the first open one.
    """
    theta = as_pairs(theta, "theta")
    return joined(corners(leg, theta, assembly).F, theta.shape)


def passive(leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None) -> Array:
    """Return the knee angles (theta_B, theta_D) of closed poses.

    theta_B turns L1's direction into L2's, theta_D L4's into L3's; both in (-pi, pi].

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Raises:
        LoopOpenError: The links do not meet in some pose.
    """
    A, E = bases(leg)
    p = closed_points(leg, theta, assembly=assembly)
    theta_B = angle_between(p.B - A, p.C_left - p.B)
    theta_D = angle_between(p.D - E, p.C_right - p.D)
    return np.stack([theta_B, theta_D], axis=-1)


def chain_points(leg: FiveBar | LegArrays, q: Array) -> Points:
    """Return the joints of the two open chains; |C_left C_right| is the loop gap.

    Args:
        leg: The leg; or n legs, with q of shape (n, 4).
        q: (theta_A, theta_B, theta_E, theta_D) [rad], knees relative to L1 and L4, (..., 4).
    """
    return points_along(leg, q, directions(q))


def directions(q: Array) -> tuple[Array, Array, Array, Array]:
    """Return the directions of L1..L4 at joint angles as in `chain_points`, (..., 2) each."""
    return (
        unit(q[..., 0]),
        unit(q[..., 0] + q[..., 1]),
        unit(q[..., 2] + q[..., 3]),
        unit(q[..., 2]),
    )


def points_along(
    leg: FiveBar | LegArrays, q: Array, along: tuple[Array, Array, Array, Array]
) -> Points:
    """Return the `chain_points` of joint angles whose `directions` are known."""
    e1, e2, e3, e4 = along
    A, E = bases(leg)
    B = A + leg.L1 * e1
    D = E + leg.L4 * e4
    C_left = B + leg.L2 * e2
    C_right = D + leg.L3 * e3
    # Without an extension a fifth of the trigonometry would be multiplied by zero.
    plain = isinstance(leg, FiveBar) and leg.L6 == 0.0
    F = C_left + (0.0 if plain else leg.L6 * unit(q[..., 0] + q[..., 1] + leg.bend))
    return Points(B, C_left, C_right, D, F)


def branch(leg: FiveBar | LegArrays, points: Points) -> Branch:
    """Return the working mode and the assembly mode of poses, given their joints.

        s_A = sign(AF x AB),  s_E = sign(EC x ED),  assembly = sign(BD x BC)

    If the loop has a small gap, C_right is used on E's side and C_left elsewhere.
    """
    A, E = bases(leg)
    # AF, not AC: with an extension side A is solved to the foot.
    s_A = np.sign(cross(points.F - A, points.B - A)).astype(int)
    s_E = np.sign(cross(points.C_right - E, points.D - E)).astype(int)
    assembly = np.sign(cross(points.D - points.B, points.C_left - points.B)).astype(int)
    return Branch(s_A, s_E, assembly)
