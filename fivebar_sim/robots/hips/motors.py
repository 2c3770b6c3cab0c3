"""The motors between trunk and leg: S swings a leg to the side, T steers it."""

from __future__ import annotations

import math
from typing import ClassVar

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.dynamics.heat import Winding
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import HEAVIEST, LONGEST

Vector = tuple[float, float, float]


class HipMotor(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One more motor of every leg, which turns the leg's plane about an axis fixed to the trunk.

    It is an ideal position servo: its torque is kp (u - theta) - kd theta_dot, without limit,
    delay or friction.

    Attributes:
        kp: Gain on the angle [N m/rad].
        kd: Gain on the rate [N m s/rad].
        mass: What turns with the leg's plane besides the leg: of the innermost motor A and E [kg].
        radius: Of the ball that stands for it: in the middle between A and E, or on the axis of the
            motor that it carries [m].
        armature: The motor's rotor inertia [kg m^2].
        across: How far outside of the axis the leg's plane is [m].
        along: How far the middle between A and E is from the axis, within the leg's plane [m].
        most: Largest angle to either side [rad].
        kt: Torque per current at the output, gear included [N m/A]; None where it is not known, and
            then no run measures the motor's heat.
        resistance: Of the winding [ohm]; goes with kt.
    """

    kp: float
    kd: float
    mass: float
    radius: float = 0.01
    armature: float = 1e-5
    across: float = 0.0
    along: float = 0.0
    most: float = math.pi / 4.0
    kt: float | None = None
    resistance: float | None = None

    key: ClassVar[str]
    """Its table in a robot's [hips]."""

    letter: ClassVar[str]
    """Of its joint, its motor and its columns."""

    does: ClassVar[str]
    """What its metrics begin with, `does_rms`, and what its body is called after."""

    axis: ClassVar[Vector]
    """Along which its angle is right-handed, in the trunk's frame."""

    widest: ClassVar[float]
    """Largest `most` [rad]."""

    def __post_init__(self) -> None:
        check_number("kp", self.kp, "N m/rad", low=0.0, high=1e6, strict=True)
        check_number("kd", self.kd, "N m s/rad", low=0.0, high=1e6)
        check_number("mass", self.mass, "kg", low=1e-6, high=HEAVIEST)
        check_number("radius", self.radius, "m", low=1e-4, high=LONGEST)
        check_number("armature", self.armature, "kg m^2", low=0.0, high=HEAVIEST)
        check_number("across", self.across, "m", low=-LONGEST, high=LONGEST)
        check_number("along", self.along, "m", low=-LONGEST, high=LONGEST)
        check_number("most", self.most, "rad", low=0.0, high=self.widest, strict=True)

        if (self.kt is None) != (self.resistance is None):
            raise ArgumentError("kt and resistance go together: one is missing")
        for name, unit in (("kt", "N m/A"), ("resistance", "ohm")):
            value = getattr(self, name)
            if value is not None:
                check_number(name, value, unit, low=0.0, high=1e6, strict=True)

    @property
    def inertia(self) -> float:
        """Moment of inertia of the ball about its middle, 2/5 m r^2 [kg m^2]."""
        return 0.4 * self.mass * self.radius**2

    @property
    def winding(self) -> Winding | None:
        """The motor's winding; None where the table does not describe it."""
        if self.kt is None or self.resistance is None:
            return None
        return Winding(self.kt, self.resistance)

    def offset(self, outward: float, forward: float) -> Vector:
        """Return what it carries, from its axis at the angle 0, in the trunk's frame [m].

        Args:
            outward: +1 of a left leg, -1 of a right one.
            forward: +1 where the leg's x points forward, -1 where it is mirrored.
        """
        raise NotImplementedError


class SideStep(HipMotor, frozen=True, kw_only=True):
    """The motor S, which turns the leg's plane about an axis along the trunk's x.

    theta_S turns from +y to +z: a positive one swings a hanging foot to the left. `along` is the
    height of the middle between A and E above the axis. See `kinematics.hip.SideStep`.
    """

    key: ClassVar[str] = "side_step"
    letter: ClassVar[str] = "S"
    does: ClassVar[str] = "side"
    axis: ClassVar[Vector] = (1.0, 0.0, 0.0)
    widest: ClassVar[float] = 0.5 * math.pi

    def offset(self, outward: float, forward: float) -> Vector:
        """Return what it carries, from its axis; see `HipMotor.offset`."""
        del forward
        return 0.0, outward * self.across, self.along


class Steering(HipMotor, frozen=True, kw_only=True):
    """The motor T, which turns the leg's plane about an axis along the trunk's z.

    theta_T turns from +x to +y: a positive one turns the leg's plane to the left. `along` is how
    far the middle between A and E is from the axis, along the leg's own x. See
    `kinematics.hip.Steering`. A leg with S too is steered with its S: T is between trunk and S.
    """

    key: ClassVar[str] = "steering"
    letter: ClassVar[str] = "T"
    does: ClassVar[str] = "steer"
    axis: ClassVar[Vector] = (0.0, 0.0, 1.0)
    widest: ClassVar[float] = math.pi

    def offset(self, outward: float, forward: float) -> Vector:
        """Return what it carries, from its axis; see `HipMotor.offset`."""
        return forward * self.along, outward * self.across, 0.0


MOTORS: tuple[type[HipMotor], ...] = (Steering, SideStep)
"""All there are, from the trunk to the leg."""


def column(quantity: str, motor: HipMotor | type[HipMotor]) -> str:
    """Return a column of a motor: of "theta", "theta_dot", "ctrl" or "torque", `theta_S`."""
    return f"{quantity}_{motor.letter}"


QUANTITIES = ("theta", "theta_dot", "ctrl", "torque")
"""Of each motor: angle [rad], rate [rad/s], command [rad] and torque [N m]."""
