"""The workspace of a leg with an extension, L6 > 0: its boundary, and the nearest point of that.

The foot F lies beyond C, fixed to L2, at rho = |BF|. For either elbow of side A, s_A = -1 and +1,

    |L1 - rho| <= |AF| <= L1 + rho   and   |L4 - L3| <= |EC| <= L4 + L3,   C = C(F, s_A)

and the workspace is the union of what the two elbows reach. So its boundary is made of

    arcs of the two circles about A (A, B, F in line, so both elbows are one), where E reaches C
    coupler curves (E, D, C in line: C on a circle about E) of the two four-bars A, B, C, E with
        the rocker |L4 - L3| or L4 + L3, where the other elbow does not reach F

An arc ends where a coupler curve touches it; a coupler curve ends where it meets one of the other
elbow's, or touches a circle. Both are poses at which the other elbow's C is on a circle about E.
In the workspace of one elbow alone, a coupler curve is boundary as far as it has that elbow.

In this file the plane is complex, with the origin at A and E on the positive real axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import GeometryError
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.kinematics.closure import ROUNDING, bases
from fivebar_sim.kinematics.reach import foot_radius_and_angle, inverse_all, reaches
from fivebar_sim.workspace.coupler import cut, runs, spans, trace
from fivebar_sim.workspace.curves import Curves, Rows, gather, nearest_on
from fivebar_sim.workspace.four_bar import Complex, FourBar, turn

SAME = 1e-13
"""Two elbows whose reach differs by less, relative to the leg's size, share their boundary."""

SHORTEST = 1e-9
"""Least |BF| relative to the leg's size: with the foot on B the direction of L2 is undefined."""


class InLineCircle(NamedTuple):
    """A circle about A on which A, B and F are in line.

    Attributes:
        radius: |AF| [m].
        C: Joint C in the pose with F in direction 0 [m].
    """

    radius: float
    C: complex


