"""Dynamics of the closed five-bar in motor coordinates: pure NumPy, any batch shape, SI units.

Angle pairs are theta = (theta_A, theta_E), torques tau = (tau_A, tau_E), (..., 2) each:

    tau = M(theta) theta_ddot + bias(theta, theta_dot) - J^T F

F is the force of the world on the foot. Weight and motor armature are included. `inverse`,
`forward` and `step_torques` can add Coulomb friction of the gears; a torque law may add any other.

`LegDynamics(leg, assembly, payload)` has all functions as methods, for repeated calls.
"""

from fivebar_sim.dynamics.laws import (
    bias,
    energy,
    forward,
    inverse,
    mass_matrix,
    reflected_inertia,
    statics,
)
from fivebar_sim.dynamics.leg import Energy, LegDynamics
from fivebar_sim.dynamics.motion import Law, Motion, integrate, simulate
from fivebar_sim.dynamics.stepwise import soft_loop, step_torques

__all__ = [
    "Energy",
    "Law",
    "LegDynamics",
    "Motion",
    "bias",
    "energy",
    "forward",
    "integrate",
    "inverse",
    "mass_matrix",
    "reflected_inertia",
    "simulate",
    "soft_loop",
    "statics",
    "step_torques",
]
