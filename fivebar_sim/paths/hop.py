"""The foot path of a leg that hops on the spot: thrust, flight, landing and crouch."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.checks import check_number
from fivebar_sim.paths.base import FARTHEST, Cyclic, Sample
from fivebar_sim.paths.quintic import arch, pieces


class Hop(Cyclic, frozen=True, kw_only=True, tag="hop"):
    """Periodic push-off straight down, starting in the crouch; see `nominal`.

    With h = -z the length of the leg, a body that rides on it leaves the ground where the leg, at
    the end of the thrust, brakes by more than gravity, h'' < -g: that is, if `braking` > g. It
    flies as high as the greatest h + h'^2 / 2g of the thrust, whatever its mass, if the motors
    follow. After landing it stays on the ground through the crouch if `braking`, with the crouch's
    part 1 - thrust - flight of a period in place of thrust, is less than g.

    It starts from rest by itself, so its ramp is 0 unless given.

    Attributes:
        x: Where the foot stands [m], hip frame.
        low: Height of the hip above the foot in the crouch [m]: the foot is at z = -low.
        high: The same at the end of the thrust [m].
        thrust: Part of a period in which the leg extends from low to high.
        flight: Part of a period after it in which the foot waits for the ground.
        tuck: How far the foot is drawn up half way through the flight [m].
    """

    needs_ground: ClassVar[bool] = True

    x: float = 0.0
    low: float
    high: float
    thrust: float
    flight: float
    tuck: float = 0.0
    ramp: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("x", self.x, "m", low=-FARTHEST, high=FARTHEST)
        # In this order: the range of each number depends on the one before.
        check_number("high", self.high, "m", low=0.0, high=FARTHEST, strict=True)
        check_number("low", self.low, "m", low=0.0, high=self.high, strict=True)
        check_number("thrust", self.thrust, "", low=0.0, high=1.0, strict=True)
        check_number("flight", self.flight, "", low=0.0, high=1.0 - self.thrust, strict=True)
        check_number("tuck", self.tuck, "m", low=0.0, high=self.high - self.low)

    @property
    def braking(self) -> float:
        """Greatest deceleration in the thrust, 10/sqrt(3) (high - low) / duration^2 [m/s^2]."""
        duration = self.thrust / self.frequency
        return 10.0 / math.sqrt(3.0) * (self.high - self.low) / duration**2

    def nominal(self, time: ArrayLike) -> Sample:
        """Return x and the four pieces of z with their rates; see `FootPath.nominal`.

            thrust    -low to -high      for thrust / frequency [s]
            flight    -high, or the `arch` of tuck above it, for flight / frequency
            crouch    -high to -low      for the rest of the period

        Each piece is a quintic between rests (p' = p'' = 0 at both its ends), the minimum-jerk
        move; position, velocity and acceleration are continuous. The first period begins at -low.
        """
        cycle = np.mod(self._times(time) * self.frequency, 1.0)
        knots = [
            (0.0, -self.low, 0.0, 0.0),
            *arch(self.thrust, self.thrust + self.flight, -self.high, self.tuck),
            (1.0, -self.low, 0.0, 0.0),
        ]
        z, dz, ddz = pieces(knots, cycle)

        return Sample(
            position=np.stack([np.full_like(z, self.x), z], axis=-1),
            velocity=self.frequency * np.stack([np.zeros_like(z), dz], axis=-1),
            acceleration=self.frequency**2 * np.stack([np.zeros_like(z), ddz], axis=-1),
        )
