"""Numbers as people read them: in the unit that fits their size, 1.17 N m and not 1.17e+03 mN m."""

from __future__ import annotations

LADDERS = (
    {"nm": 1e-9, "um": 1e-6, "mm": 1e-3, "m": 1.0, "km": 1e3},
    {"mm2": 1e-6, "cm2": 1e-4, "m2": 1.0},
    {"uN m": 1e-6, "mN m": 1e-3, "N m": 1.0, "kN m": 1e3, "MN m": 1e6, "GN m": 1e9},
    {"mN": 1e-3, "N": 1.0, "kN": 1e3, "MN": 1e6},
    {"nJ": 1e-9, "uJ": 1e-6, "mJ": 1e-3, "J": 1.0, "kJ": 1e3, "MJ": 1e6, "GJ": 1e9},
    {"uW": 1e-6, "mW": 1e-3, "W": 1.0, "kW": 1e3, "MW": 1e6},
    {"mrad/s": 1e-3, "rad/s": 1.0},
    {"us": 1e-6, "ms": 1e-3, "s": 1.0},
)
"""Units of one kind, from small to large, with their sizes in SI."""

LEAST = 0.01
"""Numbers below it go down to the next smaller unit: 0.117 um stays, 2e-5 mm becomes 0.02 um."""

MOST = 1000.0
"""Numbers from it on go up to the next larger unit."""

PLAIN = 1e9
"""Up to this number digits are written out where there is no larger unit: 120000 %."""


def fitting(number: float, unit: str, digits: int = 4) -> tuple[float, str]:
    """Return a number and its unit in the unit that fits its size.

    Args:
        number: In `unit`.
        unit: The unit to begin with; it is kept if the number reads well in it, or if it is of no
            ladder.
        digits: Significant digits that will be shown: 999.96 would be shown as 1000.
    """
    ladder = next((each for each in LADDERS if unit in each), {unit: 1.0})
    names = list(ladder)
    k = names.index(unit)
    value = number * ladder[unit]

    while abs(float(f"{number:.{digits}g}")) >= MOST and k + 1 < len(names):
        k = k + 1
        number = value / ladder[names[k]]
    while 0.0 < abs(number) < LEAST and k > 0:
        k = k - 1
        number = value / ladder[names[k]]
    return number, names[k]


def size(unit: str) -> float:
    """Return how large a unit of a ladder is in SI: 1e-3 for mW."""
    return next(ladder[unit] for ladder in LADDERS if unit in ladder)


def text(number: float, unit: str, digits: int = 4) -> str:
    """Return a number with the unit that fits its size: "1.167 N m" for 1167 mN m.

    Args:
        number: In `unit`.
        unit: The unit to begin with, "" for a pure number.
        digits: Significant digits.
    """
    fitted, name = fitting(number, unit, digits)
    shown = f"{fitted:.{digits}g}"
    if "e+" in shown and abs(fitted) < PLAIN:
        shown = f"{float(shown):.0f}"
    return f"{shown} {name}".strip()
