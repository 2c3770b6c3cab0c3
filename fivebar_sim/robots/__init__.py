"""Robots as data: a trunk, four hips, a leg, a servo. The shipped ones are in models/robots/."""

from fivebar_sim.robots.floor import Air, Floor, Scene
from fivebar_sim.robots.gait import TROT, Gait
from fivebar_sim.robots.hips.hip import Hip
from fivebar_sim.robots.robot import LEGS, Robot, Trunk

__all__ = ["LEGS", "TROT", "Air", "Floor", "Gait", "Hip", "Robot", "Scene", "Trunk"]
