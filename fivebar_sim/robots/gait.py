"""What the four feet of a robot do: one foot path, its phase and its stride for each leg."""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.paths import FootPath, Sample
from fivebar_sim.robots.robot import LEGS, Robot

TROT = {"FL": 0.0, "FR": 0.5, "RL": 0.5, "RR": 0.0}
"""Phases of a trot: the legs of a diagonal together, the two diagonals half a period apart."""

TOGETHER = dict.fromkeys(LEGS, 0.0)
"""Phases of legs that all do the same at the same time."""

PHASES = {
    "together": TOGETHER,
    "trot": TROT,
    "bound": {"FL": 0.0, "FR": 0.0, "RL": 0.5, "RR": 0.5},
    "pace": {"FL": 0.0, "FR": 0.5, "RL": 0.0, "RR": 0.5},
}
"""Gaits that have a name, by their phases."""

SAMPLES = 1000
"""Points of a period among which the middle of a stride is looked for."""


LONGEST = 1e3
"""Of a path that goes on for ever without repeating, so much is looked at [s]."""


class Gait(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A foot path for each leg, at its own phase if it repeats.

    Strides differ to turn: with those of one side negative the robot turns on the spot.

    Attributes:
        path: The path of a foot in its hip frame, as if the leg were not mirrored.
        phases: By what part of a period each leg is ahead of the path.
        strides: What the path's x is multiplied by for each leg, about the middle of its range;
            None: 1 for every leg.
    """

    path: FootPath
    phases: dict[str, float]
    strides: dict[str, float] | None = None

    def __post_init__(self) -> None:
        _check_legs("phases", self.phases)
        _check_legs("strides", self.strides or dict.fromkeys(LEGS, 1.0))
        if self.path.period is None and any(self.phases.values()):
            raise ArgumentError("phases must all be 0: the path does not repeat")

    @property
    def period(self) -> float:
        """Time after which every foot repeats [s]; 0 where none does."""
        return float(self.path.period or 0.0)

    def paths(self, robot: Robot) -> dict[str, FootPath]:
        """Return the path of each foot in its own hip frame.

        Each starts from rest within the ramp of the gait's path, where the leg's phase begins.
        """
        # Past the ramp the path is what it is for good, at its own time.
        seconds = self.period or min(self.path.moves, self.path.span, LONGEST)
        time = np.linspace(0.0, seconds, SAMPLES)
        x = self.path.nominal(time).position[:, 0]
        middle = 0.5 * float(x.min() + x.max())

        strides = self.strides or dict.fromkeys(LEGS, 1.0)
        return {
            leg: Ahead(
                ramp=self.path.ramp,
                outside=self.path.outside,
                path=self.path,
                phase=self.phases[leg],
                stride=strides[leg],
                middle=middle,
                mirrored=robot.hips[leg].mirrored,
            )
            for leg in LEGS
        }


class Ahead(FootPath, frozen=True, tag="ahead"):
    """The path of one leg of a gait: another path, some part of its period ahead.

        x(t) = +-(m + stride (x_path(t + phase T) - m)),   z(t) = z_path(t + phase T)

    Attributes:
        path: The gait's path.
        phase: Parts of its period T that the leg is ahead.
        stride: What its x is multiplied by, about `middle`.
        middle: m, the middle of the path's x [m].
        mirrored: Whether x of the leg's hip frame points backward: then all of x is negative.
    """

    path: FootPath
    phase: float
    stride: float
    middle: float
    mirrored: bool

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

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the other path at a later time, its x scaled; see `FootPath.nominal`."""
        period = self.path.period or 0.0
        p = self.path.nominal(self._times(time) + self.phase % 1.0 * period)
        sign = -1.0 if self.mirrored else 1.0
        scale = np.array([sign * self.stride, 1.0])
        offset = np.array([sign * (1.0 - self.stride) * self.middle, 0.0])
        return Sample(scale * p.position + offset, scale * p.velocity, scale * p.acceleration)


def _check_legs(key: str, values: dict[str, float]) -> None:
    """Raise unless a table has a number for each of the four legs."""
    for leg in values:
        if leg not in LEGS:
            raise ArgumentError(f"{key}: {unknown('leg', str(leg), LEGS)}")
    for leg in LEGS:
        if leg not in values:
            raise ArgumentError(f"{key}.{leg} is missing")
        check_number(f"{key}.{leg}", values[leg], "", low=-10.0, high=10.0)
