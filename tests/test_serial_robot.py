"""A robot with serial legs in place of its five-bars: its weight, and its torques by formula."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from fivebar_sim import FiveBar, Scenario
from fivebar_sim.arrays import Array
from fivebar_sim.kinematics.two_link import SerialLeg
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.plan import plan_scenario

SCRIPT = runpy.run_path(str(Path(__file__).parents[1] / "scripts" / "serial_robot.py"))


def test_serial_legs_bear_the_weight_by_their_own_statics() -> None:
    """The ground carries the weight of the five-bar robot; hip and knee hold -J^T F.

    Without friction in the gears, which would hold some of it.
    """
    short = ["duration=0.5", "path.seconds=0.5", "path.ramp=0.3", "limits={}"]
    still = "path.points=[[0, -0.04336], [0, -0.04336]]"
    settings = [*short, still, "robot.servo.friction=0"]
    scenario = Scenario.load("robot-q8bot-stand", settings)
    assert isinstance(scenario, RobotScenario)
    planned = plan_scenario(scenario)
    went, torques = SCRIPT["of_serial"](planned)

    forces = [went.record[f"{leg}_ground_z"][-1] for leg in LEGS]
    assert sum(forces) == pytest.approx(planned.robot.mass * 9.81, rel=1e-3)
    for leg, force, torque in zip(LEGS, forces, torques, strict=True):
        theta = np.array([went.record[f"{leg}_theta_{joint}"][-1] for joint in "AB"])
        sideways = went.record[f"{leg}_ground_x"][-1]
        held = statics(planned.robot.leg, theta, np.array([sideways, force]))
        np.testing.assert_allclose(torque[-1], held, atol=5e-3 * np.abs(held).max())


def statics(leg: FiveBar, theta: Array, force: Array) -> Array:
    """Return hip and knee torques that hold a foot force and the links' own weight [N m], (2,).

    Femur and tibia carry the weight of both sides' links, each where side A's has its centre.
    """
    femur, tibia, left, right = leg.links
    turned = np.cumsum(theta)
    knee = leg.L1 * np.cos(turned[0])
    first = 9.81 * (femur.mass + right.mass) * femur.com[0] * np.cos(turned[0])
    second = 9.81 * (tibia.mass + left.mass)
    at_knee = second * tibia.com[0] * np.cos(turned[1])
    held = SerialLeg(leg.L1, leg.L2).static_torques(theta, force)
    # The floor is below the middle of the foot's ball.
    held -= leg.foot_radius * force[0]
    return held + np.array([first + second * knee + at_knee, at_knee])
