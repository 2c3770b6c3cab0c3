"""Robots that walk in MuJoCo: planned, simulated, measured."""

from fivebar_sim.walking.plan import RobotPlan, plan
from fivebar_sim.walking.walk import Walk, walk

__all__ = ["RobotPlan", "Walk", "plan", "walk"]
