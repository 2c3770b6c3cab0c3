"""Four-bars whose coupler carries a foot, as `fivebar_nearest` of the C code follows them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Bools
from fivebar_sim.firmware.elementary import (
    Real,
    cross,
    direction,
    magnitude,
    multiply,
    numbers,
    square_root,
    unit,
)
from fivebar_sim.firmware.leg import Leg


class FourBar(NamedTuple):
    """Four-bars of points: `four_bar`, each (n) or (n, 2).

    Attributes:
        crank, coupler, rocker, base: Lengths [m]; the crank's pivot is the origin, the rocker's is
            at (base, 0).
        offset: F from the crank's end, over the coupler; complex numbers.
        point: That the nearest one is wanted for, in this frame [m].
        middle, half: Of the crank's range, and of its width [rad].
        sign: Which of the two curves, +1 or -1.
        swapped: Whether E has the crank, and the frame is turned by half a turn.
        turning: Whether the crank goes all around: a curve for each side of the rocker.
        single: Whether there is one range, about 0 or pi; else two, mirror images.
        live: Whether there is any pose.
    """

    crank: Real
    coupler: Real
    rocker: Real
    base: Real
    offset: Real
    point: Real
    middle: Real
    half: Real
    sign: Real
    swapped: Bools
    turning: Bools
    single: Bools
    live: Bools


class Place(NamedTuple):
    """Places on coupler curves: `place`.

    Attributes:
        F: The foot [m].
        along: Its velocity along the curve, to some scale.
        r: From the crank's end to the rocker's pivot [m].
        slope: Of how near it is to the point: + while it comes nearer.
    """

    F: Real
    along: Real
    r: Real
    slope: Real


def bars_of(leg: Leg, p: Real, u: Real, R: Real) -> FourBar:
    """Return the four-bars of a radius of E's reach.

    The crank is the one whose end keeps farther from the other pivot: near that the coupler would
    turn with hardly any angle of the crank.
    """
    kind = p.dtype.type
    of_A = _larger(magnitude(leg.L1 - leg.L5), magnitude(leg.L2 - R))
    of_E = _larger(magnitude(R - leg.L5), magnitude(leg.L2 - leg.L1))
    swapped = ~(of_A >= of_E)
    turned = np.stack([kind(1.0) - leg.foot[..., 0], -leg.foot[..., 1]], axis=-1)
    AP = p - leg.A
    x = u[..., 0] * AP[..., 0] + u[..., 1] * AP[..., 1]
    z = u[..., 0] * AP[..., 1] - u[..., 1] * AP[..., 0]
    x = np.where(swapped, leg.L5 - x, x)
    z = np.where(swapped, -z, z)
    nothing = np.zeros_like(R)

    bar = FourBar(
        crank=np.where(swapped, R, leg.L1),
        coupler=leg.L2,
        rocker=np.where(swapped, leg.L1, R),
        base=leg.L5,
        offset=np.where(swapped[:, None], turned, leg.foot),
        point=np.stack([x, z], axis=-1),
        middle=nothing,
        half=nothing,
        sign=nothing,
        swapped=swapped,
        turning=swapped,
        single=swapped,
        live=swapped,
    )
    return _with_range(bar)


def _larger(a: Real, b: Real) -> Real:
    return np.where(a > b, a, b)


def _with_range(bar: FourBar) -> FourBar:
    """Return four-bars with the ranges of their cranks."""
    kind = bar.base.dtype.type
    pi = kind(numbers(bar.base).pi)
    near = magnitude(bar.crank - bar.base)
    far = bar.crank + bar.base
    low = magnitude(bar.coupler - bar.rocker)
    high = bar.coupler + bar.rocker
    least = _angle_at(near, far, low)
    most = _angle_at(near, far, high)
    from_0 = low <= near
    to_pi = high >= far
    single = from_0 != to_pi
    middle = np.where(from_0, kind(0.0), pi)
    half = np.where(from_0, most, pi - least)

    return bar._replace(
        middle=np.where(single, middle, kind(0.5) * (least + most)),
        half=np.where(single, half, kind(0.5) * (most - least)),
        turning=from_0 & to_pi,
        single=single,
        live=(high >= near) & (low <= far),
    )


def _angle_at(near: Real, far: Real, distance: Real) -> Real:
    """Return the crank's angle at a distance from its end to the rocker's pivot [rad]."""
    sine = square_root((distance - near) * (distance + near))
    cosine = square_root((far - distance) * (far + distance))
    return near.dtype.type(2.0) * direction(sine, cosine)


def _crank(bar: FourBar, w: Real) -> tuple[Real, Real]:
    """Return the crank's angle [rad] and the rocker's side, -1 or +1, at w of `follow`."""
    kind = w.dtype.type
    one = kind(1.0)
    three = kind(3.0)
    half = kind(0.5)
    pi = kind(numbers(w).pi)
    wrapped = np.where(w >= 4.0, w - kind(4.0), w)
    there = wrapped < 2.0
    part = np.where(there, wrapped - one, three - wrapped)
    # Flat at both ends, where the rocker's side changes.
    swing = bar.half * (half * part * (three - part * part))
    middle = np.where(bar.single, bar.middle, bar.sign * bar.middle)
    theta = np.where(bar.turning, bar.sign * (half * pi * wrapped), middle + swing)
    return theta, np.where(bar.turning, bar.sign, np.where(there, one, -one))


def follow(bar: FourBar, w: Real) -> Place:
    """Return the places at w, 0 .. 4 once around: a turn of the crank, or there and back."""
    two = w.dtype.type(2.0)
    half = w.dtype.type(0.5)
    theta, side = _crank(bar, w)
    total = bar.coupler + bar.rocker
    gap = bar.coupler - bar.rocker

    X = bar.crank[..., None] * unit(theta)
    r = np.stack([bar.base - X[..., 0], -X[..., 1]], axis=-1)
    d2 = r[..., 0] * r[..., 0] + r[..., 1] * r[..., 1]
    root = side * square_root((total * total - d2) * (d2 - gap * gap))
    ahead = (d2 + total * gap) / (two * d2)
    across = root / (two * d2)
    # The coupler, what it carries to the foot, and the rocker from its pivot.
    V_x = ahead * r[..., 0] - across * r[..., 1]
    V_z = ahead * r[..., 1] + across * r[..., 0]
    V = np.stack([V_x, V_z], axis=-1)
    W = multiply(bar.offset, V)
    F = X + W

    # The rocker keeps its length where crank and coupler turn at these rates: never both 0 but at
    # a crossing of branches.
    by_crank = half * root
    by_coupler = cross(X, V - r)
    along_x = W[..., 1] * by_coupler - X[..., 1] * by_crank
    along_z = X[..., 0] * by_crank - W[..., 0] * by_coupler
    to_point = bar.point - F
    slope = to_point[..., 0] * along_x + to_point[..., 1] * along_z
    return Place(F, np.stack([along_x, along_z], axis=-1), r, slope)
