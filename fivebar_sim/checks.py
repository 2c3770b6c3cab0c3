"""Checks of single numbers. Every message has the same form: key, legal range, unit, value."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

from fivebar_sim.errors import ArgumentError, FiveBarError

LARGEST = sys.float_info.max
"""Largest finite float."""


def is_finite(value: Any) -> bool:
    """Return whether value is a real number that a float can hold; bools are rejected."""
    # bool is a subclass of int.
    if not isinstance(value, (int, float, np.number)) or isinstance(value, bool):
        return False
    # A comparison is False for NaN, and works for integers that no float can hold.
    return bool(-LARGEST <= value <= LARGEST)


def check_number(
    key: str,
    value: Any,
    unit: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    strict: bool = False,
    error: type[FiveBarError] = ArgumentError,
) -> None:
    """Raise unless value is a finite number in [low, high], or in (low, high) if strict.

    Args:
        key: Name of the number; the message starts with it.
        value: The number.
        unit: Unit of the range in the message; "" for a pure number.
        low: Least legal value.
        high: Greatest legal value.
        strict: Whether the ends are excluded.
        error: Class of the error to raise.

    Raises:
        ArgumentError: The number is out of range; `error` may name another class.
    """
    if is_finite(value) and (low < value < high if strict else low <= value <= high):
        return
    # An infinite end is written as open: inf itself is never legal.
    left = "(" if strict or math.isinf(low) else "["
    right = ")" if strict or math.isinf(high) else "]"
    legal = f"{left}{low:g}, {high:g}{right} {unit}".rstrip()
    raise error(f"{key} must be in {legal}, got {value!r}")


FINEST = 1e-12
"""Finest step of angles [rad]: a float near one turn resolves hardly more."""


def check_step(key: str, value: Any, *, high: float = math.inf) -> None:
    """Raise unless value is a step to round angles to [rad]; 0 means no rounding.

    Raises:
        ArgumentError: The step is not in [0, high], or finer than `FINEST`: angle / step would
            overflow.
    """
    check_number(key, value, "rad", low=0.0, high=high)
    if 0.0 < value < FINEST:
        raise ArgumentError(f"{key} must be 0 or at least {FINEST:g} rad, got {value!r}")
