"""Angles from foot positions, in each of the four working modes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, Bools, as_pairs, at, blocks, first_index
from fivebar_sim.errors import ArgumentError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.closure import ROUNDING, Points, bases, knees
from fivebar_sim.kinematics.planar import (
    Coordinates,
    Scalar,
    between,
    direction,
    root,
    rotated,
    split,
    turned,
    unit,
    wrap,
)


def side_angle(r: Array, near: float, far: float, s: int) -> tuple[Array, Bools]:
    """Return the motor angle of one side chain, and where the chain reaches.

    The law of cosines at the motor, with d = |r|, near and far the two links:

        theta = alpha + s beta,   alpha = direction of r,
        cos beta = N / (2 near d),  N = d^2 + near^2 - far^2
        sin beta = S / (2 near d),  S = sqrt(((near + far)^2 - d^2) (d^2 - (near - far)^2))

    added as directions, (x + i z) (N + i s S), so that a single atan2 gives theta in (-pi, pi] and
    no digits are lost at full stretch or on the fold. At d = 0 (only if near = far) any theta
    fits; it is 0 by convention.

    Args:
        r: Vector from the motor to the chain's end [m], (..., 2).
        near: Link at the motor [m].
        far: Link beyond the knee [m].
        s: +1 or -1, the side's working mode.

    Returns:
        theta [rad], (...); and whether |near - far| <= d <= near + far, (...).
    """
    return _side_angle(r[..., 0], r[..., 1], near, far, s)


def _side_angle(x: Scalar, z: Scalar, near: float, far: float, s: int) -> tuple[Any, Any]:
    """Return what `side_angle` does, with x and z by themselves."""
    d2 = x * x + z * z
    low = (near - far) ** 2
    high = (near + far) ** 2
    # Factored: a difference of two squares would lose digits.
    N = d2 + (near - far) * (near + far)
    # Negative out of reach, and by rounding at the very edge of it; `reaches` tells the two apart.
    S = s * root((high - d2) * (d2 - low))
    theta = direction(z * N + S * x, x * N - S * z)
    return theta, reaches(d2, near, far)


def reaches(d2: Scalar, near: float, far: float) -> Any:
    """Return whether a two-link chain spans a squared distance [m^2], with slack for rounding."""
    low = (near - far) ** 2
    high = (near + far) ** 2
    slack = ROUNDING * high
    return (d2 >= low - slack) & (d2 <= high + slack)


def foot_radius_and_angle(leg: FiveBar) -> tuple[float, float]:
    """Return |BF| [m] and the angle from BC to BF [rad]; (L2, 0) if L6 = 0."""
    along, across = leg.foot_offset
    return float(np.hypot(along, across)), float(np.arctan2(across, along))


def _solve(leg: FiveBar, foot: Coordinates, mode: Mode) -> tuple[Coordinates, Coordinates]:
    """Return (theta_A, theta_E) of points, and whether each side reaches: A to F, E to C."""
    A, E = (each.tolist() for each in bases(leg))
    rho, phi = foot_radius_and_angle(leg)
    x, z = foot
    theta_A, ok_A = _side_angle(x - A[0], z - A[1], leg.L1, rho, mode[0])

    # With an extension side E ends at C, which is known only once side A has placed L2.
    if leg.L6 > 0.0:
        B = A[0] + leg.L1 * np.cos(theta_A), A[1] + leg.L1 * np.sin(theta_A)
        BC = rotated(between(B, foot), -phi)
        part = leg.L2 / rho
        x = B[0] + part * BC[0]
        z = B[1] + part * BC[1]

    theta_E, ok_E = _side_angle(x - E[0], z - E[1], leg.L4, leg.L3, mode[1])
    return (theta_A, theta_E), (ok_A, ok_E)


def solve(leg: FiveBar, foot: Array, mode: Mode) -> tuple[Array, Bools]:
    """Return (theta_A, theta_E) of points, and whether each side reaches: A to F, E to C.

    Both have shape (..., 2); the angle of a side that does not reach has no meaning.
    """
    flat = foot.reshape(-1, 2)
    theta = np.empty(flat.shape)
    ok = np.empty(flat.shape, dtype=bool)
    # Squares of far points may overflow to inf, which is out of reach like any other.
    with np.errstate(over="ignore", invalid="ignore"):
        # A block at a time: temporaries stay in the cache, which is three times faster.
        for block in blocks(len(flat)):
            angles, reached = _solve(leg, split(flat[block]), mode)
            for side in (0, 1):
                theta[block, side] = angles[side]
                ok[block, side] = reached[side]
    return theta.reshape(foot.shape), ok.reshape(foot.shape)


def inverse(leg: FiveBar, foot: ArrayLike, mode: Mode | None = None) -> Array:
    """Return the motor angles that put the foot F at given points.

    Law of cosines on each side, theta = alpha + s beta (see `side_angle`). If L6 > 0, side A is
    solved to F with |BF| in place of L2, which fixes B and C, and then side E to C: exact.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        mode: Working mode (s_A, s_E); None is the leg's own.

    Returns:
        (theta_A, theta_E) [rad] in (-pi, pi], (..., 2).

    Raises:
        UnreachableError: Unless | |AB| - |BF| | <= |AF| <= |AB| + |BF| and | |ED| - |DC| | <= |EC|
            <= |ED| + |DC| for every point; `.index` is the first bad point.
        ArgumentError: Unknown mode, or a shape other than (..., 2).
    """
    mode = working_mode(leg, mode)
    foot = as_pairs(foot, "foot")
    theta, ok = solve(leg, foot, mode)
    if not ok.all():
        raise out_of_reach(leg, foot, theta, ok)
    return theta


def working_mode(leg: FiveBar, mode: Mode | None) -> Mode:
    """Return the given mode, or the leg's own for None; ArgumentError if it is unknown."""
    mode = leg.mode if mode is None else mode
    if mode not in MODES:
        raise ArgumentError(f"mode must be one of {MODES}, got {mode!r}")
    return mode


