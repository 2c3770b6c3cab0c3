"""Foot impedance: a virtual spring and damper between the foot and its target."""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np

from fivebar_sim import dynamics, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.interface import Drive
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import FiveBar


class Impedance(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Let the foot give way to unexpected forces, like a spring with a damper.

        tau = J^T (stiffness (p* - p) + damping (p_dot* - p_dot) - F*) + bias(theta, 0)

    p = F(theta) is the foot, p_dot = J theta_dot. F* is the expected force of the world on the
    foot: the leg pushes back with -F*, and its weight is carried. Under a real force F it rests at

        p - p* = (F - F*) / stiffness        along x and z of the hip frame.

    The default gains suit the preset `classic` at 1 ms: its foot feels like 0.012 to 0.016 kg,
    which they damp nearly critically.

    Attributes:
        stiffness: Stiffness of the spring along (x, z) [N/m].
        damping: Damping along (x, z) [N s/m].
        period: Time between two commands [s].
    """

    drive: ClassVar[Drive] = "torque"

    stiffness: tuple[float, float] = (200.0, 200.0)
    damping: tuple[float, float] = (3.0, 3.0)
    period: float = 0.001

    def __post_init__(self) -> None:
        _check_pair("stiffness", self.stiffness, "N/m")
        _check_pair("damping", self.damping, "N s/m")
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
        p, J = kinematics.foot_and_jacobian(leg, theta)
        p_dot = J[..., 0] * rate[..., :1] + J[..., 1] * rate[..., 1:]
        spring = np.asarray(self.stiffness) * (wanted.foot - p)
        pull = spring + np.asarray(self.damping) * (wanted.foot_dot - p_dot)
        still = (0.0, 0.0)
        # `inverse` takes the force on the foot and answers with tau = -J^T F: hence the sign.
        force = wanted.force - pull
        return dynamics.inverse(leg, theta, still, still, force, payload=wanted.payload)


def _check_pair(key: str, pair: tuple[float, float], unit: str) -> None:
    """Raise unless a key's value is two finite numbers of at least zero."""
    if not isinstance(pair, tuple) or len(pair) != 2:
        raise ArgumentError(f"{key} must be two numbers (x, z) [{unit}], got {pair!r}")
    for index, value in enumerate(pair):
        check_number(f"{key}[{index}]", value, unit, low=0.0)
