"""Joint PD whose gains follow the foot's distance to its target."""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, broadcast
from fivebar_sim.checks import check_number
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.interface import Drive
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import LoopOpenError
from fivebar_sim.geometry import FiveBar


class GainSchedule(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Pull each motor to its reference, stiffly near the target and softly far from it.

        tau = kp (theta* - theta) + kd (theta_dot* - theta_dot)
        kp = kp_near + s (kp_far - kp_near),   kd likewise
        s = r^2 (3 - 2 r),   r = min(e / blend, 1),   e = |F(theta) - F*|

    Sensor noise may show angles at which the loop cannot close and there is no foot: those count
    as far.

    The defaults suit the preset `airhockey` at a period T of 10 ms, where a constant
    (kp, kd) = (150, 5) breaks down. A held torque is stable about a still reference if every
    eigenvalue m of the mass matrix has kp T / 2 < kd < 2 m / T. In the middle of this leg's
    workspace (|x| <= 0.2 m, z from 0.4 to 0.7 m) the lesser m is 0.011 to 0.024 kg m^2, so kd must
    be below 2.2 to 4.7 N m s/rad; at the edge m falls to 0.004 kg m^2. Near the target, 150 N m/rad
    are kept, and kd = 1.5 N m s/rad is stable for m above 0.0075 kg m^2: targets further out
    need smaller near gains. Far from it a spring that stiff would ask for so much torque that the
    leg is thrown across poses of other m within a period or two: 15 N m/rad is about critically
    damped by 1 N m s/rad, and that is stable for m above 0.005 kg m^2.

    Attributes:
        kp_near: Position gain at the target [N m/rad].
        kd_near: Derivative gain at the target [N m s/rad].
        kp_far: Position gain at the distance `blend` and beyond [N m/rad].
        kd_far: Derivative gain there [N m s/rad].
        blend: Distance from foot to target over which the gains change [m].
        period: Time between two commands T [s].
    """

    drive: ClassVar[Drive] = "torque"

    kp_near: float = 150.0
    kd_near: float = 1.5
    kp_far: float = 15.0
    kd_far: float = 1.0
    blend: float = 0.1
    period: float = 0.01

    def __post_init__(self) -> None:
        for key in ("kp_near", "kp_far"):
            check_number(key, getattr(self, key), "N m/rad", low=0.0)
        for key in ("kd_near", "kd_far"):
            check_number(key, getattr(self, key), "N m s/rad", low=0.0)
        check_number("blend", self.blend, "m", low=0.0, strict=True)
        check_number("period", self.period, "s", low=0.0, strict=True)

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the motor torques [N m], (..., 2)."""
        del servo  # the motors are driven in torque
        r = np.minimum(distance(leg, seen.theta, wanted.foot) / self.blend, 1.0)
        # Its slope is 0 at both ends, so that the gains have no kink at `blend`.
        s = (r * r * (3.0 - 2.0 * r))[..., None]
        kp = self.kp_near + s * (self.kp_far - self.kp_near)
        kd = self.kd_near + s * (self.kd_far - self.kd_near)
        return kp * (wanted.theta - seen.theta) + kd * (wanted.theta_dot - seen.theta_dot)


def distance(leg: FiveBar, theta: Array, foot: Array) -> Array:
    """Return |F(theta) - foot| [m], infinite where the loop cannot close.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        foot: [m], broadcasts with theta.

    Returns:
        [m], (...).
    """
    theta, foot = broadcast(theta=theta, foot=foot)
    try:
        d = kinematics.forward(leg, theta) - foot
    except LoopOpenError:
        if theta.ndim == 1:
            return np.asarray(np.inf)
        # One open loop makes `forward` refuse the whole batch: try each pose by itself.
        rows = zip(theta, foot, strict=True)
        return np.stack([distance(leg, *row) for row in rows])
    return np.hypot(d[..., 0], d[..., 1])
