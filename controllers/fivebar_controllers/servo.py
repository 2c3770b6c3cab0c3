"""Position setpoints for the servos at A and E, from the analytic inverse kinematics."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np

from fivebar_sim import dynamics, firmware
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo as ServoGains
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.metrics.columns import MOTOR_JOINTS
from fivebar_sim.motion import Motion


class Servo(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Send the servos the joint angles of the path, corrected for the servos' own lag.

        feedforward "none":      u = theta*
        feedforward "velocity":  u = theta* + (kd / kp) theta_dot*
        feedforward "torque":    u = theta* + (kd / kp) theta_dot* + tau* / kp

    A servo tau = kp (u - theta) - kd theta_dot trails a moving setpoint by kd / kp times its
    speed; the second law removes that lag and leaves tau / kp. The third removes that too: tau* is
    the torque that the motion needs, with its payload, its foot force and the gears' friction. kd
    is all damping of the motor's joint, including the share of a no-load speed.

    All terms are those of the integrator's step from t to t + h. Theta* is taken at t + h with
    `discrete`, whose spring acts there, and at t with `implicitfast`. Theta_dot* is the rate after
    the step if the leg follows, (theta*(t + h) - theta*(t)) / h under both: the damping acts on
    that rate, and the path's own rate at t + h is half a step ahead. Tau* is
    `dynamics.step_torques`. Under `implicitfast` the loop opens by tens of micrometres: the third
    law follows `dynamics.soft_loop`, which keeps the foot on its path nevertheless.

    With `arithmetic` "float32" theta* is what the exported C code would compute, bit for bit (see
    `firmware`), so that its rounding is part of the run; theta_dot* are the differences of that.

    Attributes:
        feedforward: "none", "velocity" or "torque".
        arithmetic: "float64", or "float32" as on a microcontroller.
    """

    feedforward: Literal["none", "velocity", "torque"] = "none"
    arithmetic: Literal["float64", "float32"] = "float64"

    def setpoints(
        self, leg: FiveBar, servo: ServoGains, motion: Motion, integrator: Integrator
    ) -> Array:
        """Return the setpoints (theta_A, theta_E) of every step [rad], (N, 2).

        Raises:
            SingularError, DivergedError: With "torque", where the loop of `implicitfast` cannot
                follow the motion; see `dynamics.soft_loop`.
            GeometryError, UnreachableError: With "float32", where the firmware cannot hold the leg
                or does not reach the path.
        """
        q = motion.q
        h = motion.timestep
        payload = motion.payload
        # `implicitfast` must open the loop to pull the knees along: plan with that gap.
        if self.feedforward == "torque" and integrator == "implicitfast":
            q = dynamics.soft_loop(leg, q, h, servo.damping, payload=payload)

        sent = q[:, MOTOR_JOINTS]
        if self.arithmetic == "float32":
            sent = sent + firmware.rounding(leg, motion.foot, motion.q[:, MOTOR_JOINTS])

        # The spring of `discrete` acts at the end of the step, that of `implicitfast` at its start.
        rows = slice(1, None) if integrator == "discrete" else slice(None, -1)
        u = sent[rows]
        if self.feedforward != "none":
            rate = np.diff(sent, axis=0) / h
            u = u + (servo.damping / servo.kp) * rate

        if self.feedforward == "torque":
            tau = dynamics.step_torques(
                leg, q, h, motion.force[:-1], payload=payload, friction=servo.dry
            )
            u = u + tau / servo.kp
        return u
