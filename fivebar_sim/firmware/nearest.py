"""The nearest reachable point as the firmware finds it: `fivebar_nearest` of the C code."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Bools
from fivebar_sim.firmware.coupler import Rows, candidates, rows_of
from fivebar_sim.firmware.elementary import Real, is_finite, magnitude, numbers, square_root
from fivebar_sim.firmware.kinematics import reaches
from fivebar_sim.firmware.leg import Chain, Leg
from fivebar_sim.firmware.status import Status, Statuses, first_of

FARTHEST = 1e6
"""Coordinates from here on have no nearest point [m]."""

NUDGES = 6
"""How often the doubled unit in the last place may move a point back into reach."""


def nearest(leg: Leg, foot: ArrayLike) -> tuple[Real, Statuses]:
    """Return the reachable points nearest to given ones [m], (..., 2), and statuses.

    Args:
        leg: The leg.
        foot: Points [m], hip frame, (..., 2).
    """
    p = np.asarray(foot, dtype=leg.L1.dtype)
    kind = p.dtype.type
    held = reaches(leg, p) == Status.OK
    far = ~(magnitude(p) <= FARTHEST).all(axis=-1)
    answer = np.array(np.broadcast_to(p, (*held.shape, 2)))
    found = np.array(held)
    lost = np.asarray(is_finite(p) & ~held & ~far)
    with np.errstate(all="ignore"):
        best, there = _search(_rows(leg, held.shape, lost), answer[lost])
    answer[lost] = best
    found[lost] = there

    status = first_of(
        (~is_finite(p), Status.NOT_FINITE),
        (held, Status.OK),
        (far, Status.OUT_OF_LIMITS),
        (~found, Status.UNREACHABLE),
    )
    return np.where((status == Status.OK)[..., None], answer, kind(np.nan)), status


def _rows(leg: Leg, shape: tuple[int, ...], chosen: Bools) -> Leg:
    """Return the legs of some places of a batch, one for each."""

    def spread(value: Any) -> Any:
        if isinstance(value, tuple):
            return Chain(*map(spread, value))
        vector = np.shape(value)[np.ndim(leg.L1) :]
        return np.broadcast_to(value, (*shape, *vector))[chosen]

    return Leg(*map(spread, leg))


def _search(leg: Leg, p: Real) -> tuple[Real, Bools]:
    """Return the best of all candidates for points (n, 2), each with its leg, and if there is one.

    Without an extension the boundary is made of arcs of the chains' circles, which end in corners,
    so the nearest point is the foot of a perpendicular on a circle, or a corner. With one it is
    made of circles about A and coupler curves.
    """
    best = np.zeros_like(p)
    found = np.zeros(len(p), dtype=bool)
    coaxial = ~(leg.L5 > 0.0)
    extended = leg.L6 > 0.0
    down = np.array([0.0, -1.0], dtype=p.dtype)
    # Of a point on a motor: away from the other one; down if they are coaxial.
    from_E = p.dtype.type(2.0) * leg.A / leg.L5[:, None]
    away_A = np.where(coaxial[:, None], down, from_E)
    away_E = np.where(coaxial[:, None], down, -from_E)

    ray = _ray(leg.to_foot, leg.A, away_A, p)
    for c, usable in _on_circles(leg.to_foot, leg.A, ray):
        _consider(leg, p, best, found, np.flatnonzero(usable), c[usable], 0)
    ray_E = _ray(leg.to_C, -leg.A, away_E, p)
    for c, usable in _on_circles(leg.to_C, -leg.A, ray_E):
        rows = np.flatnonzero(usable & ~extended)
        _consider(leg, p, best, found, rows, c[rows], 0)
    for c, usable in _corners(leg):
        rows = np.flatnonzero(usable & ~extended & ~coaxial)
        _consider(leg, p, best, found, rows, c[rows], 0)

    some = np.flatnonzero(extended)
    for rows, c in candidates(rows_of(leg, some), p[some], away_A[some], ray[some]):
        _consider(leg, p, best, found, some[rows], c, NUDGES)
    return best, found


def _consider(
    leg: Leg, p: Real, best: Real, found: Bools, rows: Rows, c: Real, nudges: int
) -> None:
    """Take candidates (m, 2) of some rows that are nearer than the best ones, if in reach.

    One that rounding put out of reach is moved by some units in the last place, doubled `nudges`
    times.
    """
    kind = p.dtype.type
    at = p[rows]
    old = best[rows]
    # |p - best|^2 - |p - c|^2 as one product, which keeps its digits where p is far away.
    gain = (c - old) * ((at - old) + (at - c))
    wanted = ~found[rows] | (gain[..., 0] + gain[..., 1] > 0.0)
    rows = rows[wanted]
    c = c[wanted]
    step = kind(numbers(p).epsilon) * (leg.to_foot.outer + leg.L5)

    for times, x, z in _moves(nudges):
        if not rows.size:
            return
        move = (step[rows] * kind(times))[:, None] * np.array([x, z], dtype=p.dtype)
        tried = c + move if times else c
        there = reaches(rows_of(leg, rows), tried) == Status.OK
        best[rows[there]] = tried[there]
        found[rows[there]] = True
        rows = rows[~there]
        c = c[~there]


def _moves(nudges: int) -> Iterator[tuple[float, int, int]]:
    """Yield how to move a point: so many units in the last place, along x and along z."""
    yield 0.0, 0, 0
    for k in range(nudges):
        for x, z in product((-1, 0, 1), (-1, 0, 1)):
            yield 2.0**k, x, z


def _ray(chain: Chain, centre: Real, away: Real, p: Real) -> Real:
    """Return the directions from centres to points; from the centre every one is as near."""
    kind = p.dtype.type
    ray = p - centre
    d = square_root(ray[..., 0] * ray[..., 0] + ray[..., 1] * ray[..., 1])
    off = d > (kind(4.0) * kind(numbers(p).epsilon)) * chain.outer
    return np.where(off[..., None], ray / d[..., None], away)


def _on_circles(chain: Chain, centre: Real, ray: Real) -> Iterator[tuple[Real, Bools]]:
    """Yield the points of a chain's two circles in the direction of p."""
    for radius, usable in _radii(chain):
        yield centre + radius[..., None] * ray, usable


