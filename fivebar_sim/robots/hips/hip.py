"""Where a leg is fixed to the trunk, and the motors between them."""

from __future__ import annotations

import math

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.geometry import LONGEST
from fivebar_sim.robots.hips.motors import MOTORS, HipMotor, SideStep, Steering, Vector


class Hip(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where a leg is fixed to the trunk.

    Attributes:
        pos: Origin of the leg's hip frame, midway between A and E, in the trunk's frame, with all
            motors of the hip at 0 [m].
        mirrored: Whether the leg is turned by half a turn about z: its x points backward.
        side_step: The motor S between trunk and leg; None: there is none.
        steering: The motor T between trunk and leg, or S; None: there is none.
    """

    pos: Vector
    mirrored: bool = False
    side_step: SideStep | None = None
    steering: Steering | None = None

    def __post_init__(self) -> None:
        for value in self.pos:
            check_number("pos", value, "m", low=-LONGEST, high=LONGEST)

    @property
    def motors(self) -> tuple[HipMotor, ...]:
        """The motors that there are, from the trunk to the leg."""
        found = (getattr(self, motor.key) for motor in MOTORS)
        return tuple(motor for motor in found if motor is not None)

    def offset(self, motor: HipMotor) -> Vector:
        """Return what a motor carries, from its axis, with all motors at 0 [m]."""
        outward = math.copysign(1.0, self.pos[1])
        return motor.offset(outward, -1.0 if self.mirrored else 1.0)

    @property
    def axis(self) -> Vector:
        """Where the axis of the outermost motor is, in the trunk's frame [m]; `pos` without any."""
        x, y, z = self.pos
        for motor in self.motors:
            ahead, left, up = self.offset(motor)
            x = x - ahead
            y = y - left
            z = z - up
        return x, y, z
