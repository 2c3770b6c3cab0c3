"""The workspace of a leg without an extension: its boundary, and the nearest point of that.

The foot F is C, and the workspace is the intersection of two rings:

    |L1 - L2| <= |AF| <= L1 + L2   and   |L4 - L3| <= |EF| <= L4 + L3

Its boundary is made of arcs of their four circles, and its corners are crossings of a circle about
A with one about E. So the boundary point nearest to p is one of a few candidates, in this order:

    1. p moved along the ray from A onto A's inner circle, then onto A's outer circle
    2. the same for E
    3. crossings of A's inner circle with E's inner, E's outer; of A's outer with the same;
       of each pair first the crossing to the right of A -> E, where a leg hangs

A margin m leaves those points whose circle of radius m lies in the workspace. That is again the
intersection of two rings, and exactly so: a circle fits in both rings if it fits in each.

    |L1 - L2| + m <= |AF| <= L1 + L2 - m   and   |L4 - L3| + m <= |EF| <= L4 + L3 - m

A ring without a hole, near = far, does not get one.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import GeometryError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import ROUNDING, bases
from fivebar_sim.kinematics.planar import dot, perp, unit
from fivebar_sim.kinematics.reach import reaches
from fivebar_sim.workspace.coupler import spans


class Ring(NamedTuple):
    """The points that one side chain reaches.

    Attributes:
        centre: Common centre of the two circles [m], (2,).
        near: Link at the motor [m].
        far: Link beyond the knee [m].
        away: Direction for points on the centre: away from the other motor; down if coaxial.
    """

    centre: Array
    near: float
    far: float
    away: Array

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii of the circles [m], inner first; a hole that is mere rounding is left out."""
        inner = abs(self.near - self.far)
        outer = self.near + self.far
        # Squares, as in `reaches`: both must call the same hole rounding.
        return (inner, outer) if inner**2 > ROUNDING * outer**2 else (outer,)

    @property
    def hole(self) -> float:
        """Radius of the inner circle [m], 0 for none."""
        return self.radii[0] if len(self.radii) == 2 else 0.0

    def holds(self, points: Array) -> Bools:
        """Return where the chain reaches."""
        # By the very comparison of `kinematics.inverse`, so that the two never disagree.
        r = points - self.centre
        return reaches(dot(r, r), self.near, self.far)

    def shrink(self, margin: float) -> Ring:
        """Return the ring of the points that are at least margin [m] inside.

        It is again a ring of two links: their sum is less by the margin, and their difference, if
        there is a hole, more by it.
        """
        long = max(self.near, self.far)
        short = min(self.near, self.far)
        if self.hole == 0.0:
            return self._replace(near=long - 0.5 * margin, far=short - 0.5 * margin)
        return self._replace(near=long, far=short - margin)


