"""The firmware's elementary functions: the same operations as `firmware/fivebar_leg.c`, in NumPy.

+, -, *, / and sqrt are rounded by IEEE 754 alike on all machines; sine, cosine and arc tangent are
polynomials of those, in one order. So an array of float32 here has the very bits of the C code's
float, and one of float64 those of its double.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Bools

Real = NDArray[Any]
"""An array of float32 or of float64; all arrays of one call have the same type."""

LARGEST_ANGLE = 64.0
"""FIVEBAR_LARGEST_ANGLE: largest motor angle that is taken [rad]."""


class Numbers(NamedTuple):
    """The constants of one arithmetic.

    Attributes:
        quarter: pi / 2 in three parts; products of the first two with up to 41 are exact.
        quarters_per_radian, turns_per_radian: 2 / pi and 1 / 2 pi.
        pi, pi_rest: pi to the nearest, and what that leaves of it.
        tan_eighth: tan(pi / 8).
        sine, cosine, arc: Polynomials of scripts/firmware_polynomials.py, ascending powers.
        singular: Sine at C below which rounding decides the Jacobian.
        epsilon: Distance from 1 to the next number.
    """

    quarter: tuple[float, float, float]
    quarters_per_radian: float
    turns_per_radian: float
    pi: float
    pi_rest: float
    tan_eighth: float
    sine: tuple[float, ...]
    cosine: tuple[float, ...]
    arc: tuple[float, ...]
    singular: float
    epsilon: float


FLOAT = Numbers(
    quarter=(1.57079315, 3.17493686e-06, 2.56334407e-12),
    quarters_per_radian=0.636619747,
    turns_per_radian=0.159154937,
    pi=3.14159274,
    pi_rest=-8.74227766e-08,
    tan_eighth=0.414213568,
    sine=(-0.166666642, 0.00833274797, -0.000195878907),
    cosine=(0.0416666642, -0.00138883025, 2.45479423e-05),
    arc=(-0.333333313, 0.199995399, -0.142639562, 0.107437313, -0.0645192787),
    singular=2.0**-9,
    epsilon=2.0**-23,
)

DOUBLE = Numbers(
    quarter=(1.5707963267948912, 5.3903028581580306e-15, 8.8437205661357006e-29),
    quarters_per_radian=0.63661977236758138,
    turns_per_radian=0.15915494309189535,
    pi=3.1415926535897931,
    pi_rest=1.2246467991473532e-16,
    tan_eighth=0.41421356237309503,
    sine=(
        -0.16666666666666666,
        0.0083333333333333315,
        -0.00019841269841265065,
        2.7557319219339167e-06,
        -2.5052106232447578e-08,
        1.6058531618986147e-10,
        -7.5866971177069183e-13,
    ),
    cosine=(
        0.041666666666666664,
        -0.0013888888888888887,
        2.4801587301584645e-05,
        -2.7557319221402824e-07,
        2.0876755791080422e-09,
        -1.1470460887609959e-11,
        4.7458719020432915e-14,
    ),
    arc=(
        -0.33333333333333331,
        0.19999999999999804,
        -0.14285714285659828,
        0.11111111105155447,
        -0.090909087535008773,
        0.076922963750321427,
        -0.066664248857382549,
        0.058789289978347752,
        -0.052304542706502442,
        0.045515932206265493,
        -0.034570561981427744,
        0.016285756855221028,
    ),
    singular=2.0**-22,
    epsilon=2.0**-52,
)


def numbers(like: Real) -> Numbers:
    """Return the constants of an array's arithmetic.

    Python's floats take the type of the array that they meet, so they are rounded only once.
    """
    return FLOAT if like.dtype == np.float32 else DOUBLE


def square_root(x: Real) -> Real:
    """Return sqrt(max(x, 0)): of a difference that rounding may have left below 0."""
    return np.sqrt(np.where(x > 0.0, x, x.dtype.type(0.0)))


def reduce(x: Real, per_radian: float, quarters_each: int) -> tuple[Real, NDArray[np.int32]]:
    """Return x less whole turns or quarter turns, and how many of them.

    Args:
        x: At most `LARGEST_ANGLE` [rad].
        per_radian: Of `Numbers`.
        quarters_each: 1 for quarter turns, 4 for whole turns.
    """
    scaled = x * per_radian
    nearest = np.trunc(np.where(scaled < 0.0, scaled - 0.5, scaled + 0.5)).astype(np.int32)
    quarters = (nearest * np.int32(quarters_each)).astype(x.dtype)
    first, second, third = numbers(x).quarter
    return ((x - quarters * first) - quarters * second) - quarters * third, nearest


def within_turn(x: Real) -> Real:
    """Return x less whole turns, within half a turn of 0 [rad]."""
    return reduce(x, numbers(x).turns_per_radian, 4)[0]


def unit(angle: Real) -> Real:
    """Return (cos, sin) of angles of at most `LARGEST_ANGLE`, (...) to (..., 2)."""
    n = numbers(angle)
    r, quarters = reduce(angle, n.quarters_per_radian, 1)
    z = r * r
    sine = r + (r * z) * _horner(n.sine, z)
    cosine = (1.0 - 0.5 * z) + (z * z) * _horner(n.cosine, z)
    odd = (quarters & 1) != 0
    c = np.where(odd, sine, cosine)
    s = np.where(odd, cosine, sine)
    c = np.where((quarters + 1) & 2, -c, c)
    s = np.where(quarters & 2, -s, s)
    return np.stack([c, s], axis=-1)


def direction(z: Real, x: Real) -> Real:
    """Return the direction of (x, z) in (-pi, pi] [rad], 0 where both are zero."""
    n = numbers(x)
    wide = magnitude(x)
    high = magnitude(z)
    more = np.where(high > wide, high, wide)
    less = np.where(high > wide, wide, high)
    steep = less > n.tan_eighth * more
    nowhere = ~(more > 0.0)
    over = np.where(steep, less - more, less)
    under = np.where(steep, less + more, more)
    t = over / np.where(nowhere, x.dtype.type(1.0), under)
    t2 = t * t
    angle = t + (t * t2) * _horner(n.arc, t2)
    pi = x.dtype.type(n.pi)
    rest = x.dtype.type(n.pi_rest)
    half = x.dtype.type(0.5)
    quarter = x.dtype.type(0.25)
    angle = np.where(steep, quarter * pi + (angle + quarter * rest), angle)
    angle = np.where(high > wide, half * pi - (angle - half * rest), angle)
    angle = np.where(x < 0.0, pi - (angle - rest), angle)
    angle = np.where((z < 0.0) & (angle < pi), -angle, angle)

    return np.where(nowhere, x.dtype.type(0.0), angle)


def magnitude(x: Real) -> Real:
    """Return |x|; a zero keeps its sign, as in C."""
    return np.where(x < 0.0, -x, x)


def cross(a: Real, b: Real) -> Real:
    """Return a_x b_z - a_z b_x of vectors (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def multiply(a: Real, b: Real) -> Real:
    """Return the product of complex numbers kept as (..., 2)."""
    real = a[..., 0] * b[..., 0] - a[..., 1] * b[..., 1]
    imaginary = a[..., 0] * b[..., 1] + a[..., 1] * b[..., 0]
    return np.stack([real, imaginary], axis=-1)


def is_finite(x: Real) -> Bools:
    """Return where all of a vector (..., n) is finite, (...)."""
    return np.asarray(np.isfinite(x).all(axis=-1))


def _horner(c: tuple[float, ...], z: Real) -> Real:
    """Return c[0] + c[1] z + ... by Horner's rule, highest power first."""
    total = np.full_like(z, c[-1])
    for k in c[-2::-1]:
        total = total * z + k
    return total
