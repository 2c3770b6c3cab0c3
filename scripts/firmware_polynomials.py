"""Print the polynomials of the firmware's sine, cosine and arc tangent, with their errors.

Run: python scripts/firmware_polynomials.py

With z = x^2, each is what is left of a function after its first terms:

    SINE    (sin(x) / x - 1) / z            for |x| <= pi / 4
    COSINE  (cos(x) - 1 + z / 2) / z^2      for |x| <= pi / 4
    ARC     (atan(x) / x - 1) / z           for |x| <= tan(pi / 8)

interpolated at Chebyshev's points in z, which is within a few per cent of the best polynomial of
its degree. Coefficients are of ascending powers of z, to as many digits as tell the number apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal, getcontext

import numpy as np

getcontext().prec = 60

TERMS = 60
"""Terms of the series: the last one of the arc tangent, 0.172^60, is below 1e-45."""

QUARTER = (math.pi / 4.0) ** 2
EIGHTH = math.tan(math.pi / 8.0) ** 2

Function = Callable[[Decimal], Decimal]


def sine(z: Decimal) -> Decimal:
    """Return (sin(x) / x - 1) / z."""
    return series(z, lambda k: (-1) ** (k + 1) / Decimal(math.factorial(2 * k + 3)))


def cosine(z: Decimal) -> Decimal:
    """Return (cos(x) - 1 + z / 2) / z^2."""
    return series(z, lambda k: (-1) ** k / Decimal(math.factorial(2 * k + 4)))


def arc(z: Decimal) -> Decimal:
    """Return (atan(x) / x - 1) / z."""
    return series(z, lambda k: (-1) ** (k + 1) / Decimal(2 * k + 3))


def series(z: Decimal, term: Callable[[int], Decimal]) -> Decimal:
    """Return the sum of term(k) z^k."""
    total = Decimal(0)
    for k in reversed(range(TERMS)):
        total = total * z + term(k)
    return total


def interpolate(f: Function, high: float, count: int) -> list[Decimal]:
    """Return the coefficients of the polynomial through f at Chebyshev's points of [0, high]."""
    angles = (np.arange(count) + 0.5) * np.pi / count
    points = [Decimal(0.5 * high * (1.0 - math.cos(angle))) for angle in angles]
    # Newton's divided differences, then multiplied out.
    table = [f(z) for z in points]
    for order in range(1, count):
        for k in reversed(range(order, count)):
            table[k] = (table[k] - table[k - 1]) / (points[k] - points[k - order])

    total = [Decimal(0)] * count
    for k in reversed(range(count)):
        raised = [Decimal(0), *total[:-1]]
        total = [up - points[k] * same for up, same in zip(raised, total, strict=True)]
        total[0] += table[k]
    return total


def worst(f: Function, high: float, coefficients: list[Decimal]) -> float:
    """Return the largest difference of the polynomial from f on [0, high]."""
    differences = []
    for z in np.linspace(0.0, high, 301).tolist():
        value = Decimal(0)
        for c in reversed(coefficients):
            value = value * Decimal(z) + c
        differences.append(abs(float(value - f(Decimal(z)))))
    return max(differences)


def main() -> None:
    """Print both sets."""
    for kind, digits, counts in ((np.float32, 9, (3, 3, 5)), (np.float64, 17, (7, 7, 12))):
        print(f"{kind.__name__}:")
        for name, f, high, count in zip(
            ("SINE", "COSINE", "ARC"),
            (sine, cosine, arc),
            (QUARTER, QUARTER, EIGHTH),
            counts,
            strict=True,
        ):
            # The first term that z multiplies is largest at the range's end.
            exact = interpolate(f, high, count)
            rounded = [Decimal(float(kind(float(c)))) for c in exact]
            error = worst(f, high, rounded) * high
            print(f"  {name} (error {error:.1e} of the function)")
            for c in rounded:
                print(f"    {float(c):.{digits}g}")


if __name__ == "__main__":
    main()
