"""The workspace: whether the foot reaches a point, the nearest reachable point, the distance to it.

Where L6 = 0 it is the intersection of two rings, and all answers are exact to rounding (`rings`).
Where L6 > 0 it is bounded by circles about A and by coupler curves, whose nearest points are found
by iteration (`extended`): to 1e-12 of the leg's size. A second minimum of the distance within one
step of a curve's samples, 0.04 rad, could be missed: it would be nearer by less than 1e-5 of that
step. Either way `kinematics.inverse_all` accepts the answer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, Bools, as_pairs, at, first_index
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.reach import working_mode
from fivebar_sim.workspace.extended import Extended, region, to_hip
from fivebar_sim.workspace.rings import Rings, rings
from fivebar_sim.workspace.singular import singular_pieces

FAR = 1e150
"""Coordinates [m] from here on are refused: their squares overflow."""

ANY: Literal["any"] = "any"
"""All working modes together."""
AnyMode = Mode | Literal["any"]
"""A working mode (s_A, s_E), or `ANY`; nowhere else can a mode be more than one."""

ARC = 0.01
"""Step of the arcs in `boundary` [rad]: the chord is within 1.25e-5 of the radius."""


def reachable(leg: FiveBar, foot: ArrayLike, *, margin: float = 0.0, mode: AnyMode = ANY) -> Bools:
    """Return where the foot can be put: where `kinematics.inverse_all` gives an answer.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2). NaN and infinity are not reachable.
        margin: How far from the boundary the foot shall stay at least [m].
        mode: Working mode in which it shall be reached, or "any". All reach the same where
            L6 = 0; else s_A alone decides.

    Returns:
        Truth values, (...): with a margin, where `distance` is at least the margin.

    Raises:
        ArgumentError: A shape other than (..., 2), an unknown mode, or unless margin >= 0.
    """
    _check(margin, mode)
    foot = as_pairs(foot, "foot")
    # The square of 1e200 m overflows to inf, which is just as far out of reach.
    with np.errstate(over="ignore", invalid="ignore"):
        held = np.asarray(_region(leg, margin if leg.L6 == 0.0 else 0.0, mode).holds(foot))
    # Rings shrink by a margin exactly; coupler curves do not, so distances are measured.
    if margin > 0.0 and leg.L6 > 0.0 and held.any():
        held[held] = distance(leg, foot[held], mode=mode) >= margin
    return held


def nearest(leg: FiveBar, foot: ArrayLike, *, margin: float = 0.0, mode: AnyMode = ANY) -> Array:
    """Return the nearest points that the foot can reach.

    A reachable point is returned as it is. Any other is replaced by the nearest point of the
    boundary, moved by units in the last place to where `reachable`, and so
    `kinematics.inverse_all`, accepts it. (With L6 > 0, in a single mode, and with A, B and F in
    line, that may take up to 2e-7 of the leg's size: C moves with the square root of F's rounding.)
    Of points that are equally near, to rounding, the first is taken: in the order of `rings` with
    L6 = 0, else in that of `boundary`. For a point on a motor's axis, where the direction is
    undefined, it is away from the other motor; with coaxial motors -z if L6 = 0, else against the
    tilt.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        margin: How far from the boundary the answer shall be at least [m]; only where L6 = 0.
        mode: Working mode in which the answer shall be reached, or "any".

    Returns:
        The nearest reachable points [m], (..., 2).

    Raises:
        ArgumentError: A shape other than (..., 2), an unknown mode, unless |x|, |z| < 1e150 m,
            unless margin >= 0, or a margin where L6 > 0.
        GeometryError: If no floating-point number lies in the workspace.
    """
    _check(margin, mode)
    if margin > 0.0 and leg.L6 > 0.0:
        raise ArgumentError(
            f"margin must be 0 m for the nearest point of a leg with L6 > 0, got {margin:g} m"
        )

    whole = _region(leg, margin, mode)

    def solve(p: Array) -> Array:
        best = p.copy()
        lost = ~whole.holds(p)
        if lost.any():
            # A boundary point may be out of reach by rounding: it is moved until it is within.
            best[lost] = _settle(whole, whole.boundary_point(p[lost]))
        return best

    return _by_blocks(solve, _finite(foot), (2,), whole.block)


def distance(leg: FiveBar, foot: ArrayLike, *, mode: AnyMode = ANY) -> Array:
    """Return the distance to the boundary of the workspace: positive inside, negative outside.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        mode: Working mode whose workspace is meant; "any" is all together.

    Returns:
        Signed distances [m], (...): at least 0 where `reachable`.

    Raises:
        ArgumentError: A shape other than (..., 2), an unknown mode, or unless |x|, |z| < 1e150 m.
        GeometryError: If no floating-point number lies in the workspace.
    """
    _check(0.0, mode)
    whole = _region(leg, 0.0, mode)

    def solve(p: Array) -> Array:
        gap = np.hypot(*(p - whole.boundary_point(p)).T)
        return np.where(whole.holds(p), gap, -gap)

    return _by_blocks(solve, _finite(foot), (), whole.block)


def boundary(leg: FiveBar, *, mode: AnyMode = ANY) -> list[Array]:
    """Return the boundary of the workspace as polylines for drawing.

    First the arcs of A's circles, inner first; then with L6 = 0 those of E's circles, or with
    L6 > 0 the coupler curves of C on E's inner circle and on its outer one. Where pieces meet they
    share an end, to rounding.

    Args:
        leg: The leg.
        mode: Working mode whose workspace is meant; "any" is all together.

    Returns:
        Polylines [m], each (n, 2), n at least 2. Their points are on the boundary; neighbours are
        within 0.04 rad in all directions of links and within 0.04 of the leg's size.
    """
    _check(0.0, mode)
    return _region(leg, 0.0, mode).boundary(ARC)


def singular_curves(leg: FiveBar, *, mode: Mode | None = None) -> list[Array]:
    """Return the foot positions at which B, C and D are in line, or B = D, as polylines.

    There the foot is free to move while the motors stand still (a parallel singularity). L2 and
    L3 are one link of length K, which makes a four-bar A, B, D, E that carries the foot:

        K = L2 + L3 or |L2 - L3|,   F = B + offset (D - B) / (L2 + L3) or (L2 - L3)

    and with L2 = L3 and B = D the foot turns about the pin B.

    Args:
        leg: The leg.
        mode: Working mode (s_A, s_E) whose poses are meant; None for the leg's own.

    Returns:
        Polylines [m], each (n, 2), ending where a side chain is straight or folded. Empty if every
        pose of the mode is singular: coaxial legs with L1 = L4 and L2 = L3, if s_A = s_E.

    Raises:
        ArgumentError: Unknown mode.
    """
    return [to_hip(leg, piece) for piece in singular_pieces(leg, working_mode(leg, mode))]


def _check(margin: float, mode: AnyMode) -> None:
    check_number("margin", margin, "m", low=0.0)
    if mode not in (ANY, *MODES):
        raise ArgumentError(f"mode must be {ANY!r} or one of {MODES}, got {mode!r}")


def _region(leg: FiveBar, margin: float, mode: AnyMode) -> Rings | Extended:
    if leg.L6 == 0.0:
        return rings(leg, margin)
    return region(leg, 0 if mode == ANY else mode[0])


def _finite(foot: ArrayLike) -> Array:
    foot = as_pairs(foot, "foot")
    bad = np.asarray(~(np.abs(foot) < FAR).all(axis=-1))
    if bad.any():
        index = first_index(bad)
        raise ArgumentError(
            f"foot must be finite, below {FAR:g} m, got {tuple(foot[index].tolist())} m{at(index)}"
        )
    return foot


def _by_blocks(
    solve: Callable[[Array], Array], foot: Array, item: tuple[int, ...], size: int
) -> Array:
    """Return the answers of solve, found block by block, in the batch shape of foot."""
    flat = foot.reshape(-1, 2)
    out = np.empty((len(flat), *item))
    for start in range(0, len(flat), size):
        block = slice(start, start + size)
        out[block] = solve(flat[block])
    return out.reshape((*foot.shape[:-1], *item))


def _settle(whole: Rings | Extended, points: Array) -> Array:
    """Return boundary points moved to the first floating-point neighbours that are reachable."""
    points = points.copy()
    # A boundary point is off by some units in the last place of the region's largest radius, which
    # may be more than the slack in the comparison for the shortest link.
    lost = np.flatnonzero(~whole.holds(points))
    for step in whole.nudges():
        if not lost.size:
            break
        tried = whole.nudge(points[lost], *step)
        ok = whole.holds(tried)
        points[lost[ok]] = tried[ok]
        lost = lost[~ok]

    if lost.size:
        raise whole.empty()
    return points
