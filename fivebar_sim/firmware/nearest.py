"""The nearest reachable point as the firmware finds it: `fivebar_nearest` of the C code."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Bools
from fivebar_sim.firmware.elementary import Real, is_finite, magnitude, numbers, square_root
from fivebar_sim.firmware.kinematics import cranks, reaches
from fivebar_sim.firmware.leg import Chain, Leg
from fivebar_sim.firmware.status import Status, Statuses, first_of

FARTHEST = 1e6
"""Coordinates from here on have no nearest point [m]."""


def nearest(leg: Leg, foot: ArrayLike) -> tuple[Real, Statuses]:
    """Return the reachable points nearest to given ones [m], (..., 2), and statuses.

    The boundary is made of arcs of the chains' circles, which end in corners, so the nearest point
    is the foot of a perpendicular on a circle, or a corner. With L6 > 0 it is made of coupler
    curves: there the firmware has no answer.

    Args:
        leg: The leg.
        foot: Points [m], hip frame, (..., 2).
    """
    p = np.asarray(foot, dtype=leg.L1.dtype)
    kind = p.dtype.type
    held = reaches(leg, p) == Status.OK
    best = np.zeros_like(p + leg.A)
    found = np.zeros(best.shape[:-1], dtype=bool)
    one = np.ones((), dtype=np.int32)
    with np.errstate(all="ignore"):
        for c, usable in _candidates(leg, p):
            # |p - best|^2 - |p - c|^2 as one product, which keeps its digits where p is far away.
            gain = (c - best) * ((p - best) + (p - c))
            nearer = gain[..., 0] + gain[..., 1] > 0.0
            there = cranks(leg, c, one, one)[2] == Status.OK
            take = usable & there & (nearer | ~found)
            best = np.where(take[..., None], c, best)
            found = found | take

    status = first_of(
        (~is_finite(p), Status.NOT_FINITE),
        (held, Status.OK),
        (np.asarray(leg.L6 > 0.0) & np.ones_like(held), Status.NO_ANSWER),
        (~(magnitude(p) <= FARTHEST).all(axis=-1), Status.OUT_OF_LIMITS),
        (~found, Status.UNREACHABLE),
    )
    answer = np.where(held[..., None], p, best)
    return np.where((status == Status.OK)[..., None], answer, kind(np.nan)), status


def _candidates(leg: Leg, p: Real) -> Iterator[tuple[Real, Bools]]:
    """Yield candidates (..., 2) for the nearest point, and where they are meant at all."""
    kind = p.dtype.type
    two = kind(2.0)
    coaxial = np.asarray(~(leg.L5 > 0.0))[..., None]
    down = np.array([0.0, -1.0], dtype=p.dtype)
    # Of a point on a motor: away from the other one; down if they are coaxial.
    from_E = two * leg.A / leg.L5[..., None]
    away_A = np.where(coaxial, down, from_E)
    away_E = np.where(coaxial, down, -from_E)
    for chain, centre, away in ((leg.to_foot, leg.A, away_A), (leg.to_C, -leg.A, away_E)):
        yield from _on_circles(chain, centre, away, p)
    for r_A, usable_A in _radii(leg.to_foot):
        for r_E, usable_E in _radii(leg.to_C):
            for corner in _corners(leg, r_A, r_E):
                yield corner, usable_A & usable_E & ~coaxial[..., 0]


def _on_circles(chain: Chain, centre: Real, away: Real, p: Real) -> Iterator[tuple[Real, Bools]]:
    """Yield the points of a chain's two circles in the direction of p."""
    kind = p.dtype.type
    ray = p - centre
    d = square_root(ray[..., 0] * ray[..., 0] + ray[..., 1] * ray[..., 1])
    # From the centre every direction is as near.
    off = d > (kind(4.0) * kind(numbers(p).epsilon)) * chain.outer
    ray = np.where(off[..., None], ray / d[..., None], away)
    for radius, usable in _radii(chain):
        yield centre + radius[..., None] * ray, usable


def _radii(chain: Chain) -> Iterator[tuple[Real, Bools]]:
    """Yield the radii of a chain's circles, inner first, and where they are circles at all."""
    yield np.asarray(chain.inner), np.asarray(chain.least > 0.0)
    yield np.asarray(chain.outer), np.ones_like(np.asarray(chain.least > 0.0))


def _corners(leg: Leg, r_A: Real, r_E: Real) -> Iterator[Real]:
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
