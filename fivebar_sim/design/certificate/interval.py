"""Interval arithmetic on arrays, rounded outward: a result surely holds what it stands for.

The four operations and the square root are exact to half a unit in the last place, so one unit is
enough to widen by; NumPy's sine, cosine, arccosine and arctangent are good to four, and get eight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fivebar_sim.arrays import Array, Bools

ULPS = 8.0
"""Units in the last place by which the results of trigonometry are widened."""

TURN = 1e-12
"""Slack with which an angle counts as one where the sine has an extreme [rad]."""


@dataclass(frozen=True, slots=True)
class Interval:
    """Intervals [low, high], arrays of one shape."""

    low: Array
    high: Array

    # NumPy's arrays leave the operators to this class.
    __array_ufunc__ = None

    @classmethod
    def of(cls, value: Any) -> Interval:
        """Return a number, or numbers, as intervals of no width."""
        if isinstance(value, Interval):
            return value
        exact = np.asarray(value, dtype=np.float64)
        return cls(exact, exact)

    def __add__(self, other: Any) -> Interval:
        o = Interval.of(other)
        return _out(self.low + o.low, self.high + o.high)

    def __sub__(self, other: Any) -> Interval:
        o = Interval.of(other)
        return _out(self.low - o.high, self.high - o.low)

    def __mul__(self, other: Any) -> Interval:
        o = Interval.of(other)
        every = np.stack(
            np.broadcast_arrays(
                self.low * o.low, self.low * o.high, self.high * o.low, self.high * o.high
            )
        )
        return _out(every.min(axis=0), every.max(axis=0))

    def __truediv__(self, other: Any) -> Interval:
        o = Interval.of(other)
        if np.any((o.low <= 0.0) & (o.high >= 0.0)):
            # Only what lies in a box that is not settled: nothing is known of it.
            lost = (o.low <= 0.0) & (o.high >= 0.0)
            one = Interval(np.where(lost, 1.0, o.low), np.where(lost, 1.0, o.high))
            whole = self / one
            return Interval(np.where(lost, -np.inf, whole.low), np.where(lost, np.inf, whole.high))
        every = np.stack(
            np.broadcast_arrays(
                self.low / o.low, self.low / o.high, self.high / o.low, self.high / o.high
            )
        )
        return _out(every.min(axis=0), every.max(axis=0))

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: Any) -> Interval:
        return Interval.of(other) - self

    def __rtruediv__(self, other: Any) -> Interval:
        return Interval.of(other) / self

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    @property
    def magnitude(self) -> Interval:
        """Absolute values."""
        high = np.maximum(np.abs(self.low), np.abs(self.high))
        inside = (self.low <= 0.0) & (self.high >= 0.0)
        return Interval(
            np.where(inside, 0.0, np.minimum(np.abs(self.low), np.abs(self.high))), high
        )

    def clipped(self, low: float, high: float) -> Interval:
        """Return the part within a range that the true value cannot leave."""
        return Interval(np.clip(self.low, low, high), np.clip(self.high, low, high))


def _out(low: Array, high: Array, units: float = 1.0) -> Interval:
    """Return an interval widened by units in the last place; NaN becomes everything."""
    low = np.nextafter(low - (units - 1.0) * np.spacing(np.abs(low)), -np.inf)
    high = np.nextafter(high + (units - 1.0) * np.spacing(np.abs(high)), np.inf)
    return Interval(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def square(x: Interval) -> Interval:
    """Return x^2."""
    m = x.magnitude
    wide = _out(m.low * m.low, m.high * m.high)
    return wide.clipped(0.0, np.inf)


def root(x: Interval) -> Interval:
    """Return the square root of x, of which nothing is below 0 but rounding."""
    low = np.sqrt(np.maximum(x.low, 0.0))
    return _out(low, np.sqrt(np.maximum(x.high, 0.0))).clipped(0.0, np.inf)


def sine(x: Interval) -> Interval:
    """Return sin x."""
    ends = np.stack(np.broadcast_arrays(np.sin(x.low), np.sin(x.high)))
    wide = _out(ends.min(axis=0), ends.max(axis=0), ULPS)
    high = np.where(_meets(x, 0.5 * np.pi), 1.0, wide.high)
    low = np.where(_meets(x, -0.5 * np.pi), -1.0, wide.low)
    return Interval(low, high).clipped(-1.0, 1.0)


def cosine(x: Interval) -> Interval:
    """Return cos x."""
    ends = np.stack(np.broadcast_arrays(np.cos(x.low), np.cos(x.high)))
    wide = _out(ends.min(axis=0), ends.max(axis=0), ULPS)
    high = np.where(_meets(x, 0.0), 1.0, wide.high)
    low = np.where(_meets(x, np.pi), -1.0, wide.low)
    return Interval(low, high).clipped(-1.0, 1.0)


def arccosine(x: Interval) -> Interval:
    """Return arccos x in [0, pi], of the part of x within [-1, 1]."""
    part = x.clipped(-1.0, 1.0)
    return _out(np.arccos(part.high), np.arccos(part.low), ULPS)


def _meets(x: Interval, angle: float) -> Bools:
    """Return whether an interval of angles has angle + 2 pi n in it, for any whole n."""
    turn = 2.0 * np.pi
    # An interval that is endless, or not known, has every angle in it.
    finite = np.isfinite(x.low) & np.isfinite(x.high)
    low = np.where(finite, x.low, 0.0)
    high = np.where(finite, x.high, 0.0)
    next_one = angle + turn * np.ceil((low - TURN - angle) / turn)
    return ~finite | (next_one <= high + TURN)
