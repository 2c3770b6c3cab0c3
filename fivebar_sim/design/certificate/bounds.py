"""Bounds of reach, of the sines at B, C and D and of the condition number, over boxes of the foot.

For a box of foot positions the distance d from a motor has exact bounds, and of a side with the
links near and far so has each quantity that depends on d alone:

    slack            min(d - |near - far|, near + far - d)
    at the knee      cos mu = (near^2 + far^2 - d^2) / (2 near far)
    at the far end   cos gamma = (d + (far^2 - near^2) / d) / (2 far)

The far link's direction is psi = alpha - s gamma, alpha the direction from the motor, whose bounds
are at the corners of the box. The sine at C is sin(psi_3 - psi_2), and the foot's Jacobian follows
from the sines. All is interval arithmetic, rounded outward.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.certificate.interval import (
    Interval,
    arccosine,
    cosine,
    root,
    sine,
    square,
)
from fivebar_sim.geometry import FiveBar

ROUNDING = 1e-14
"""Error of a direction that is computed from the corners of a box [rad]: forty roundings."""


class Bounds(NamedTuple):
    """What surely holds in each of n boxes, each (n,).

    Attributes:
        reach: The slack is at least that [m]; see `poses.Poses`.
        singular: The least of the three sines is at least that.
        condition: The condition number is at most that; inf where nothing is known.
    """

    reach: Array
    singular: Array
    condition: Array


class _Side(NamedTuple):
    """One side: the slack, cosine and sine at the knee, and the directions of its two links."""

    slack: Array
    cosine: Interval
    sine: Interval
    near: Interval
    far: Interval


def bounds(leg: FiveBar, low: Array, high: Array) -> Bounds:
    """Return what surely holds where the foot is in boxes.

    Args:
        leg: The leg.
        low: Least (x, z) of each box [m], hip frame, (n, 2).
        high: Greatest (x, z), (n, 2).
    """
    L5 = Interval.of(leg.L5)
    tilt = Interval.of(leg.tilt)
    E_x = L5 * cosine(tilt) * 0.5
    E_z = L5 * sine(tilt) * 0.5
    x = Interval(low[:, 0], high[:, 0])
    z = Interval(low[:, 1], high[:, 1])

    along = Interval.of(leg.L2) + Interval.of(leg.L6) * cosine(Interval.of(leg.bend))
    across = Interval.of(leg.L6) * sine(Interval.of(leg.bend))
    rho = root(square(along) + square(across)) if leg.L6 > 0.0 else Interval.of(leg.L2)
    A = _side(x + E_x, z + E_z, Interval.of(leg.L1), rho, leg.mode[0])

    psi_2 = A.far
    C = x, z
    if leg.L6 > 0.0:
        psi_2 = A.far - _direction(along, across)
        beyond = psi_2 + leg.bend
        C = x - leg.L6 * cosine(beyond), z - leg.L6 * sine(beyond)

    E = _side(C[0] - E_x, C[1] - E_z, Interval.of(leg.L4), Interval.of(leg.L3), leg.mode[1])
    at_C = sine(E.far - psi_2) * float(leg.assembly)
    least = np.minimum(np.minimum(A.sine.low, E.sine.low), at_C.low)
    within = np.minimum(A.slack, E.slack) >= 0.0
    condition = _condition(leg, A, E, at_C, rho)
    return Bounds(
        reach=np.minimum(A.slack, E.slack),
        singular=np.where(within, least, -1.0),
        condition=np.where(within & (least > 0.0), condition, np.inf),
    )


def _side(x: Interval, z: Interval, near: Interval, far: Interval, s: int) -> _Side:
    """Return one side, whose chain spans the vector (x, z) from the motor."""
    d2 = square(x) + square(z)
    d = root(d2)
    hole = (near - far).magnitude
    inner = (d - hole).low
    # A ring of equal links has no hole, and so no inner edge.
    inner = np.where(np.broadcast_to(hole.high == 0.0, inner.shape), np.inf, inner)
    slack = np.minimum(inner, (near + far - d).low)

    at_knee = ((square(near) + square(far) - d2) / (2.0 * near * far)).clipped(-1.0, 1.0)
    alpha = _seen(x, z)
    gamma = arccosine(end_cosine(d, near, far))
    beta = arccosine(end_cosine(d, far, near))
    return _Side(
        slack=slack,
        cosine=at_knee,
        sine=root(1.0 - square(at_knee)),
        near=alpha + float(s) * beta,
        far=alpha - float(s) * gamma,
    )


def end_cosine(d: Interval, near: Interval, far: Interval) -> Interval:
    """Return the cosine of the angle between the link `far` and the line to the motor.

    (d + k / d) / (2 far), k = far^2 - near^2, which is least at d = sqrt(k) where k > 0.
    """
    k = square(far) - square(near)
    ends = [(Interval.of(each) + k / Interval.of(each)) / (2.0 * far) for each in (d.low, d.high)]
    low = np.minimum(ends[0].low, ends[1].low)
    high = np.maximum(ends[0].high, ends[1].high)
    turn = root(k)
    # It lies within wherever it is not surely outside.
    inside = (k.high > 0.0) & (turn.low <= d.high) & (turn.high >= d.low)
    low = np.where(inside, np.minimum(low, (turn / far).low), low)
    return Interval(low, high).clipped(-1.0, 1.0)


def _seen(x: Interval, z: Interval) -> Interval:
    """Return the directions in which boxes are seen from the origin [rad].

    Relative to the middle of a box that does not hold the origin, the extremes are at its corners.
    """
    a = 0.5 * (x.low + x.high)
    b = 0.5 * (z.low + z.high)
    corners = []
    for corner_x in (x.low, x.high):
        for corner_z in (z.low, z.high):
            across = a * corner_z - b * corner_x
            corners.append(np.arctan2(across, a * corner_x + b * corner_z))
    middle = np.arctan2(b, a)
    low = middle + np.minimum.reduce(corners) - ROUNDING
    high = middle + np.maximum.reduce(corners) + ROUNDING
    # From within, or from as near as its corners are far apart, it is seen everywhere.
    holds = (x.low <= 0.0) & (x.high >= 0.0) & (z.low <= 0.0) & (z.high >= 0.0)
    return Interval(np.where(holds, -2.0 * np.pi, low), np.where(holds, 2.0 * np.pi, high))


def _direction(x: Interval, z: Interval) -> Interval:
    """Return the direction of one vector that is known to rounding [rad]."""
    seen = _seen(x, z)
    return Interval(np.asarray(seen.low), np.asarray(seen.high))


def _condition(leg: FiveBar, A: _Side, E: _Side, at_C: Interval, rho: Interval) -> Array:
    """Return upper bounds of the condition number, (n,).

    k + 1/k = (a^2 + b^2) / |det|, a = |d F / d theta_A|, b = |d F / d theta_E|. With L6 = 0

        a = L1 sin_B / sin_C,   b = L4 sin_D / sin_C,   k + 1/k = (q + 1/q) / sin_C,   q = a / b

    and with an extension, r = rho / L2,

        a sin_C = |L1 sin_C perp(e1) - L1 r sin(psi_3 - psi_1) perp(e_BF)|,   b sin_C = L4 r sin_D
        det sin_C = L1 L4 r sin_D sin_B
    """
    L1 = Interval.of(leg.L1)
    L4 = Interval.of(leg.L4)
    if leg.L6 == 0.0:
        # Greatest at an end of q, where the two sines are at opposite ends of their own.
        ends = []
        for B, D in ((A.sine.low, E.sine.high), (A.sine.high, E.sine.low)):
            q = (L1 * Interval.of(B)) / (L4 * Interval.of(D))
            ends.append((q + 1.0 / q).high)
        w = (Interval.of(np.maximum(*ends)) / at_C).high
    else:
        r = rho / leg.L2
        turned = sine(E.far - A.near)
        # The angle from AB to BF is pi - mu_B, and its sign is the same for both products.
        a2 = square(L1) * (
            square(at_C)
            + square(r * turned)
            - 2.0 * r * at_C * float(leg.assembly) * turned * (-A.cosine)
        )
        b2 = square(L4 * r * E.sine)
        det = L1 * L4 * r * E.sine * A.sine * at_C
        w = ((a2.clipped(0.0, np.inf) + b2) / det).high

    high = Interval.of(np.maximum(w, 2.0))
    found = ((high + root(square(high) - 4.0)) * 0.5).high
    return np.where(np.isfinite(found), found, np.inf)
