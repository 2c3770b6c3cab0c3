"""The coupler curves of a leg with an extension: part of `fivebar_nearest` of the C code.

With C at the edge of E's reach, |EC| = R, the foot moves on a coupler curve of the four-bar A, B,
C, E. All of the curve is in reach, so its nearest point may be taken wherever it is.

`firmware/fivebar_leg.c` walks along the curves; here all places of a curve are found at once, and
what it considers comes in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Bools
from fivebar_sim.firmware.elementary import Real, cross, magnitude, multiply, square_root
from fivebar_sim.firmware.four_bar import FourBar, Place, bars_of, follow
from fivebar_sim.firmware.leg import Leg

INTERVALS = 32
"""Intervals on a curve, or on half of one that is single."""

PARTS = 8
"""Parts of an interval in which the foot or the crank's pose changes fast."""

STEPS = 12
"""Steps to a minimum within an interval."""

TURN = 0.5
"""Tangent of what a direction may turn within an interval."""

BEGIN = 0.4375
"""Where the first interval begins: nowhere near the symmetric poses, where branches may cross."""

Rows = NDArray[np.intp]


def rows_of(value: Any, index: Any) -> Any:
    """Return some rows of a tuple of arrays, or of tuples of them."""
    fields = (rows_of(v, index) if isinstance(v, tuple) else v[index] for v in value)
    return type(value)(*fields)


def candidates(leg: Leg, p: Real, away: Real, ray: Real) -> Iterator[tuple[Rows, Real]]:
    """Yield candidates for the nearest points, at most one for a point at a time.

    Args:
        leg: Legs with an extension, (n).
        p: Points [m], (n, 2).
        away: Direction from E to A, (n, 2).
        ray: Direction from A to p, (n, 2).

    Yields:
        The rows of the points, and their candidates [m], which rounding may have put out of reach.
    """
    kind = p.dtype.type
    coaxial = ~(leg.L5 > 0.0)
    u = np.where(coaxial[:, None], np.array([1.0, 0.0], dtype=p.dtype), -away)
    every = np.ones_like(coaxial)
    for R, usable in ((leg.to_C.inner, leg.to_C.least > 0.0), (leg.to_C.outer, every)):
        both = bars_of(leg, p, u, R)
        for sign in (1.0, -1.0):
            bar = both._replace(sign=np.full_like(R, kind(sign)))
            live = usable & bar.live
            rigid = np.flatnonzero(live & coaxial)
            yield rigid, _on_circle(leg, bar, ray, rigid)

            rows = np.flatnonzero(live & ~coaxial)
            for owner, F in _minima(rows_of(bar, rows)):
                chosen = rows[owner]
                yield chosen, _to_hip(leg, bar, u, chosen, F)


def _on_circle(leg: Leg, bar: FourBar, ray: Real, rows: Rows) -> Real:
    """Return the points of coaxial legs: A, B and C are a rigid triangle, the curve is a circle."""
    F = follow(rows_of(bar, rows), np.zeros_like(bar.base[rows])).F
    radius = square_root(F[..., 0] * F[..., 0] + F[..., 1] * F[..., 1])
    return leg.A[rows] + radius[:, None] * ray[rows]


def _to_hip(leg: Leg, bar: FourBar, u: Real, rows: Rows, F: Real) -> Real:
    """Return feet of four-bars in the hip frame."""
    swapped = bar.swapped[rows]
    x = np.where(swapped, bar.base[rows] - F[..., 0], F[..., 0])
    z = np.where(swapped, -F[..., 1], F[..., 1])
    return leg.A[rows] + multiply(u[rows], np.stack([x, z], axis=-1))


def _minima(bar: FourBar) -> Iterator[tuple[Rows, Real]]:
    """Yield feet, at most one for a curve at a time: where it starts, and its minima in order."""
    w, width = _intervals(bar)
    at = follow(rows_of(bar, (slice(None), None)), w)
    # Of a leg with all links in line the curve is a point, on which nothing falls.
    yield np.arange(len(w)), at.F[:, 0]

    owner, *bracket = _brackets(bar, at, w, width)
    F = _lowest(rows_of(bar, owner), *bracket)
    # How many of the same curve come before.
    place = np.arange(len(owner)) - np.searchsorted(owner, owner)
    for k in range(int(place.max(initial=-1)) + 1):
        chosen = place == k
        yield owner[chosen], F[chosen]


def _intervals(bar: FourBar) -> tuple[Real, Real]:
    """Return the ends of all intervals, (n, INTERVALS + 1), and their width, (n)."""
    kind = bar.base.dtype.type
    width = np.where(bar.single, kind(2.0), kind(4.0)) / kind(INTERVALS)
    first = np.where(bar.single & (bar.sign < 0.0), kind(2.0), kind(0.0))
    steps = np.arange(INTERVALS + 1, dtype=width.dtype) + kind(BEGIN)
    return first[:, None] + steps * width[:, None], width


def _brackets(bar: FourBar, at: Place, w: Real, width: Real) -> tuple[Rows, Real, Real, Real, Real]:
    """Return the intervals with a minimum: row, start, width, and slopes at both ends, in order."""
    start = rows_of(at, (slice(None), slice(None, -1)))
    end = rows_of(at, (slice(None), slice(1, None)))
    # Where the foot or the crank's pose changes fast, a closer look.
    coarse = _veers(start.along, end.along) | _veers(start.r, end.r)
    row, j = np.nonzero(~coarse & _falls(start.slope, end.slope))
    plain = (row, w[row, j], width[row], start.slope[row, j], end.slope[row, j])

    closer, i = np.nonzero(coarse)
    small = width[closer] / w.dtype.type(PARTS)
    parts = np.arange(PARTS + 1, dtype=w.dtype)
    inner = w[closer, i][:, None] + parts * small[:, None]
    slope = follow(rows_of(bar, (closer, None)), inner).slope
    c, m = np.nonzero(_falls(slope[:, :-1], slope[:, 1:]))
    fine = (closer[c], inner[c, m], small[c], slope[c, m], slope[c, m + 1])

    place = np.concatenate([row * INTERVALS + j, closer[c] * INTERVALS + i[c]])
    order = np.argsort(place * PARTS + np.concatenate([np.zeros_like(row), m]))
    row, w, width, f_a, f_b = (
        np.concatenate(pair)[order] for pair in zip(plain, fine, strict=True)
    )
    return row, w, width, f_a, f_b


def _falls(f_a: Real, f_b: Real) -> Bools:
    """Return where a slope changes from above 0 to below."""
    return np.asarray((f_a > 0.0) & ~(f_b > 0.0))


def _veers(a: Real, b: Real) -> Bools:
    """Return where a direction turns by much."""
    return np.asarray(
        ~(magnitude(cross(a, b)) <= TURN * (a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]))
    )


def _lowest(bar: FourBar, w: Real, width: Real, f_a: Real, f_b: Real) -> Real:
    """Return the feet at the minima within intervals: the slope's zero, by the Illinois rule."""
    one = w.dtype.type(1.0)
    half = w.dtype.type(0.5)
    a = np.zeros_like(w)
    b = np.ones_like(w)
    F = bar.point
    for _ in range(STEPS):
        fall = f_b - f_a
        new = b - f_b * (b - a) / np.where(fall == 0.0, one, fall)
        at = follow(bar, w + new * width)
        flips = (at.slope > 0.0) != (f_b > 0.0)
        a = np.where(flips, b, a)
        f_a = np.where(flips, f_b, half * f_a)
        b = new
        f_b = at.slope
        F = at.F
    return F