class Rings(NamedTuple):
    """The workspace of a leg with L6 = 0, less a margin.

    Attributes:
        leg: The leg.
        left: The ring about A.
        right: The ring about E.
        margin: By how much the rings are shrunk [m].
    """

    leg: FiveBar
    left: Ring
    right: Ring
    margin: float = 0.0

    @property
    def block(self) -> int:
        """Points to solve at a time, so that the temporaries stay in the cache."""
        return 4096

    @property
    def scale(self) -> float:
        """The larger outer radius [m]."""
        return max(self.left.near + self.left.far, self.right.near + self.right.far)

    def holds(self, points: Array) -> Bools:
        """Return where both chains reach."""
        return self.left.holds(points) & self.right.holds(points) & (not self._void)

    @property
    def _void(self) -> bool:
        """Whether the margin is more than half of a ring's width."""
        return min(self.left.far, self.right.far) < 0.0

    def nudges(self) -> Iterator[tuple[float, float]]:
        """Yield how far to move a lost boundary point [m], by up to 8 units in the last place."""
        ulp = float(np.spacing(self.scale))
        for step, x, z in product((0.25, 0.5, 1.0, 2.0, 4.0, 8.0), (0, -1, 1), (0, -1, 1)):
            yield step * ulp * x, step * ulp * z

    def nudge(self, points: Array, x: float, z: float) -> Array:
        """Return points moved along x and z [m]."""
        return points + np.array([x, z])

    def boundary_point(self, p: Array) -> Array:
        """Return the point of the boundary that is nearest to each p, (n, 2).

        A candidate c replaces the best so far, b, if it is nearer by more than rounding:

            |p - b|^2 - |p - c|^2 = (c - b) . (2 p - b - c)

        which loses no digits where both are nearly equally far, or where p is far away.
        """
        if self._void:
            raise self.empty()

        rounding = ROUNDING * self.scale
        best = np.zeros_like(p)
        d_best = np.zeros(len(p))
        found = np.zeros(len(p), dtype=bool)

        for c, on_boundary in self._candidates(p):
            d = _norm(p - c)
            # Compared with both distances: far points have coarser last places.
            nearer = dot(c - best, (p - best) + (p - c)) > rounding * (d + d_best)
            take = on_boundary & (nearer | ~found)
            best[take] = c[take] if c.ndim == 2 else c
            d_best[take] = d[take]
            found |= take

        if not found.all():
            raise self.empty()
        return best

    def boundary(self, step: float) -> list[Array]:
        """Return the boundary as polylines (n, 2): the circles' arcs, by steps [rad]."""
        arcs = []
        for ring, other in ((self.left, self.right), (self.right, self.left)):
            to_other = self.leg.tilt + (0.0 if ring is self.left else np.pi)
            for radius in ring.radii:
                for start, stop in spans(radius, self.leg.L5, other.hole, other.radii[-1]):
                    angle = np.linspace(start, stop, max(2, int((stop - start) / step) + 2))
                    arcs.append(ring.centre + radius * unit(angle + to_other))
        return arcs

    def empty(self) -> GeometryError:
        """Return the error of a workspace without a point."""
        text = " and ".join(
            f"[{ring.hole:g}, {ring.near + ring.far:g}] m from {name}"
            for name, ring in (("A", self.left), ("E", self.right))
        )
        less = f" less a margin of {self.margin:g} m" if self.margin > 0.0 else ""
        return GeometryError(
            f"the workspace{less} is empty to rounding: {text}, with L5 = {self.leg.L5:g} m"
        )

    def _candidates(self, p: Array) -> Iterator[tuple[Array, Bools]]:
        """Yield candidates for the nearest point, (n, 2) or (2,), and which are on the boundary."""
        for ring, other in ((self.left, self.right), (self.right, self.left)):
            r = p - ring.centre
            length = _norm(r)[:, None]
            # From the centre every direction is as near: take the one away from the other ring.
            off_centre = length > ROUNDING * ring.radii[-1]
            ray = np.where(off_centre, r, ring.away) / np.where(off_centre, length, 1.0)
            for radius in ring.radii:
                c = ring.centre + radius * ray
                yield c, other.holds(c)
        for corner in _corners(self.left, self.right):
            yield corner, np.ones(len(p), dtype=bool)


def rings(leg: FiveBar, margin: float = 0.0) -> Rings:
    """Return the workspace of a leg with L6 = 0, less a margin [m]."""
    A, E = bases(leg)
    along = unit(leg.tilt)
    down = np.array([0.0, -1.0])
    away_A, away_E = (-along, along) if leg.L5 > 0.0 else (down, down)
    left = Ring(A, leg.L1, leg.L2, away_A)
    right = Ring(E, leg.L4, leg.L3, away_E)
    if margin > 0.0:
        left = left.shrink(margin)
        right = right.shrink(margin)
    return Rings(leg, left, right, margin)


def _corners(left: Ring, right: Ring) -> Iterator[Array]:
    """Yield the crossings of A's circles with E's; a miss by rounding counts as a crossing.

    With d = |AE|, u the unit vector along AE, and n = u turned by +90 deg:

        c = A + a u -+ h n,   a = d / 2 + (r_A + r_E) (r_A - r_E) / 2d,   h = sqrt(r_A^2 - a^2)

    where, with t = r_A + r_E and g = r_A - r_E, no digits are lost near h = 0 in

        h = sqrt((t - d) (t + d) (d - g) (d + g)) / 2d
    """
    AE = right.centre - left.centre
    d = float(_norm(AE))
    for r_A in left.radii:
        for r_E in right.radii:
            t = r_A + r_E
            g = r_A - r_E
            rounding = ROUNDING * (t + d)
            if not (d > 0.0 and abs(g) - rounding <= d <= t + rounding):
                continue
            a = 0.5 * d + t * g / (2.0 * d)
            h = max((t - d) * (t + d) * (d - g) * (d + g), 0.0) ** 0.5 / (2.0 * d)
            # Concentric but for rounding: the formula divides by a d of mere rounding.
            if abs(np.hypot(a, h) - r_A) > rounding or abs(np.hypot(d - a, h) - r_E) > rounding:
                continue
            u = AE / d
            for side in (-1.0, 1.0):
                yield left.centre + a * u + side * h * perp(u)


def _norm(v: Array) -> Array:
    return np.hypot(v[..., 0], v[..., 1])
