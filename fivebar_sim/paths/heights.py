"""The foot path of a jump: the foot straight below a point, at one height after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths.base import FARTHEST, LONGEST, FootPath, Sample


class Heights(FootPath, frozen=True, kw_only=True, tag="heights"):
    """Heights that the foot's target jumps to, each held for its time; the last one for ever.

    It is what a robot's firmware sends that jumps: crouch, stretch, tuck. The target has no rates,
    not even where it jumps: how fast the foot follows is for the controller's gains to say, which
    may change at the same times (`pd`).

    Attributes:
        x: Where the foot is [m], hip frame.
        heights: Of the hip above the foot [m]: the foot is at z = -height.
        seconds: How long each height but the last is held [s].
    """

    x: float = 0.0
    heights: tuple[float, ...]
    seconds: tuple[float, ...]
    ramp: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("x", self.x, "m", low=-FARTHEST, high=FARTHEST)
        if len(self.heights) < 2 or len(self.seconds) != len(self.heights) - 1:
            raise ArgumentError(
                "heights must be two or more, and seconds one fewer: the last height is held for "
                f"ever; got {len(self.heights)} heights and {len(self.seconds)} seconds"
            )
        for height in self.heights:
            check_number("heights", height, "m", low=-FARTHEST, high=FARTHEST)
        for seconds in self.seconds:
            check_number("seconds", seconds, "s", low=0.0, high=LONGEST, strict=True)

    @property
    def moves(self) -> float:
        """Time at which the target jumps to the last height [s]."""
        return float(sum(self.seconds))

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the height of each time, without rates; see `FootPath.nominal`."""
        t = self._times(time)
        z: Array = -np.array(self.heights)[part_of(self.seconds, t)]
        still = np.zeros((*t.shape, 2))
        return Sample(np.stack([np.full_like(z, self.x), z], axis=-1), still, still)


def part_of(seconds: tuple[float, ...], time: ArrayLike) -> NDArray[np.intp]:
    """Return in which of some parts of a run each time is, counted from 0.

    A part begins at its own first moment, give or take the rounding of a sum of timesteps.

    Args:
        seconds: How long each part but the last takes [s].
        time: [s].
    """
    t = np.asarray(time)
    return np.searchsorted(np.cumsum(seconds), t * (1.0 + 1e-12), side="right")
