"""Kinematics of the planar five-bar: pure NumPy, any batch shape, SI units and radians.

Points and angle pairs are (..., 2), Jacobians (..., 2, 2). Working mode and assembly mode are
arguments: no function remembers a previous pose.
"""

from fivebar_sim.kinematics.closure import (
    Branch,
    Points,
    bases,
    branch,
    chain_points,
    closed_points,
    forward,
    knees,
    passive,
)
from fivebar_sim.kinematics.half_angle import inverse_half_angle, inverse_within
from fivebar_sim.kinematics.home import hanging, home
from fivebar_sim.kinematics.rates import JointMotion, foot_and_jacobian, jacobian, joint_motion
from fivebar_sim.kinematics.reach import inverse, inverse_all, inverse_nearest

__all__ = [
    "Branch",
    "JointMotion",
    "Points",
    "bases",
    "branch",
    "chain_points",
    "closed_points",
    "foot_and_jacobian",
    "forward",
    "hanging",
    "home",
    "inverse",
    "inverse_all",
    "inverse_half_angle",
    "inverse_nearest",
    "inverse_within",
    "jacobian",
    "joint_motion",
    "knees",
    "passive",
]
