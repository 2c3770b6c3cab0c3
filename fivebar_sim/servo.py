"""The position servo at A and E, and the torque that it really applies in one step."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number

Integrator = Literal["discrete", "implicitfast"]


class Servo(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A position servo at each motor: tau = clip(kp (u - theta), limit) - kd theta_dot.

    In MuJoCo kp is the actuator's gain, limit its forcerange, and kd the damping of the motor's
    joint, so that the integrator treats kd implicitly also while the limit clips.

    Attributes:
        kp: Position gain [N m/rad].
        kd: Derivative gain [N m s/rad].
        limit: Largest torque of the kp term [N m]; None is unlimited.
    """

    kp: float = 8.0
    kd: float = 0.05
    limit: float | None = None

    def __post_init__(self) -> None:
        check_number("kp", self.kp, "N m/rad", low=0.0, strict=True)
        check_number("kd", self.kd, "N m s/rad", low=0.0)
        if self.limit is not None:
            check_number("limit", self.limit, "N m", low=0.0, strict=True)


def applied_torque(
    servo: Servo, integrator: Integrator, ctrl: Array, q: Array, q_next: Array, v_next: Array
) -> Array:
    """Return the motor torque that MuJoCo's integrator applied over a step.

    The actuator sensor shows kp (u - q), the force before the implicit update; what enters the
    step's momentum balance is, with (q, v) before the step and (q+, v+) after it,

        discrete:      tau = kp (u - q+) - kd v+
        implicitfast:  tau = kp (u - q) - kd v+

    Whether the limit clips is decided with q at the start of the step under both: where
    |kp (u - q)| > limit, the first term is limit sign(u - q).

    Args:
        servo: The servo's gains.
        integrator: MuJoCo's integrator of the run.
        ctrl: Setpoints u of the step [rad].
        q: Motor angles before the step [rad].
        q_next: Motor angles after it [rad].
        v_next: Motor rates after it [rad/s].

    Returns:
        Torque of each motor [N m], of the arguments' shape.
    """
    at_start = servo.kp * (ctrl - q)
    spring = servo.kp * (ctrl - q_next) if integrator == "discrete" else at_start
    if servo.limit is not None:
        clipped = np.abs(at_start) > servo.limit
        spring = np.where(clipped, np.sign(at_start) * servo.limit, spring)
    return spring - servo.kd * v_next
