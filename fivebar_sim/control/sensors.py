"""The sensors of A and E: what a feedback controller is shown."""

from __future__ import annotations

import msgspec

from fivebar_sim.checks import check_number, check_step


class Sensors(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Angle and rate of each motor, delayed, noisy and quantised; by default exact.

        seen = round((theta(t - delay) + noise n) / resolution) resolution,   n ~ N(0, 1)

    Attributes:
        delay: Age of a reading [s]. Where it ends within a timestep, the reading lies on the
            straight line between the step's start and its end.
        noise: Standard deviation of the angles [rad], white from one control step to the next.
        rate_noise: Standard deviation of the rates [rad/s].
        resolution: Step of the angles [rad], such as 2 pi / 4096; 0 for exact angles. Rates are
            never quantised.
    """

    delay: float = 0.0
    noise: float = 0.0
    rate_noise: float = 0.0
    resolution: float = 0.0

    def __post_init__(self) -> None:
        check_number("delay", self.delay, "s", low=0.0, high=10.0)
        check_number("noise", self.noise, "rad", low=0.0, high=10.0)
        check_number("rate_noise", self.rate_noise, "rad/s", low=0.0, high=1e6)
        check_step("resolution", self.resolution, high=1.0)
