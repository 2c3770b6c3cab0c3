"""Computed torque: the closed chain's inverse dynamics around a PD law of accelerations."""

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


class ComputedTorque(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Cancel the leg's own dynamics, so that the error e = theta* - theta is a free oscillator.

        tau = (1 + mass_error) (M(theta) a + bias(theta, theta_dot)) - J^T F*
        a = theta_ddot* + kd (theta_dot* - theta_dot) + kp (theta* - theta)

    With an exact model, a fast period and F = F*,   e_ddot + kd e_dot + kp e = 0.

    With mass_error != 0 the controller's model of everything that moves, links, payload and
    rotors, is 1 + mass_error times as heavy as the real leg. Both gains then act 1 + mass_error
    times, and -mass_error (theta_ddot* + M^-1 bias) drives the error.

    With an exact model a torque held for a period is stable about a still reference for
    kp T / 2 < kd < 2 / T on any leg.

    Attributes:
        kp: Position gain [1/s^2].
        kd: Rate gain [1/s]; 2 sqrt(kp) is critical damping.
        mass_error: Relative error of the model's masses and inertias; 0.2 is 20 % too heavy.
        period: Time between two commands T [s].
    """

    drive: ClassVar[Drive] = "torque"

    kp: float = 2500.0
    kd: float = 100.0
    mass_error: float = 0.0
    period: float = 0.001

    def __post_init__(self) -> None:
        check_number("kp", self.kp, "1/s^2", low=0.0)
        check_number("kd", self.kd, "1/s", low=0.0)
        check_number("mass_error", self.mass_error, "", low=-1.0, strict=True)
        check_number("period", self.period, "s", low=0.0, strict=True)

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the motor torques [N m], (..., 2).

        Raises:
            LoopOpenError: Where the links do not meet.
            SingularError: Where B, C and D are in line.
        """
        del servo  # the motors are driven in torque
        theta = seen.theta
        rate = seen.theta_dot
        pd = self.kd * (wanted.theta_dot - rate) + self.kp * (wanted.theta - theta)
        a = wanted.theta_ddot + pd
        # The force is left out here: it is not a mass, so the mass error must not scale it.
        moving = dynamics.inverse(leg, theta, rate, a, payload=wanted.payload)
        heavy = (1.0 + self.mass_error) * moving
        # Most runs have no force, and its torques cost half of what all others do.
        return heavy + dynamics.statics(leg, theta, wanted.force) if wanted.force.any() else heavy
