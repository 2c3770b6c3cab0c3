"""Legs and robots as MuJoCo models."""

from fivebar_sim.integrator import Integrator
from fivebar_sim.model.file import quiet, without_log
from fivebar_sim.model.friction import friction_law
from fivebar_sim.model.leg import CLEAR, HIP_HEIGHT, build, leg_spec, standing
from fivebar_sim.model.robot import build_robot, robot_spec

__all__ = [
    "CLEAR",
    "HIP_HEIGHT",
    "Integrator",
    "build",
    "build_robot",
    "friction_law",
    "leg_spec",
    "quiet",
    "robot_spec",
    "standing",
    "without_log",
]
