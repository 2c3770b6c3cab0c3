"""The points of a sweep: every combination of the values, or a Sobol sample of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import msgspec
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, ExtraError
from fivebar_sim.sweep.axes import Axis, parse

MOST = 100_000_000
"""Most points of a sweep."""

MOST_SAMPLED = 1_000_000
"""Most points of a sample, which is drawn as a whole."""


class Points(msgspec.Struct, frozen=True, dict=True):
    """The points of a sweep.

    Attributes:
        axes: What is varied. In a grid the last one changes fastest.
        sample: Number of points of a sample; None is the grid of all combinations.
        seed: Shifts the sample.
    """

    axes: tuple[Axis, ...]
    sample: int | None = None
    seed: int = 0

    @property
    def keys(self) -> list[str]:
        """Every key that is varied."""
        return [key for axis in self.axes for key in axis.keys]

    @property
    def count(self) -> int:
        """The number of points."""
        return self.sample or math.prod(len(axis.values) for axis in self.axes)

    def at(self, number: int) -> list[Any]:
        """Return the value of each axis at a point."""
        if self.sample is not None:
            parts = self._sobol[number].tolist()
            return [axis.at(part) for axis, part in zip(self.axes, parts, strict=True)]

        values: list[Any] = []
        for axis in reversed(self.axes):
            number, k = divmod(number, len(axis.values))
            values.append(axis.values[k])
        return values[::-1]

    @cached_property
    def _sobol(self) -> Array:
        """Where the points of a sample lie, in [0, 1), (sample, axes)."""
        # Slow to import, and only samples need it.
        try:
            from scipy.stats import qmc
        except ImportError as error:
            raise ExtraError(
                f"a sample needs SciPy ({error}): pip install 'fivebar-sim[precise]'"
            ) from None

        assert self.sample is not None
        size = max(1, math.ceil(math.log2(self.sample)))
        plain = qmc.Sobol(len(self.axes), scramble=False).random_base2(size)[: self.sample]
        # The plain sequence begins in a corner; shifted round, it is as even, and never the same.
        shift = np.random.default_rng(self.seed).random(len(self.axes))
        return (plain + shift) % 1.0


def points(vary: Sequence[str], sample: int | None = None, seed: int = 0) -> Points:
    """Return the points of a sweep.

    Args:
        vary: What is varied, each as `axes.parse` reads it.
        sample: Number of points of a sample; None is the grid.
        seed: Shifts the sample.

    Raises:
        ConfigError: Nothing is varied, a key is varied twice, or there are too many points.
    """
    if sample is not None and not 1 <= sample <= MOST_SAMPLED:
        raise ConfigError(f"--sample must be in [1, {MOST_SAMPLED}], got {sample}")
    if not 0 <= seed < 2**63:
        raise ConfigError(f"--seed must be in [0, 2^63), got {seed}")
    if not vary:
        raise ConfigError("a sweep varies at least one key: --vary leg.L2=0.05:0.08:31")

    found = Points(tuple(parse(text, sampled=sample is not None) for text in vary), sample, seed)
    keys = found.keys
    for key in keys:
        if keys.count(key) > 1:
            raise ConfigError(f"--vary {key}: a key is varied twice")
        within = [other for other in keys if other.startswith(f"{key}.")]
        if within and keys.index(within[0]) < keys.index(key):
            raise ConfigError(f"--vary {key} would undo --vary {within[0]}: give {key} first")
    if found.count > MOST:
        raise ConfigError(f"a sweep has at most {MOST:,} points, got {found.count:,}")
    return found
