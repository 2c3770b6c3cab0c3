"""White sensor noise, each leg with a seed of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array

DRAWN = 64
"""Control steps of noise to draw in one call; the numbers are the same as drawn one by one."""


class Noise:
    """Standard normal numbers for the angles and rates of several legs.

    A leg's numbers depend on its seed alone, not on the legs beside it.

    Args:
        nsim: Number of legs.
    """

    def __init__(self, nsim: int) -> None:
        # Placeholders: `restart` gives every leg its own generator.
        self._random = [np.random.default_rng(0)] * nsim
        self._drawn = np.empty((nsim, DRAWN, 2, 2))
        self._used = np.full(nsim, DRAWN)
        self._legs = np.arange(nsim)

    def restart(self, rows: NDArray[np.int64], seeds: Sequence[int]) -> None:
        """Start the numbers of some legs afresh, each from its seed."""
        for row, seed in zip(rows.tolist(), seeds, strict=True):
            self._random[row] = np.random.default_rng(seed)
        # As if used up, so that the next draw takes them from the new generator.
        self._used[rows] = DRAWN

    def draw(self, rows: NDArray[np.int64] | None = None) -> Array:
        """Return the next numbers of each leg, (nsim, 2, 2): angles of A and E, then rates.

        Args:
            rows: Only these legs draw, and the others' numbers are 0; None: all of them.
        """
        legs = self._legs if rows is None else rows
        for row in legs[self._used[legs] == DRAWN].tolist():
            self._drawn[row] = self._random[row].standard_normal((DRAWN, 2, 2))
            self._used[row] = 0

        drawn = self._drawn[legs, self._used[legs]]
        self._used[legs] += 1
        if rows is None:
            return drawn
        every = np.zeros((len(self._legs), 2, 2))
        every[rows] = drawn
        return every
