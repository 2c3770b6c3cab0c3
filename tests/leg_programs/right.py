"""A right controller: circles cut each other, points are complex numbers, numbers are double.

It is the independent check of `conformance/`: nothing of it comes from the package.
"""

from __future__ import annotations

import cmath
import math

from speak import Leg, Numbers, speak

SLACK = 2e-15
"""Rounding of a squared distance, relative to the largest square that it comes from."""


def meet(p: complex, r: float, q: complex, s: float, side: float) -> complex | None:
    """Return where the circles of radius r about p and s about q cross, left (+1) of p to q."""
    d = abs(q - p)
    if not abs(r - s) <= d * (1.0 + SLACK) + SLACK * r or not d <= (r + s) * (1.0 + SLACK):
        return None
    if d == 0.0:
        return None
    along = (d + (r - s) * (r + s) / d) / 2.0
    across = math.sqrt(max((r - along) * (r + along), 0.0))
    return p + complex(along, side * across) * (q - p) / d


def motors(leg: Leg) -> tuple[complex, complex]:
    E = cmath.rect(0.5 * leg.L5, leg.tilt)
    return -E, E


def stretch(leg: Leg) -> complex:
    """Return BF / BC."""
    return 1.0 + cmath.rect(leg.L6 / leg.L2, leg.bend)


def knee(motor: complex, near: float, end: complex, far: float, side: float) -> complex | None:
    """Return the knee of a side chain; one that ends on its motor points along x."""
    if end == motor and near == far:
        return motor + near
    return meet(motor, near, end, far, side)


def direction(v: complex) -> float:
    # A zero of either sign is no direction of its own.
    angle = math.atan2(v.imag + 0.0, v.real + 0.0)
    return math.pi if angle == -math.pi else angle


def inverse(leg: Leg, numbers: Numbers) -> Numbers | None:
    s_A, s_E, x, z = numbers
    A, E = motors(leg)
    F = complex(x, z)
    if not abs(F) < 1e9:
        return None
    B = knee(A, leg.L1, F, abs(stretch(leg)) * leg.L2, s_A)
    if B is None:
        return None
    C = F if leg.L6 == 0.0 else B + (F - B) / stretch(leg)
    D = knee(E, leg.L4, C, leg.L3, s_E)
    return None if D is None else [direction(B - A), direction(D - E)]


def knees(leg: Leg, numbers: Numbers) -> Numbers:
    _, theta_A, theta_E = numbers[:3]
    A, E = motors(leg)
    B = A + cmath.rect(leg.L1, theta_A)
    D = E + cmath.rect(leg.L4, theta_E)
    return [B.real, B.imag, D.real, D.imag]


def joints(leg: Leg, numbers: Numbers) -> tuple[complex, complex, complex] | None:
    """Return B, C and D of a closed pose."""
    places = knees(leg, numbers)
    B = complex(*places[:2])
    D = complex(*places[2:])
    C = meet(B, leg.L2, D, leg.L3, numbers[0])
    return None if C is None else (B, C, D)


def forward(leg: Leg, numbers: Numbers) -> Numbers | None:
    closed = joints(leg, numbers)
    if closed is None:
        return None
    B, C, _ = closed
    F = B + (C - B) * stretch(leg)
    return [F.real, F.imag]


def cross(a: complex, b: complex) -> float:
    return (a.conjugate() * b).imag


def slopes(leg: Leg, numbers: Numbers) -> tuple[complex, complex] | None:
    """Return dF/d theta_A and dF/d theta_E: two linear equations for dC, by Cramer's rule."""
    closed = joints(leg, numbers)
    if closed is None:
        return None
    B, C, D = closed
    A, E = motors(leg)
    u = C - B
    v = C - D
    det = cross(u, v)
    if abs(det) < 1e-6 * leg.L2 * leg.L3:
        return None

    # u . dC = u . dB and v . dC = v . dD
    found = []
    for dB, dD in ((1j * (B - A), 0j), (0j, 1j * (D - E))):
        p = (u.conjugate() * dB).real
        q = (v.conjugate() * dD).real
        dC = complex(p * v.imag - q * u.imag, q * u.real - p * v.real) / det
        found.append(dB + (dC - dB) * stretch(leg))
    return found[0], found[1]


def jacobian(leg: Leg, numbers: Numbers) -> Numbers | None:
    both = slopes(leg, numbers)
    if both is None:
        return None
    of_A, of_E = both
    return [of_A.real, of_E.real, of_A.imag, of_E.imag]


def torque(leg: Leg, numbers: Numbers) -> Numbers | None:
    """Return what holds a force at rest: no virtual work is done."""
    both = slopes(leg, numbers)
    force = complex(*numbers[3:])
    return None if both is None else [-(slope.conjugate() * force).real for slope in both]


SOLVERS = {
    "inverse": inverse,
    "forward": forward,
    "knees": knees,
    "jacobian": jacobian,
    "torque": torque,
}

if __name__ == "__main__":
    speak("float64", SOLVERS)