def _radii(chain: Chain) -> Iterator[tuple[Real, Bools]]:
    """Yield the radii of a chain's circles, inner first, and where they are circles at all."""
    yield np.asarray(chain.inner), np.asarray(chain.least > 0.0)
    yield np.asarray(chain.outer), np.ones_like(np.asarray(chain.least > 0.0))


def _corners(leg: Leg) -> Iterator[tuple[Real, Bools]]:
    """Yield the crossings of circles about A with ones about E, and where both are circles."""
    for r_A, usable_A in _radii(leg.to_foot):
        for r_E, usable_E in _radii(leg.to_C):
            for corner in _crossings(leg, r_A, r_E):
                yield corner, usable_A & usable_E


def _crossings(leg: Leg, r_A: Real, r_E: Real) -> Iterator[Real]:
    """Yield the two crossings of a circle about A with one about E."""
    kind = r_A.dtype.type
    two = kind(2.0)
    A = leg.A
    d = leg.L5
    total = r_A + r_E
    gap = r_A - r_E
    h2 = ((total - d) * (total + d)) * ((d - gap) * (d + gap))
    a = kind(0.5) * d + total * gap / (two * d)
    h = square_root(h2) / (two * d)
    u = -two * A / d[..., None]

    for side in (-1.0, 1.0):
        across = kind(side) * h
        x = A[..., 0] + (a * u[..., 0] - across * u[..., 1])
        z = A[..., 1] + (a * u[..., 1] + across * u[..., 0])
        yield np.stack([x, z], axis=-1)
