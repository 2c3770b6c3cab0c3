"""Axes of the page's charts: round numbers on them, in the unit that people read."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array

LADDERED = {name for ladder in units.LADDERS for name in ladder}

SI = {
    "kg": (1e3, "g"),
    "m^2": (1e4, "cm2"),
    "m": (1e3, "mm"),
    "N m": (1e3, "mN m"),
    "J": (1e3, "mJ"),
}
"""Factor and unit in which people read what a leg has of these."""


class Axis(NamedTuple):
    """A quantity along a line.

    Attributes:
        label: Its name with the unit.
        scale: Factor from SI to the shown unit.
        low: Least value shown, in that unit.
        high: Greatest value shown.
        words: What stands at 0, 1, ... instead of numbers; empty for numbers.
    """

    label: str
    scale: float
    low: float
    high: float
    words: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, unit: str, values: Array, room: float = 0.06) -> Axis:
        """Return an axis for values in SI units, with some room at its ends."""
        values = values[np.isfinite(values)]
        low = float(values.min()) if len(values) else 0.0
        high = float(values.max()) if len(values) else 1.0
        scale, shown = SI.get(unit, (1.0, unit))
        if shown in LADDERED and max(abs(low), abs(high)) > 0.0:
            number, shown = units.fitting(scale * max(abs(low), abs(high)), shown)
            scale = number / max(abs(low), abs(high))
        # A single value has no span of its own.
        span = (high - low) or abs(high) or 1.0
        least = scale * (low - room * span)
        most = scale * (high + room * span)
        return cls(f"{name} [{shown}]" if shown else name, scale, least, most)

    def share(self, value: float) -> float:
        """Return where a value in SI units lies between the ends, 0 to 1."""
        return (self.scale * value - self.low) / (self.high - self.low)

    def ticks(self, most: int = 5) -> list[tuple[float, str]]:
        """Return round numbers, or the words: where each lies, 0 to 1, and its text."""
        if self.words:
            return [(self.share(float(k)), word) for k, word in enumerate(self.words)]
        raw = (self.high - self.low) / most
        power = 10.0 ** math.floor(math.log10(raw))
        step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= raw * (1.0 - 1e-9))
        digits = max(0, -math.floor(math.log10(step) + 1e-9))
        first = math.ceil(self.low / step - 1e-9)
        last = math.floor(self.high / step + 1e-9)
        numbers = [k * step for k in range(first, last + 1)]
        span = self.high - self.low
        return [((x - self.low) / span, f"{x:.{digits}f}") for x in numbers]


def amount(value: float, unit: str, digits: int = 4) -> str:
    """Return a number in SI units as people read it."""
    scale, shown = SI.get(unit, (1.0, unit))
    return units.text(scale * value, shown, digits)
