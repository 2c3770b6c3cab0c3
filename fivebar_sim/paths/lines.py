"""The foot path along straight lines from point to point, each at constant speed, then held."""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths.base import LONGEST, FootPath, Pair, Sample, check_ramp, pair_of


class Lines(FootPath, frozen=True, kw_only=True, tag="lines"):
    """Straight lines from points[0] to the last point, then held there; see `nominal`.

    It starts at full speed: its ramp is 0 unless given.

    Attributes:
        points: (x, z) [m] of at least two points.
        seconds: How long each line takes [s]: one number for all, or one for each.
    """

    points: tuple[Pair, ...]
    seconds: float | tuple[float, ...]
    ramp: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        points = tuple(pair_of(f"points[{k}]", p, "m") for k, p in enumerate(self.points))
        if len(points) < 2:
            raise ArgumentError(f"points must be at least 2, got {len(points)}")

        seconds = self.seconds
        if isinstance(seconds, (tuple, list)):
            if len(seconds) != len(points) - 1:
                raise ArgumentError(
                    f"seconds must be one number, or {len(points) - 1} for {len(points)} points, "
                    f"got {len(seconds)}"
                )
            for k, value in enumerate(seconds):
                check_number(f"seconds[{k}]", value, "s", low=0.0, high=LONGEST, strict=True)
            msgspec.structs.force_setattr(self, "seconds", tuple(map(float, seconds)))
        else:
            check_number("seconds", seconds, "s", low=0.0, high=LONGEST, strict=True)

        msgspec.structs.force_setattr(self, "points", points)
        check_ramp(self)

    @property
    def moves(self) -> float:
        """How long the foot moves to the last point: the sum of seconds [s]."""
        return float(self._knots()[-1])

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the lines and their rates; see `FootPath.nominal`.

            p = p_k + (p_k+1 - p_k) (t - t_k) / seconds_k   for t_k <= t < t_k+1

        The velocity is constant on each line and jumps at the points, where it has the value of the
        next line; it is 0 from the last point on. The acceleration is 0: the infinite ones of the
        jumps are left out.
        """
        t = self._times(time)
        knots = self._knots()
        points = np.array(self.points)
        # Clipped, so that the last knot belongs to the last line.
        k = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
        speed = np.diff(points, axis=0) / np.diff(knots)[:, None]
        # Past the end the foot stands on the last point itself, without rounding.
        held = (t >= knots[-1])[..., None]
        position = points[k] + speed[k] * (t - knots[k])[..., None]

        return Sample(
            position=np.where(held, points[-1], position),
            velocity=np.where(held, 0.0, speed[k]),
            acceleration=np.zeros_like(position),
        )

    def _knots(self) -> Array:
        """Return the times at which the foot is at the points [s], (n,)."""
        seconds = np.broadcast_to(self.seconds, len(self.points) - 1)
        return np.concatenate([[0.0], np.cumsum(seconds)])
