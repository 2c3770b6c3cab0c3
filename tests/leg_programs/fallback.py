"""The second published fault: an angle that its servo cannot reach is replaced by the other root.

The published controller takes the other root of one side alone, without looking whether the leg
can go there: the knee is then on the wrong side, and on its way there the leg passes through full
stretch. Everything else here is right.
"""

from __future__ import annotations

import math

import right
from speak import Leg, Numbers, speak

RANGES = ((-math.pi, -math.pi / 4.0), (-math.pi * 3.0 / 4.0, math.pi / 4.0))
"""What the two servos reach [rad]."""


def inverse(leg: Leg, numbers: Numbers) -> Numbers | None:
    """Return the angles of a mode; beyond its range the servo gets the other root's."""
    found = right.inverse(leg, numbers)
    if found is None:
        return None
    for side in (0, 1):
        low, high = RANGES[side]
        if not low <= found[side] <= high:
            other = list(numbers)
            other[side] = -other[side]
            found[side] = (right.inverse(leg, other) or found)[side]
    return found


if __name__ == "__main__":
    # Without an extension the two sides have nothing to do with each other.
    speak("float64", {"inverse": inverse}, plain=True)
