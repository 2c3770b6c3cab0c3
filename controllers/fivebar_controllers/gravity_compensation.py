"""Gravity compensation: the motors carry the leg, and nothing holds it in place."""

from __future__ import annotations

from typing import ClassVar

import msgspec

from fivebar_sim import dynamics
from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.interface import Drive
from fivebar_sim.control.servo import Servo
from fivebar_sim.geometry import FiveBar


class GravityCompensation(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Carry the leg's weight and the expected foot force, so that the leg floats in any pose.

        tau = bias(theta, 0) - J^T F* - kd theta_dot

    The reference's motion is ignored; only its force and payload are used.

    Attributes:
        kd: Damping of each motor [N m s/rad].
        period: Time between two commands [s].
    """

    drive: ClassVar[Drive] = "torque"

    kd: float = 0.0
    period: float = 0.001

    def __post_init__(self) -> None:
        check_number("kd", self.kd, "N m s/rad", low=0.0)
        check_number("period", self.period, "s", low=0.0, strict=True)

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the motor torques [N m], (..., 2).

        Raises:
            LoopOpenError: Where the links do not meet.
            SingularError: Where B, C and D are in line.
        """
        del servo  # the motors are driven in torque
        still = (0.0, 0.0)
        held = dynamics.inverse(leg, seen.theta, still, still, wanted.force, payload=wanted.payload)
        return held - self.kd * seen.theta_dot
