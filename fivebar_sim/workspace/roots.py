"""Zeros and minima of many functions on [0, 1] at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fivebar_sim.arrays import Array

STEPS = 60
"""Most steps of `crossing`: enough to halve an interval to a float's last place."""


def crossing(f: Callable[[Array], Array], f_0: Array, f_1: Array) -> Array:
    """Return where functions that change their sign in [0, 1] are zero, by the Illinois rule.

    Args:
        f: Returns the value of each of n functions at its own place, (n,) to (n,).
        f_0: Values at 0, (n,).
        f_1: Values at 1, (n,).
    """
    a = np.zeros(len(f_0))
    b = np.ones(len(f_0))
    f_a = f_0
    f_b = f_1

    for _ in range(STEPS):
        # Regula falsi: it keeps the root between its ends, whatever the functions do.
        new = b - f_b * (b - a) / np.where(f_b == f_a, 1.0, f_b - f_a)
        f_new = f(new)
        flips = f_new * f_b < 0.0
        a = np.where(flips, b, a)
        # Halving the value of an end that stays makes it converge faster than linearly.
        f_a = np.where(flips, f_b, 0.5 * f_a)
        moved = np.abs(new - b)
        b = new
        f_b = f_new
        # A place in [0, 1] has no more digits.
        if not (moved > 1e-15).any():
            break
    return b


def lowest(f: Callable[[Array], Array], count: int) -> Array:
    """Return where in [0, 1] each of `count` functions has its one minimum: golden section."""
    golden = 0.5 * (5.0**0.5 - 1.0)
    a = np.zeros(count)
    b = np.ones(count)
    c = b - golden * (b - a)
    d = a + golden * (b - a)
    f_c = f(c)
    f_d = f(d)

    # To 4e-9 of the interval: a minimum is flat, so its value is then exact to rounding.
    for _ in range(40):
        left = f_c < f_d
        a = np.where(left, a, c)
        b = np.where(left, d, b)
        # One of the two inner places becomes the other, so that one new value is enough.
        new = np.where(left, b - golden * (b - a), a + golden * (b - a))
        f_new = f(new)
        c, d = np.where(left, new, d), np.where(left, c, new)
        f_c, f_d = np.where(left, f_new, f_d), np.where(left, f_c, f_new)

    return 0.5 * (a + b)
