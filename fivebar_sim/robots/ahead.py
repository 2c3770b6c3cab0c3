"""The foot path of one leg of a gait, in the leg's plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.paths import FootPath, Sample


class Led(FootPath, frozen=True):
    """A path that another one leads: it repeats, ends and comes to rest with that one.

    Attributes:
        path: The other path.
    """

    path: FootPath

    @property
    def period(self) -> float | None:
        """Time after which the path repeats [s]; None where it does not."""
        return self.path.period

    @property
    def span(self) -> float:
        """How long the path is defined [s]."""
        return self.path.span

    @property
    def moves(self) -> float:
        """How long the foot moves [s]."""
        return self.path.moves


class Ahead(Led, frozen=True, tag="ahead"):
    """The path of one leg of a gait: another path, some part of its period ahead.

        x(t) = +-(m + stride (x_path(t + phase T) - m)),   z(t) = z_path(t + phase T)

    Attributes:
        path: The gait's path.
        phase: Parts of its period T that the leg is ahead.
        stride: What its x is multiplied by, about `middle`.
        middle: m, the middle of the path's x [m].
        mirrored: Whether x of the leg's hip frame points backward: then all of x is negative.
    """

    phase: float
    stride: float
    middle: float
    mirrored: bool

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the other path at a later time, its x scaled; see `FootPath.nominal`."""
        p = self.path.nominal(self.times(time))
        sign = -1.0 if self.mirrored else 1.0
        scale = np.array([sign * self.stride, 1.0])
        offset = np.array([sign * (1.0 - self.stride) * self.middle, 0.0])
        return Sample(scale * p.position + offset, scale * p.velocity, scale * p.acceleration)

    def times(self, time: ArrayLike) -> Array:
        """Return the times of the gait's path at which this one is at its own times [s], (...)."""
        period = self.path.period or 0.0
        return self._times(time) + self.phase % 1.0 * period
