"""The foot path of simple robots: straight back and straight forward, up and down by half sines."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.paths.base import FARTHEST, Cyclic, Pair, Sample, check_pair


class Sine(Cyclic, frozen=True, tag="sine"):
    """A stance and a lift of constant speed along x, each with a half sine along z.

    With push = 0 it is the Q8bot's: sine lift and straight return. With both it is the Doggo's
    double sine. It starts in the middle of the stance. Its velocity jumps where lift and stance
    meet: the servos, not the path, turn the foot round.

    Attributes:
        centre: (x, z) of the middle of the stance line [m].
        stride: Length of the stance line [m]. Negative walks towards -x.
        lift: Height of the lift's half sine [m].
        push: Depth of the stance's half sine below the line [m].
        duty: Part of a period that is stance, in (0, 1).
    """

    centre: Pair
    stride: float
    lift: float
    push: float = 0.0
    duty: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pair(self, "centre", "m")
        check_number("stride", self.stride, "m", low=-FARTHEST, high=FARTHEST)
        check_number("lift", self.lift, "m", low=0.0, high=FARTHEST)
        check_number("push", self.push, "m", low=0.0, high=FARTHEST)
        check_number("duty", self.duty, "", low=0.0, high=1.0, strict=True)

    @property
    def stance_speed(self) -> float:
        """Speed of the foot towards -x in stance, stride frequency / duty [m/s]."""
        return self.stride * self.frequency / self.duty

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the path and its rates; see `FootPath.nominal`.

        With c the part of a period since the stance began, and u the part of the stance, c / duty,
        or of the lift, (c - duty) / (1 - duty), that is over:

            stance   x = cx + stride (1/2 - u),   z = cz - push sin(pi u)
            lift     x = cx - stride (1/2 - u),   z = cz + lift sin(pi u)

        Where they meet, the rates are those of what begins.
        """
        cycle = np.mod(self._times(time) * self.frequency + 0.5 * self.duty, 1.0)
        stands = cycle < self.duty
        span = np.where(stands, self.duty, 1.0 - self.duty)
        u = np.where(stands, cycle, cycle - self.duty) / span
        rate = self.frequency / span
        forward = np.where(stands, -self.stride, self.stride)
        height = np.where(stands, -self.push, self.lift)

        cx, cz = self.centre
        turn = np.pi * u
        speed = np.pi * rate
        x: Array = cx + forward * (u - 0.5)
        z: Array = cz + height * np.sin(turn)
        return Sample(
            position=np.stack([x, z], axis=-1),
            velocity=np.stack([forward * rate, height * speed * np.cos(turn)], axis=-1),
            acceleration=np.stack([np.zeros_like(x), -height * speed**2 * np.sin(turn)], axis=-1),
        )
