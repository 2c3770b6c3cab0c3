"""What the four feet of a robot do: one foot path, its phase and its stride for each leg."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.paths import FootPath
from fivebar_sim.robots.ahead import Ahead
from fivebar_sim.robots.hips.motors import HipMotor, SideStep, Steering
from fivebar_sim.robots.hips.sideways import sided
from fivebar_sim.robots.robot import LEGS, Robot

TROT = {"FL": 0.0, "FR": 0.5, "RL": 0.5, "RR": 0.0}
"""Phases of a trot: the legs of a diagonal together, the two diagonals half a period apart."""

TOGETHER: dict[str, float] = dict.fromkeys(LEGS, 0.0)
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
        sideways: What the path's x, from the middle of its range, is multiplied by to give the
            foot's way to the left, with the motor S; None: 0 for every leg.
        steering: Where each leg's motor T turns its plane, and so the foot's way, while the gait
            begins: an angle to the left [rad]; None: 0 for every leg.
    """

    path: FootPath
    phases: dict[str, float]
    strides: dict[str, float] | None = None
    sideways: dict[str, float] | None = None
    steering: dict[str, float] | None = None

    def __post_init__(self) -> None:
        _check_legs("phases", self.phases)
        _check_legs("strides", self.strides or dict.fromkeys(LEGS, 1.0))
        _check_legs("sideways", self.sideways or TOGETHER)
        _check_legs("steering", self.steering or TOGETHER, "rad", math.pi)
        if self.path.period is None and any(self.phases.values()):
            raise ArgumentError("phases must all be 0: the path does not repeat")

    @property
    def period(self) -> float:
        """Time after which every foot repeats [s]; 0 where none does."""
        return float(self.path.period or 0.0)

    def check_motors(self, robot: Robot) -> None:
        """Raise unless a robot's hips have the motors that the gait moves, and reach so far.

        Raises:
            ArgumentError: They don't; names the key.
        """
        moved: tuple[tuple[str, type[HipMotor]], ...] = (
            ("sideways", SideStep),
            ("steering", Steering),
        )
        present = [type(motor) for motor in robot.hip_motors]
        for key, kind in moved:
            if any((getattr(self, key) or TOGETHER).values()) and kind not in present:
                raise ArgumentError(
                    f"{key} needs a robot with hips.{kind.key}: its legs have no {kind.letter}"
                )

        for motor in robot.hip_motors:
            for leg, angle in (self.steering or TOGETHER).items():
                if isinstance(motor, Steering) and not abs(angle) <= motor.most:
                    raise ArgumentError(
                        f"steering.{leg} must be in [{-motor.most:g}, {motor.most:g}] rad, "
                        f"hips.steering.most, got {angle:g}"
                    )

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
        sideways = self.sideways or TOGETHER
        self.check_motors(robot)

        found: dict[str, FootPath] = {}
        for leg in LEGS:
            hip = robot.hips[leg]
            ahead = Ahead(
                ramp=self.path.ramp,
                outside=self.path.outside,
                path=self.path,
                phase=self.phases[leg],
                stride=strides[leg],
                middle=middle,
                mirrored=hip.mirrored,
            )
            found[leg] = ahead if hip.side_step is None else sided(ahead, sideways[leg], hip)
        return found


def _check_legs(key: str, values: dict[str, float], unit: str = "", most: float = 10.0) -> None:
    """Raise unless a table has a number of at most so much for each of the four legs."""
    for leg in values:
        if leg not in LEGS:
            raise ArgumentError(f"{key}: {unknown('leg', str(leg), LEGS)}")
    for leg in LEGS:
        if leg not in values:
            raise ArgumentError(f"{key}.{leg} is missing")
        check_number(f"{key}.{leg}", values[leg], unit, low=-most, high=most)
