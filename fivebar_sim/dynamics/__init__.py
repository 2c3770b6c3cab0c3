"""Dynamics of the closed five-bar in motor coordinates: pure NumPy, any batch shape, SI units.

Angle pairs are theta = (theta_A, theta_E), torques tau = (tau_A, tau_E), (..., 2) each:

    tau = M(theta) theta_ddot + bias(theta, theta_dot) - J^T F

F is what the world does to the foot. Weight and motor armature are in, friction is not: a torque
law may have it.
"""

from fivebar_sim.dynamics.laws import (
    Energy,
    bias,
    energy,
    forward,
    inverse,
    mass_matrix,
    reflected_inertia,
    statics,
)
from fivebar_sim.dynamics.motion import Law, Motion, integrate, simulate

__all__ = [
    "Energy",
    "Law",
    "Motion",
    "bias",
    "energy",
    "forward",
    "integrate",
    "inverse",
    "mass_matrix",
    "reflected_inertia",
    "simulate",
    "statics",
]
