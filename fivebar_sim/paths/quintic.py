"""Smooth curves from knot to knot: one quintic a piece, with given rates at both of its ends."""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array

Knot = tuple[float, float, float, float]
"""Abscissa t, value p, rate p', second rate p''."""

APEX = -6.0
"""Second rate p'' at the top of an `arch`, in lift / half^2."""

STEEPEST = 3.0
"""Steepest end of an `arch`, in lift / half: any steeper, it would rise above its top first."""


def pieces(knots: list[Knot], t: Array) -> tuple[Array, Array, Array]:
    """Return the curve through knots, with its first and second rates.

    Between two knots, with T their distance, r = t - t0 and the mismatches of the end

        P = p1 - p0 - p0' T - p0'' T^2 / 2,   V = p1' - p0' - p0'' T,   A = p1'' - p0''
        p = p0 + p0' r + p0'' r^2 / 2 + c3 r^3 + c4 r^4 + c5 r^5
        c3 = (10 P - 4 V T + A T^2 / 2) / T^3
        c4 = (-15 P + 7 V T - A T^2) / T^4,   c5 = (6 P - 3 V T + A T^2 / 2) / T^5

    Args:
        knots: At least two knots with growing abscissas.
        t: Abscissas from the first knot on, shape (...); past the last knot the curve rests there.

    Returns:
        p, p', p'', each (...).
    """
    knot = np.array(knots)
    t0, p0, v0, a0 = knot[:-1].T
    t1, p1, v1, a1 = knot[1:].T
    T = t1 - t0
    # By how much the start alone misses the end: the three upper coefficients make up for it.
    P = p1 - p0 - v0 * T - 0.5 * a0 * T**2
    V = v1 - v0 - a0 * T
    A = a1 - a0
    c3 = (10.0 * P - 4.0 * V * T + 0.5 * A * T**2) / T**3
    c4 = (-15.0 * P + 7.0 * V * T - A * T**2) / T**4
    c5 = (6.0 * P - 3.0 * V * T + 0.5 * A * T**2) / T**5

    k = np.clip(np.searchsorted(knot[:, 0], t, side="right") - 1, 0, len(T) - 1)
    r = t - t0[k]
    v0 = v0[k]
    a0 = a0[k]
    c3 = c3[k]
    c4 = c4[k]
    c5 = c5[k]
    # Horner's rule: fewer operations than powers of r, and less rounding.
    p = p0[k] + r * (v0 + r * (0.5 * a0 + r * (c3 + r * (c4 + r * c5))))
    v = v0 + r * (a0 + r * (3.0 * c3 + r * (4.0 * c4 + r * 5.0 * c5)))
    a = a0 + r * (6.0 * c3 + r * (12.0 * c4 + r * 20.0 * c5))
    held = t >= t1[-1]

    # At rest on the last knot itself, without the rounding of the polynomial.
    return np.where(held, p1[-1], p), np.where(held, 0.0, v), np.where(held, 0.0, a)


def arch(start: float, stop: float, base: float, lift: float, fall: float = 0.0) -> list[Knot]:
    """Return the knots of a curve that rises from rest at base by lift, and comes down again.

    Its top is half way. It rises and falls without a turn in between, as p' >= 0 shows for the
    rise, with u the fraction of it and half = (stop - start) / 2:

        p - base = lift u^3 (7 - 9 u + 3 u^2),   p' = 3 lift / half u^2 (1 - u) (7 - 5 u)

    Args:
        start: Abscissa of the beginning, with p' = p'' = 0.
        stop: Abscissa of the end, with p' = -fall, p'' = 0.
        base: Value at both.
        lift: Height of the top above base.
        fall: Steepness of the end, at most STEEPEST lift / half.
    """
    half = 0.5 * (stop - start)
    return [
        (start, base, 0.0, 0.0),
        (start + half, base + lift, 0.0, APEX * lift / half**2),
        (stop, base, -fall, 0.0),
    ]
