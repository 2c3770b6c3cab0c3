"""The first published fault: a root of a negative number is caught, and the angle is 0.

The half-angle route, a cos t + b sin t = c, as hobby controllers have it; 0 is a legal angle, so
nobody who calls it can tell that the foot is out of reach.
"""

from __future__ import annotations

import math

from right import direction, motors
from speak import Leg, Numbers, speak


def angle(x: float, z: float, near: float, far: float, side: float) -> float:
    """Return the angle of a link to a point, 0 out of reach."""
    a = 2.0 * near * x
    b = 2.0 * near * z
    c = x * x + z * z + (near - far) * (near + far)
    square = a * a + b * b - c * c
    # The rounding at the very edge is let pass: the one fault is what comes beyond it.
    if not square > -1e-15 * (a * a + b * b):
        return 0.0
    # The two forms of the same direction, added as vectors: no division, so no 0 / 0.
    root = side * math.sqrt(max(square, 0.0))
    return direction(complex(a * c - b * root, b * c + a * root))


def inverse(leg: Leg, numbers: Numbers) -> Numbers:
    """Return both angles, each by itself."""
    s_A, s_E, x, z = numbers
    A, E = motors(leg)
    left = angle(x - A.real, z - A.imag, leg.L1, leg.L2, s_A)
    return [left, angle(x - E.real, z - E.imag, leg.L4, leg.L3, s_E)]


if __name__ == "__main__":
    speak("float64", {"inverse": inverse}, plain=True)
