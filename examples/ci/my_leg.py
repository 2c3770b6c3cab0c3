"""The controller of our leg."""

from __future__ import annotations

import msgspec
import numpy as np


class Lead(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Send the servos where the joints are to be a little later.

        u = theta* + lead theta_dot*

    A servo tau = kp (u - theta) - kd theta_dot trails a moving setpoint by kd / kp seconds, so
    lead = kd / kp takes its lag out; what remains is tau / kp.

    Attributes:
        lead: How much later [s].
    """

    lead: float = 0.0

    def setpoints(self, leg, servo, motion, integrator):
        """Return the setpoints (theta_A, theta_E) of every step [rad], (N, 2)."""
        theta = motion.q[:, [0, 2]]  # A and E of A, B, E, D, at the N + 1 instants
        rate = np.diff(theta, axis=0) / motion.timestep
        acts = theta[1:] if integrator == "discrete" else theta[:-1]
        return acts + self.lead * rate
