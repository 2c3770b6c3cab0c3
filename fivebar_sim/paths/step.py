"""The foot path of one step: from rest to rest over an arch, then held."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.checks import check_number
from fivebar_sim.paths.base import FARTHEST, LONGEST, FootPath, Pair, Sample, check_pair, check_ramp
from fivebar_sim.paths.quintic import arch, pieces


class Step(FootPath, frozen=True, kw_only=True, tag="step"):
    """One step from start to stop, then a hold there; see `nominal`.

    It starts from rest by itself, so its ramp is 0 unless given.

    Attributes:
        start: (x, z) [m], at t = 0.
        stop: (x, z) [m], from t = seconds on.
        lift: Height above the straight line from start to stop, at half time [m].
        seconds: How long the step takes [s].
    """

    start: Pair
    stop: Pair
    lift: float
    seconds: float
    ramp: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pair(self, "start", "m")
        check_pair(self, "stop", "m")
        check_number("lift", self.lift, "m", low=0.0, high=FARTHEST)
        check_number("seconds", self.seconds, "s", low=0.0, high=LONGEST, strict=True)
        check_ramp(self)

    @property
    def moves(self) -> float:
        """How long the foot moves to stop: seconds [s]."""
        return self.seconds

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the step and its rates; see `FootPath.nominal`.

        The minimum-jerk line from start to stop, and for z the `arch` of lift on top of it:

            p = start + (stop - start) h(u) + (0, arch),   h = 10 u^3 - 15 u^4 + 6 u^5

        with u = t / seconds, 1 from there on. Position, velocity and acceleration are continuous,
        and velocity and acceleration are 0 at both ends.
        """
        u = np.minimum(self._times(time) / self.seconds, 1.0)
        line = pieces([(0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0)], u)
        bump = pieces(arch(0.0, 1.0, 0.0, self.lift), u)
        up = np.array([0.0, 1.0])
        span = np.array(self.stop) - np.array(self.start)
        p, dp, ddp = (
            a[..., None] * span + b[..., None] * up for a, b in zip(line, bump, strict=True)
        )
        # From the end of the step on exactly stop, whatever start + span rounds to.
        position = np.where(u[..., None] < 1.0, np.array(self.start) + p, np.array(self.stop))
        return Sample(position, dp / self.seconds, ddp / self.seconds**2)
