"""What a walking robot shall learn: to go as fast as it is told, and to turn as fast."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.step import check_whole_steps
from fivebar_sim.errors import ArgumentError
from fivebar_sim.robots import Floor, Robot
from fivebar_sim.robots.measure import Trunk, measure
from fivebar_sim.walking.draws import Ranges

FASTEST = 1e3
"""Of any command [m/s, rad/s]."""

NEAR = 0.25
"""Part of the largest command off which its reward has fallen to 1/e."""

Range = tuple[float, float]


class WalkTask(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The task: its robot, its commands, its actions and what it rewards.

        reward = exp(-((v - v*) / (NEAR V))^2) + turning exp(-((w - w*) / (NEAR W))^2) - effort e

    v is the speed along the heading and w the turning rate over a control period, V and W the
    largest |v*| and |w*| of their ranges; e is the mean square of the torque that each motor gave,
    as a part of kp times span squared.

    Attributes:
        robot: The robot; a control period's commands reach its servos as their bus has it.
        speed: Ends of the speeds that are commanded [m/s].
        turn: Ends of the turning rates that are commanded [rad/s].
        span: Farthest that an action moves a motor from its standing angle [rad].
        friction: Coulomb's coefficient between feet and floor.
        slope: Angle by which the floor rises where the robot faces at the start [rad].
        sensors: What the motors' sensors show.
        gyro_noise: Standard deviation of the gyroscope's noise [rad/s].
        down_noise: The same of each component of the direction of down.
        randomise: Friction, mass and delay are drawn anew for every episode; None: they are not.
        turning: Weight of turning.
        effort: Weight of the effort.
        period: Time between two actions [s].
        duration: Length of an episode [s].
        timestep: [s].
    """

    robot: Robot
    speed: Range = (0.0, 0.3)
    turn: Range = (-1.0, 1.0)
    span: float = 0.5
    friction: float = 0.8
    slope: float = 0.0
    sensors: Sensors = Sensors()
    gyro_noise: float = 0.0
    down_noise: float = 0.0
    randomise: Ranges | None = None
    turning: float = 0.5
    effort: float = 0.1
    period: float = 0.02
    duration: float = 5.0
    timestep: float = 0.001

    def __post_init__(self) -> None:
        for motor in self.robot.hip_motors:
            raise ArgumentError(f"robot must have eight motors: hips.{motor.key} is not known here")
        for name in ("speed", "turn"):
            low, high = _pair(name, getattr(self, name))
            check_number(f"{name}[0]", low, "", low=-FASTEST, high=FASTEST)
            check_number(f"{name}[1]", high, "", low=float(low), high=FASTEST)
        check_number("span", self.span, "rad", low=0.0, high=math.pi, strict=True)
        Floor(friction=self.friction, slope=self.slope)  # for its checks
        check_number("gyro_noise", self.gyro_noise, "rad/s", low=0.0)
        check_number("down_noise", self.down_noise, "", low=0.0)
        check_number("turning", self.turning, "", low=0.0)
        check_number("effort", self.effort, "", low=0.0)
        check_whole_steps("period", self.period, self.timestep)
        check_whole_steps("duration", self.duration, self.period)

    @property
    def every(self) -> int:
        """Timesteps of a control period."""
        return round(self.period / self.timestep)

    @property
    def periods(self) -> int:
        """Actions of an episode."""
        return round(self.duration / self.period)

    def terms(self, wanted: Array, moved: Moved, torque: Array) -> dict[str, float]:
        """Return the terms of the reward, weighted.

        Args:
            wanted: Speed [m/s] and turning rate [rad/s] that are commanded, (2,).
            moved: How the trunk moved.
            torque: Of each motor in each step [N m], (n, 8).
        """
        largest = self.robot.servo.kp * self.span
        return {
            "speed": _near(moved.speed - wanted[0], self.speed),
            "turn": self.turning * _near(moved.turn_rate - wanted[1], self.turn),
            "effort": -self.effort * float(np.mean((torque / largest) ** 2)),
        }


class Moved(NamedTuple):
    """How the trunk moved over a control period: speed [m/s] and turning rate [rad/s]."""

    speed: float
    turn_rate: float

    @classmethod
    def of(cls, trunk: Trunk, length: float) -> Moved:
        """Return it of the trunk before the period and after each step of it."""
        gone = measure(trunk, slice(None), length, 0)
        return cls(gone.speed, gone.turn_rate)


def _near(off: float, ends: Range) -> float:
    """Return 1 for no error, 1/e for `NEAR` of the largest command; of no command, 1 at rest."""
    largest = max(abs(end) for end in ends)
    return math.exp(-((off / (NEAR * largest)) ** 2)) if largest > 0.0 else float(off == 0.0)


def _pair(name: str, value: object) -> tuple[float, float]:
    """Return two numbers, which check_number has still to look at."""
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise ArgumentError(f"{name} must be two numbers (low, high), got {value!r}")
    low, high = value
    return low, high
