"""The workspace: whether the foot reaches a point, the nearest point it reaches, and how far.

Where L6 = 0 the foot F is C, and the workspace is what two rings have in common:

    |L1 - L2| <= |AF| <= L1 + L2   and   |L4 - L3| <= |EF| <= L4 + L3

Its boundary is made of arcs of their four circles, and its corners are crossings of a circle about
A with one about E. So the boundary point nearest to p is one of a few candidates, in this order:

    1. p moved along the ray from A onto A's inner circle, then onto A's outer circle
    2. the same for E
    3. crossings of A's inner circle with E's inner, E's outer; of A's outer with the same;
       of each pair first the crossing to the right of A -> E, where a leg hangs
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, Bools, as_pairs, at, first_index
from fivebar_sim.errors import ArgumentError, GeometryError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import ROUNDING, bases
from fivebar_sim.kinematics.planar import dot, perp, unit
from fivebar_sim.kinematics.reach import reaches

BLOCK = 4096
"""Points solved at a time, so that the temporaries stay in the cache."""

FAR = 1e150
"""Coordinates [m] from here on are refused: their squares overflow."""


class _Ring(NamedTuple):
    """Where one side chain reaches.

    Attributes:
        centre: Of the two circles [m], (2,).
        near: Link at the motor [m].
        far: Link beyond the knee [m].
        away: Direction taken for points on the centre: away from the other motor; down if coaxial.
    """

    centre: Array
    near: float
    far: float
    away: Array

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii of the circles [m], inner first; a hole that `holds` takes for rounding is none."""
        inner, outer = abs(self.near - self.far), self.near + self.far
        return (inner, outer) if inner**2 > ROUNDING * outer**2 else (outer,)

    def holds(self, points: Array) -> Bools:
        """Return where the chain reaches, by the very comparison of `kinematics.inverse`."""
        r = points - self.centre
        return reaches(dot(r, r), self.near, self.far)


def _rings(leg: FiveBar) -> tuple[_Ring, _Ring]:
    """Return the rings about A and E of a leg whose foot is C."""
    if leg.L6 > 0.0:
        raise ArgumentError(
            f"workspace of a leg with L6 > 0 is not known here; L6 must be 0 m, got {leg.L6:g} m"
        )
    A, E = bases(leg)
    along = unit(leg.tilt)
    down = np.array([0.0, -1.0])
    away_A, away_E = (-along, along) if leg.L5 > 0.0 else (down, down)
    return _Ring(A, leg.L1, leg.L2, away_A), _Ring(E, leg.L4, leg.L3, away_E)


def reachable(leg: FiveBar, foot: ArrayLike) -> Bools:
    """Return where the foot can be put: where `kinematics.inverse` gives an answer.

    Args:
        leg: The leg, with L6 = 0.
        foot: F [m], hip frame, (..., 2). NaN and infinity are not reachable.

    Returns:
        Truth values, (...).

    Raises:
        ArgumentError: If L6 > 0, or a shape other than (..., 2).
    """
    left, right = _rings(leg)
    foot = as_pairs(foot, "foot")
    with np.errstate(over="ignore", invalid="ignore"):  # a square of 1e200 m is as far as inf
        return np.asarray(left.holds(foot) & right.holds(foot))


def nearest(leg: FiveBar, foot: ArrayLike) -> Array:
    """Return the nearest points that the foot can reach.

    A reachable point is returned as it is. Any other goes to the nearest point of the boundary,
    and from there by units in the last place to where `reachable`, and so `kinematics.inverse`,
    accepts it. Of points equally near (to rounding) the first in the module's order is taken. A
    point on a motor axis has no ray from it: there the ray points away from the other motor, and
    to -z if the motors are coaxial.

    Args:
        leg: The leg, with L6 = 0.
        foot: F [m], hip frame, (..., 2).

    Returns:
        The nearest reachable points [m], (..., 2).

    Raises:
        ArgumentError: If L6 > 0, a shape other than (..., 2), or unless |x|, |z| < 1e150 m.
        GeometryError: If no floating-point number lies in the workspace.
    """
    left, right = _rings(leg)

    def solve(p: Array) -> Array:
        best, lost = p.copy(), ~(left.holds(p) & right.holds(p))
        if lost.any():
            best[lost] = _settled(left, right, _boundary_point(left, right, p[lost]))
        return best

    return _by_blocks(solve, _finite(foot), (2,))


def distance(leg: FiveBar, foot: ArrayLike) -> Array:
    """Return the distance to the boundary of the workspace: positive inside, negative outside.

    Args:
        leg: The leg, with L6 = 0.
        foot: F [m], hip frame, (..., 2).

    Returns:
        Signed distances [m], (...): at least 0 where `reachable`.

    Raises:
        ArgumentError: If L6 > 0, a shape other than (..., 2), or unless |x|, |z| < 1e150 m.
        GeometryError: If no floating-point number lies in the workspace.
    """
    left, right = _rings(leg)

    def solve(p: Array) -> Array:
        gap = _norm(p - _boundary_point(left, right, p))
        return np.where(left.holds(p) & right.holds(p), gap, -gap)

    return _by_blocks(solve, _finite(foot), ())