def out_of_reach(leg: FiveBar, foot: Array, theta: Array, ok: Bools) -> UnreachableError:
    """Return the error for points that `solve` found out of reach, given what it returned."""
    bad = np.logical_not(ok.all(axis=-1))
    index = first_index(bad)
    A, E = bases(leg)
    rho, phi = foot_radius_and_angle(leg)
    F = foot[index]

    # Side A is named first, since E's end C is known only where A reaches.
    if not ok[index][0]:
        what = "|AF|"
        near = leg.L1
        far = rho
        r = F - A
    else:
        B = A + leg.L1 * unit(theta[index][0])
        C = B + (leg.L2 / rho) * turned(F - B, -phi) if leg.L6 > 0.0 else F
        what = "|EC|" if leg.L6 > 0.0 else "|EF|"
        near = leg.L4
        far = leg.L3
        r = C - E

    count = f"{int(bad.sum())} of {bad.size} points are" if bad.ndim else "the point is"
    return UnreachableError(
        f"{count} out of reach: {what} must be in [{abs(near - far):g}, {near + far:g}] m, got "
        f"{float(np.hypot(*r)):g} m for the foot at ({F[0]:g}, {F[1]:g}) m{at(index)}",
        index,
    )


def points_at(leg: FiveBar, foot: Array, theta: Array) -> Points:
    """Return the joints [m] of poses known to put F at `foot`, in either assembly mode.

    C = B + R(-phi) BF L2 / |BF|, with phi the angle from BC to BF; this also holds if B = D.
    """
    B, D = knees(leg, theta)
    rho, phi = foot_radius_and_angle(leg)
    C = B + (leg.L2 / rho) * turned(foot - B, -phi)
    return Points(B, C, C, D, foot)


def inverse_all(leg: FiveBar, foot: ArrayLike) -> Array:
    """Return the motor angles of all four working modes; NaN where a mode does not reach.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).

    Returns:
        (theta_A, theta_E) [rad] in (-pi, pi], (..., 4, 2), modes in the order of `MODES`:
        (-,-) (-,+) (+,-) (+,+).
    """
    foot = as_pairs(foot, "foot")
    every = np.empty((*foot.shape[:-1], len(MODES), 2))
    for k, mode in enumerate(MODES):
        theta, ok = solve(leg, foot, mode)
        every[..., k, :] = np.where(ok.all(axis=-1, keepdims=True), theta, np.nan)
    return every


def inverse_nearest(leg: FiveBar, foot: ArrayLike, theta_now: ArrayLike) -> Array:
    """Return the one of the four solutions that is nearest to the present angles.

    Nearest means the least sum of squares of the two differences, each wrapped to half a turn; the
    result is continuous with theta_now, so it may leave (-pi, pi] as real joints do. Of equally
    near solutions the first in the order of `MODES` is taken.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        theta_now: Present (theta_A, theta_E) [rad], broadcasts with foot.

    Returns:
        (theta_A, theta_E) [rad], the broadcast shape (..., 2).

    Raises:
        UnreachableError: No working mode reaches some point; `.index` is the first such point.
        ArgumentError: The shapes do not broadcast, or angles are not finite.
    """
    foot = as_pairs(foot, "foot")
    now = as_pairs(theta_now, "theta_now")
    try:
        foot, now = np.broadcast_arrays(foot, now)
    except ValueError:
        raise ArgumentError(
            f"foot and theta_now must broadcast, got shapes {foot.shape} and {now.shape}"
        ) from None

    if not np.isfinite(now).all():
        raise ArgumentError("theta_now must be finite [rad]")

    # Wrapped differences, so that a motor beyond half a turn is not unwound.
    step = wrap(inverse_all(leg, foot) - now[..., None, :])
    cost = np.sum(step**2, axis=-1)
    lost = np.isnan(cost).all(axis=-1)
    if lost.any():
        # No mode reaches there, so the error of the leg's own is as good as any.
        theta, ok = solve(leg, foot, leg.mode)
        raise out_of_reach(leg, foot, theta, ok | ~lost[..., None])

    # argmin treats NaN as the least.
    best = np.argmin(np.where(np.isnan(cost), np.inf, cost), axis=-1)
    return now + np.take_along_axis(step, best[..., None, None], axis=-2)[..., 0, :]
