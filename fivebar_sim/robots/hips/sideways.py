"""A foot path to the side: the path in the leg's own plane, and how the motor S turns the plane.

A motor T turns all of it: the side is to the left of where the leg is steered.

With the foot at (y, z) from the axis of S, across its x, and the leg's plane `a` beside the axis,

    u = -sqrt(y^2 + z^2 - a^2),   z_leg = u - along,   theta_S = atan2(z, y) - atan2(u, a)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths import Sample
from fivebar_sim.paths.base import ease, times
from fivebar_sim.robots.ahead import Ahead, Led
from fivebar_sim.robots.hips.hip import Hip


class Across(NamedTuple):
    """The foot from the axis of S, across it [m], and its rates [m/s], [m/s^2], each (..., 2)."""

    place: Array
    rate: Array
    change: Array


class Sideways(Led, frozen=True, tag="sideways"):
    """The path of a leg's foot within its plane, which S turns as the foot goes to the side.

    Attributes:
        path: The path of a foot that goes straight.
        sideways: What the gait's x, from its middle, is multiplied by for the way to the left.
        across: a: y of the leg's plane from the axis of S [m].
        along: z of the hip frame's origin from the axis [m].
    """

    path: Ahead
    sideways: float
    across: float
    along: float

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the foot in the leg's own plane; see `FootPath.nominal`."""
        straight = self.path.nominal(time)
        at = self._across(time)
        u = self._stretched(at)
        # Of u^2 = y^2 + z^2 - a^2, once and twice by time.
        rate = np.sum(at.place * at.rate, axis=-1) / u
        change = (np.sum(at.rate**2 + at.place * at.change, axis=-1) - rate**2) / u

        height = Sample(u - self.along, rate, change)
        both = [
            np.stack([part[..., 0], own], axis=-1)
            for part, own in zip(straight, height, strict=True)
        ]
        return Sample(*both)

    def swing(self, time: ArrayLike) -> Array:
        """Return theta_S at times of the run, with the ramp [rad], (...)."""
        own, _, _ = ease(times(time, self.end), self.ramp)
        at = self._across(own)
        u = self._stretched(at)
        return np.arctan2(at.place[..., 1], at.place[..., 0]) - np.arctan2(u, self.across)

    def _across(self, time: ArrayLike) -> Across:
        """Return where the foot is across the axis of S, at the path's own time."""
        path = self.path
        gait = path.path.nominal(path.times(time))
        offset = np.array([self.across, self.along])
        middle = np.array([self.sideways * path.middle, 0.0])
        scale = np.array([self.sideways, 1.0])
        place = offset + scale * gait.position - middle
        return Across(place, scale * gait.velocity, scale * gait.acceleration)

    def _stretched(self, at: Across) -> Array:
        """Return u [m].

        Raises:
            ArgumentError: The foot comes too near to the axis.
        """
        square = np.sum(at.place**2, axis=-1) - self.across**2
        if not np.all(square > 0.0):
            raise ArgumentError(
                f"the foot must stay more than {abs(self.across):g} m from the axis of S"
            )
        return -np.sqrt(square)


def sided(path: Ahead, sideways: float, hip: Hip) -> Sideways:
    """Return the path of a leg whose hip has a motor S.

    Args:
        path: The path of a foot that goes straight.
        sideways: What the gait's x, from its middle, is multiplied by for the way to the left.
        hip: The hip.
    """
    assert hip.side_step is not None
    _, across, along = hip.offset(hip.side_step)
    return Sideways(
        ramp=path.ramp,
        outside=path.outside,
        path=path,
        sideways=sideways,
        across=across,
        along=along,
    )
