"""How a value converges as the timestep is halved, and to what.

With v(h) = limit + c h^p, three runs at h, h / 2 and h / 4 give order and limit:

    2^p = (v(h) - v(h/2)) / (v(h/2) - v(h/4)),   limit = v(h/4) + (v(h/4) - v(h/2)) / (2^p - 1)

With more halvings the three finest runs decide. The extrapolation is Richardson's; it says nothing
about an error that all timesteps share, such as that of a contact that is too soft.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

SLOWEST = 0.5
"""Lowest order that is extrapolated: below it the limit would be far beyond all runs."""

ROUNDING = 1e-9
"""Differences below this part of a value are rounding."""


class Convergence(NamedTuple):
    """How one metric converges.

    Attributes:
        value: At the timestep h of the scenario.
        limit: Extrapolated to h = 0; None where the values do not converge.
        order: p; None where the values do not converge, or no longer change.
        error: |value - limit| / |limit|; where the values do not converge, their range as a part of
            the finest one. None where that is undefined, as of a limit that is 0.
    """

    value: float | None
    limit: float | None
    order: float | None
    error: float | None


def converge(values: Sequence[float | None], tolerance: float = 0.0) -> Convergence:
    """Return how a value converges.

    Args:
        values: At h, h / 2, h / 4, ...: at least three.
        tolerance: Values that differ by no more are settled.
    """
    numbers = [each for each in values if each is not None]
    if len(numbers) < len(values):
        # Undefined everywhere is as settled as it gets; defined here and there is not.
        return Convergence(values[0], None, None, None if numbers else 0.0)

    first = numbers[0]
    coarse, middle, finest = numbers[-3:]
    spread = max(numbers) - min(numbers)
    rounding = ROUNDING * abs(finest)
    if spread <= tolerance or abs(middle - finest) <= rounding:
        return Convergence(first, finest, None, _relative(first - finest, finest))

    ratio = (coarse - middle) / (middle - finest)
    if not ratio >= 2.0**SLOWEST:
        return Convergence(first, None, None, _relative(spread, finest))

    limit = finest + (finest - middle) / (ratio - 1.0)
    return Convergence(first, limit, math.log2(ratio), _relative(first - limit, limit))


def _relative(difference: float, of: float) -> float | None:
    """Return |difference / of|; 0 / 0 is 0, and None stands for infinity."""
    if difference == 0.0:
        return 0.0
    return abs(difference / of) if of != 0.0 else None


def holds(found: Convergence, bar: float, tolerance: float) -> bool:
    """Return whether a value is as good as its limit.

    Args:
        found: How it converges.
        bar: Largest relative error.
        tolerance: Largest absolute error, for values that are next to nothing.
    """
    if found.error is not None and found.error <= bar:
        return True
    if found.value is None or found.limit is None:
        return False
    return abs(found.value - found.limit) <= tolerance