class Extended(NamedTuple):
    """The workspace of a leg with L6 > 0.

    Attributes:
        leg: The leg.
        elbow: s_A, or 0 for both elbows together.
        bar: The four-bar A, B, C, E; its rocker is the outer radius of E's reach.
        circles: The circles about A, inner first.
        curves: The coupler curves' parts on the boundary.
    """

    leg: FiveBar
    elbow: int
    bar: FourBar
    circles: tuple[InLineCircle, ...]
    curves: Curves

    @property
    def block(self) -> int:
        """Points to solve at a time, so that a block takes about a million distances."""
        return max(64, 2**20 // max(1, len(self.curves.F)))

    @property
    def scale(self) -> float:
        """The largest radius [m]."""
        return self.circles[-1].radius

    def holds(self, points: Array) -> Bools:
        """Return where the elbow, or either of both, reaches; `kinematics.inverse_all` decides."""
        modes = [k for k, mode in enumerate(MODES) if self.elbow in (0, mode[0])]
        theta_A = inverse_all(self.leg, points)[..., modes, 0]
        return np.asarray(np.isfinite(theta_A).any(axis=-1))

    def nudges(self) -> Iterator[tuple[float, float]]:
        """Yield how far to move a lost boundary point, outward from A and around it [m].

        Units in the last place that double, up to 2e-7 of the leg's size.
        """
        # So far, since C moves with the square root of F's rounding where A, B and F are in line,
        # and a single elbow is out of reach there.
        ulp = float(np.spacing(self.scale))
        for step in (ulp * 2.0**k for k in range(-2, 30)):
            yield from product((0.0, -step, step, -4.0 * ulp, 4.0 * ulp), (0.0, -step, step))

    def nudge(self, points: Array, out: float, around: float) -> Array:
        """Return points moved outward from A and around it [m]."""
        z = from_hip(self.leg, points)
        r = np.abs(z)
        length = np.where(r > 0.0, r, 1.0)
        ray = np.where(r > 0.0, np.angle(z), 0.0)
        return to_hip(self.leg, turn(ray + around / length) * (r + out))

    def boundary_point(self, points: Array) -> Array:
        """Return the point of the boundary that is nearest to each of points (n, 2).

        Of all candidates c the one that gains most on b, the nearest of the sampled poses, is
        taken; of those that are equal to rounding the first:

            |p - b| - |p - c| = (c - b) . (2 p - b - c) / (|p - b| + |p - c|)
        """
        p = from_hip(self.leg, points)
        owner, c, b = _candidates(self, p)
        base = b[owner]
        far = p[owner]
        # Differences of distances, not distances: those of far points differ by rounding only.
        total = np.abs(far - base) + np.abs(far - c)
        gain = (np.conj(c - base) * (2.0 * far - base - c)).real
        gain /= np.where(total > 0.0, total, 1.0)
        # The best of each point's candidates, in one pass without sorting.
        most = np.full(len(p), -np.inf)
        np.maximum.at(most, owner, gain)
        if np.isinf(most).any():
            raise self.empty()

        # Backwards: of several values for one place NumPy keeps the last, here the first candidate.
        best = np.flatnonzero(gain >= most[owner] - ROUNDING * self.scale)[::-1]
        nearest = np.empty_like(p)
        nearest[owner[best]] = c[best]

        return to_hip(self.leg, nearest)

    def boundary(self, step: float) -> list[Array]:
        """Return the boundary as polylines (n, 2): arcs by steps [rad], then coupler curves."""
        pieces = []
        for circle in self.circles:
            for start, stop in self._arcs(circle):
                angle = np.linspace(start, stop, max(2, int(np.ceil((stop - start) / step)) + 1))
                pieces.append(circle.radius * np.exp(1j * angle))
        pieces += [self.curves.F[start:stop] for start, stop in self.curves.ends]
        return [to_hip(self.leg, piece) for piece in pieces]

    def _arcs(self, circle: InLineCircle) -> list[tuple[float, float]]:
        """Return the directions of F at which E reaches the C of a circle."""
        low, high = _reach(self.leg)
        turn = float(np.angle(circle.C))
        return [(a - turn, b - turn) for a, b in spans(abs(circle.C), self.leg.L5, low, high)]

    def empty(self) -> GeometryError:
        """Return the error of a workspace without a point."""
        which = f" with s_A = {self.elbow:+d}" if self.elbow else ""
        return GeometryError(
            f"the workspace{which} is empty to rounding: E reaches no C of a foot within "
            f"{self.scale:g} m of A"
        )


def from_hip(leg: FiveBar, points: Array) -> Complex:
    """Return points (..., 2) of the hip frame as complex numbers of this file's frame, (...)."""
    r = points - bases(leg)[0]
    return (r[..., 0] + 1j * r[..., 1]) * np.exp(-1j * leg.tilt)


def to_hip(leg: FiveBar, z: Complex) -> Array:
    """Return the inverse of `from_hip`."""
    z = z * np.exp(1j * leg.tilt)
    return bases(leg)[0] + np.stack([z.real, z.imag], axis=-1)


def _reach(leg: FiveBar) -> tuple[float, float]:
    """Return the radii of E's reach [m]; the inner one is 0 if it is mere rounding."""
    inner = abs(leg.L4 - leg.L3)
    outer = leg.L4 + leg.L3
    return (inner if inner**2 > ROUNDING * outer**2 else 0.0), outer


# Cached: a leg is asked again and again, and its coupler curves are the same each time.
@lru_cache(maxsize=32)
def region(leg: FiveBar, elbow: int) -> Extended:
    """Return the workspace of a leg with L6 > 0.

    Args:
        leg: The leg.
        elbow: s_A, -1 or +1, for what that elbow reaches; 0 for both together.

    Raises:
        GeometryError: If the foot is on B, L6 = L2 with a bend of half a turn.
    """
    rho, _ = foot_radius_and_angle(leg)
    if not rho > SHORTEST * leg.size:
        raise GeometryError(
            f"L6: the foot is on B; its distance from there must be above {SHORTEST * leg.size:g} "
            f"m, got {rho:g} m"
        )

    low, high = _reach(leg)
    offset = complex(*leg.foot_offset)
    bar = FourBar(leg.L1, leg.L2, high, leg.L5, offset)
    outer = InLineCircle(leg.L1 + rho, leg.L1 + leg.L2 * rho / offset)
    inward = 1.0 if leg.L1 >= rho else -1.0
    inner = InLineCircle(abs(leg.L1 - rho), inward * (leg.L1 - leg.L2 * rho / offset))
    # Squares, as in `reaches`: both must call the same hole rounding.
    holed = inner.radius**2 > ROUNDING * outer.radius**2
    curves = _curves(leg, elbow, bar, low, high)

    return Extended(leg, elbow, bar, (inner, outer) if holed else (outer,), curves)


def _curves(leg: FiveBar, elbow: int, bar: FourBar, low: float, high: float) -> Curves:
    """Return the parts of the coupler curves on the boundary, those of the inner rocker first.

    On them at least one of the functions of the pose below is 0 or above.
    """
    slack = SAME * leg.size

    def bent(q: Array) -> Array:  # s_A (AF x AB), in the frame of L1
        return -elbow * (bar.offset * np.exp(1j * q[..., 1])).imag

    def beyond(q: Array) -> Array:
        return np.abs(bar.other_elbow(q) - bar.base) - high + slack

    def within(q: Array) -> Array:
        return low + slack - np.abs(bar.other_elbow(q) - bar.base)

    # Without an inner circle E's reach has no inside that C could fall into.
    tests = (bent,) if elbow else (within, beyond) if low > 0.0 else (beyond,)
    pieces: list[tuple[FourBar, Array]] = []
    for rocker in _rockers(leg, low, high):
        one = bar._replace(rocker=rocker)
        for q in trace(one):
            for test in tests:
                q = cut(one, q, test)
            dq = np.diff(q, axis=0)
            middle = one.between(q[:-1], dq, np.full(len(dq), 0.5))
            outside = np.any([test(middle) >= 0.0 for test in tests], axis=0)
            pieces += [(one, piece) for piece in runs(q, outside)]

    return gather(pieces)


def _rockers(leg: FiveBar, low: float, high: float) -> list[float]:
    """Return the radii of E's reach that C can cross, as far as side A lets it.

    C is between c_low and c_high from A. A circle at the very edge of that may have poses on it,
    but none beyond.
    """
    slack = ROUNDING * leg.size
    c_low = abs(leg.L1 - leg.L2)
    c_high = leg.L1 + leg.L2
    rockers = []
    if low > max(c_low - leg.L5, leg.L5 - c_high, 0.0) + slack:
        rockers.append(low)
    if high < c_high + leg.L5 - slack:
        rockers.append(high)
    return rockers


def _candidates(region: Extended, p: Complex) -> tuple[Rows, Complex, Complex]:
    """Return the candidates for the point of the boundary nearest to each p (n,).

    Returns:
        owner: Index of the p that a candidate is for, (m,).
        c: The candidate, (m,): on the circles, inner first; on the curves; then the nearest poses.
        b: For each p one of its candidates, or 0 if none is known, (n,).
    """
    every = np.arange(len(p))
    owner = []
    c = []
    length = np.abs(p)
    off = length > ROUNDING * region.scale
    # From A itself every direction is as near: any will do.
    ray = np.where(off, p, -1.0) / np.where(off, length, 1.0)

    for circle in region.circles:
        r = circle.C * ray - region.leg.L5
        ok = reaches(r.real**2 + r.imag**2, region.leg.L4, region.leg.L3)
        owner.append(every[ok])
        c.append(circle.radius * ray[ok])

    b = np.zeros_like(p)
    if len(region.curves.F):
        on_curve, F, b = nearest_on(region.curves, region.bar, p)
        owner += [on_curve, every]
        c += [F, b]

    return np.concatenate(owner), np.concatenate(c), b
