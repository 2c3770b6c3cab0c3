"""Several legs as one object whose lengths are arrays, for formulas that place the joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import FiveBar, Mode

LENGTHS = ("L1", "L2", "L3", "L4", "L5", "L6", "size")
"""Attributes that each leg has of its own."""

SHARED = ("bend", "tilt", "mode", "assembly", "foot_radius")
"""Attributes that all legs have in common."""


@dataclass(frozen=True, slots=True)
class LegArrays:
    """n legs that differ in their lengths; attributes are those of `FiveBar`.

    Attributes:
        L1, L2, L3, L4, L5, L6, size: One value for each leg [m], (n, 1).
        bend, tilt, mode, assembly, foot_radius: The same for all legs.
    """

    L1: Array
    L2: Array
    L3: Array
    L4: Array
    L5: Array
    L6: Array
    size: Array
    bend: float
    tilt: float
    mode: Mode
    assembly: int
    foot_radius: float

    @classmethod
    def of(cls, legs: Sequence[FiveBar]) -> LegArrays:
        """Return the arrays of several legs.

        Raises:
            ArgumentError: The legs differ in more than lengths and masses.
        """
        first = legs[0]
        for name in SHARED:
            if any(getattr(leg, name) != getattr(first, name) for leg in legs):
                raise ArgumentError(f"legs of one group must have the same {name}")

        # Columns (n, 1) broadcast against points (n, 2).
        columns = {name: np.array([[getattr(leg, name)] for leg in legs]) for name in LENGTHS}
        shared = {name: getattr(first, name) for name in SHARED}
        return cls(**columns, **shared)
