"""Position setpoints for the servos at A and E, from the analytic inverse kinematics."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.motion import Motion
from fivebar_sim.servo import Integrator
from fivebar_sim.servo import Servo as ServoGains


class Servo(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Send the servos the joint angles of the path, shaped against their own lag.

        feedforward "none":      u = theta*
        feedforward "velocity":  u = theta* + (kd / kp) theta_dot*

    A servo tau = kp (u - theta) - kd theta_dot trails a moving setpoint by kd / kp times its
    speed; the second law takes that lag out, and leaves tau / kp.

    Both are written in the terms of the integrator's step from t to t + h. Theta* is taken at
    t + h with `discrete`, whose spring acts there, and at t with `implicitfast`. Theta_dot* is
    what the rate will be after the step if the leg follows, (theta*(t + h) - theta*(t)) / h under
    both: the damping acts on that rate, and the path's own rate at t + h is half a step ahead.

    Attributes:
        feedforward: "none" or "velocity".
    """

    feedforward: Literal["none", "velocity"] = "none"

    def setpoints(
        self, leg: FiveBar, servo: ServoGains, motion: Motion, integrator: Integrator
    ) -> Array:
        """Return the setpoints (theta_A, theta_E) of every step [rad], (N, 2)."""
        del leg  # what the law needs of it is in the motion
        rows = slice(1, None) if integrator == "discrete" else slice(None, -1)
        u = motion.q[rows][:, [0, 2]]
        if self.feedforward == "velocity":
            rate = np.diff(motion.q[:, [0, 2]], axis=0) / motion.timestep
            u = u + (servo.kd / servo.kp) * rate
        return u