def _finite(foot: ArrayLike) -> Array:
    foot = as_pairs(foot, "foot")
    bad = np.asarray(~(np.abs(foot) < FAR).all(axis=-1))
    if bad.any():
        index = first_index(bad)
        raise ArgumentError(
            f"foot must be finite, below {FAR:g} m, got {tuple(foot[index].tolist())} m{at(index)}"
        )
    return foot


def _by_blocks(solve: Callable[[Array], Array], foot: Array, item: tuple[int, ...]) -> Array:
    """Return what solve gives for flat blocks of points, as foot's batch of items."""
    flat = foot.reshape(-1, 2)
    out = np.empty((len(flat), *item))
    for start in range(0, len(flat), BLOCK):
        block = slice(start, start + BLOCK)
        out[block] = solve(flat[block])
    return out.reshape((*foot.shape[:-1], *item))


def _boundary_point(left: _Ring, right: _Ring, p: Array) -> Array:
    """Return the point of the workspace's boundary that is nearest to each p, (n, 2).

    A candidate c replaces the best so far, b, if it is nearer by more than rounding:

        |p - b|^2 - |p - c|^2 = (c - b) . (2 p - b - c)

    which keeps its digits where both are nearly equally far, and where p is far away.
    """
    rounding = ROUNDING * max(left.near + left.far, right.near + right.far)
    best, d_best, found = np.zeros_like(p), np.zeros(len(p)), np.zeros(len(p), dtype=bool)
    for c, on_boundary in _candidates(left, right, p):
        d = _norm(p - c)
        nearer = dot(c - best, (p - best) + (p - c)) > rounding * (d + d_best)
        take = on_boundary & (nearer | ~found)
        best[take] = c[take] if c.ndim == 2 else c
        d_best[take] = d[take]
        found |= take
    if not found.all():
        raise _empty(left, right)
    return best


def _candidates(left: _Ring, right: _Ring, p: Array) -> Iterator[tuple[Array, Bools]]:
    """Yield the candidates for the nearest boundary point, (n, 2) or (2,), and which are on it."""
    for ring, other in ((left, right), (right, left)):
        r = p - ring.centre
        length = _norm(r)[:, None]
        off_centre = length > ROUNDING * ring.radii[-1]
        ray = np.where(off_centre, r, ring.away) / np.where(off_centre, length, 1.0)
        for radius in ring.radii:
            c = ring.centre + radius * ray
            yield c, other.holds(c)
    for corner in _corners(left, right):
        yield corner, np.ones(len(p), dtype=bool)


def _corners(left: _Ring, right: _Ring) -> Iterator[Array]:
    """Yield the crossings of A's circles with E's; one that misses by rounding counts.

    With d = |AE|, u the unit vector along AE, and n = u turned by +90 deg:

        c = A + a u -+ h n,   a = d / 2 + (r_A + r_E) (r_A - r_E) / 2d,   h = sqrt(r_A^2 - a^2)

    where, with t = r_A + r_E and g = r_A - r_E, nothing is lost near h = 0 in

        h = sqrt((t - d) (t + d) (d - g) (d + g)) / 2d
    """
    AE = right.centre - left.centre
    d = float(_norm(AE))
    for r_A in left.radii:
        for r_E in right.radii:
            t, g = r_A + r_E, r_A - r_E
            rounding = ROUNDING * (t + d)
            if not (d > 0.0 and abs(g) - rounding <= d <= t + rounding):
                continue
            a = 0.5 * d + t * g / (2.0 * d)
            h = max((t - d) * (t + d) * (d - g) * (d + g), 0.0) ** 0.5 / (2.0 * d)
            if abs(np.hypot(a, h) - r_A) > rounding or abs(np.hypot(d - a, h) - r_E) > rounding:
                continue  # concentric circles but for rounding
            u = AE / d
            for side in (-1.0, 1.0):
                yield left.centre + a * u + side * h * perp(u)


def _settled(left: _Ring, right: _Ring, points: Array) -> Array:
    """Return boundary points moved to the first floating-point neighbours that are reachable.

    A boundary point is off by some units in the last place of the larger ring's radius, which may
    be more than the smaller ring's slack.
    """
    points = points.copy()
    ulp = np.spacing(max(left.near + left.far, right.near + right.far))
    lost = np.flatnonzero(~(left.holds(points) & right.holds(points)))
    for step, x, z in product((0.25, 0.5, 1.0, 2.0, 4.0, 8.0), (0, -1, 1), (0, -1, 1)):
        if not lost.size:
            break
        moved = points[lost] + step * ulp * np.array([x, z])
        ok = left.holds(moved) & right.holds(moved)
        points[lost[ok]] = moved[ok]
        lost = lost[~ok]
    if lost.size:
        raise _empty(left, right)
    return points


def _empty(left: _Ring, right: _Ring) -> GeometryError:
    text = " and ".join(
        f"[{abs(ring.near - ring.far):g}, {ring.near + ring.far:g}] m from {name}"
        for name, ring in (("A", left), ("E", right))
    )
    L5 = float(_norm(right.centre - left.centre))
    return GeometryError(f"the workspace is empty to rounding: {text}, with L5 = {L5:g} m")


def _norm(v: Array) -> Array:
    return np.hypot(v[..., 0], v[..., 1])
