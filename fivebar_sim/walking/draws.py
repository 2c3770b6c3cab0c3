"""A robot's scenario again and again, with what nobody knows exactly drawn at random."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from fivebar_sim.robots import Floor, Robot
from fivebar_sim.robots.jump import Jump
from fivebar_sim.robots.measure import Gone, measure
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import Walk, jumped, walk_all

TOGETHER = 16
"""Robots that are simulated at one time: 2000 steps of each are some 20 MB."""


class Ranges(NamedTuple):
    """Ends of what is drawn, evenly.

    Attributes:
        friction: Coulomb's coefficient between feet and floor.
        mass: Factor of the robot's mass; what is more or less is the trunk's.
        delay: Added to the servos' delay [s].
    """

    friction: tuple[float, float] = (0.5, 1.2)
    mass: tuple[float, float] = (0.9, 1.1)
    delay: tuple[float, float] = (-1e-3, 1e-3)


class Outcome(NamedTuple):
    """What came of one draw.

    Attributes:
        friction: Coulomb's coefficient.
        mass: Mass of the robot [kg].
        delay: Delay of its servos [s].
        moved: How it moved; its falls among it.
        jump: Its highest jump; None where it never left the floor.
    """

    friction: float
    mass: float
    delay: float
    moved: Gone
    jump: Jump | None


def draw(
    scenario: RobotScenario, count: int, seed: int, ranges: Ranges | None = None
) -> list[RobotScenario]:
    """Return a scenario with friction, mass and delay drawn at random.

    Args:
        scenario: The scenario; on a floor.
        count: How many.
        seed: Seed of the draws: the first ones of a longer list are those of a shorter one.
        ranges: What is drawn; None: the defaults.
    """
    ends = np.array(Ranges() if ranges is None else ranges)
    drawn = np.random.default_rng(seed).uniform(ends[:, 0], ends[:, 1], (count, len(ends)))
    return [_with(scenario, *row) for row in drawn.tolist()]


def draw_robot(robot: Robot, ranges: Ranges, random: np.random.Generator) -> tuple[Robot, float]:
    """Return a robot of another mass, its servos late by another delay, and a floor's friction.

    Args:
        robot: The robot.
        ranges: What is drawn.
        random: What draws.
    """
    ends = np.array(ranges)
    friction, mass, delay = random.uniform(ends[:, 0], ends[:, 1]).tolist()
    return _changed(robot, mass, delay), friction


def _changed(robot: Robot, mass: float, delay: float) -> Robot:
    """Return a robot with its mass multiplied and its servos later."""
    servo = msgspec.structs.replace(robot.servo, delay=max(robot.servo.delay + delay, 0.0))
    return msgspec.structs.replace(robot, mass=mass * robot.mass, servo=servo)


def _with(scenario: RobotScenario, friction: float, mass: float, delay: float) -> RobotScenario:
    """Return a scenario with another friction, mass and delay."""
    robot = _changed(msgspec.structs.replace(scenario.robot, servo=scenario.servo), mass, delay)
    floor = scenario.scene if isinstance(scenario.scene, Floor) else Floor()
    scene = msgspec.structs.replace(floor, friction=friction)
    return msgspec.structs.replace(scenario, robot=robot, servo=robot.servo, scene=scene)


def outcomes(scenarios: Sequence[RobotScenario], nthread: int = 1) -> list[Outcome]:
    """Return what comes of scenarios of one duration, on floors.

    Args:
        scenarios: The scenarios.
        nthread: Threads; 0 is one for every processor.

    Raises:
        DivergedError: A simulation broke down; says which, and when.
    """
    found: list[Outcome] = []

    for start in range(0, len(scenarios), TOGETHER):
        plans = [plan_scenario(each) for each in scenarios[start : start + TOGETHER]]
        found.extend(outcome(went) for went in walk_all(plans, nthread))
    return found


def outcome(went: Walk) -> Outcome:
    """Return what came of a run on a floor."""
    assert went.trunk is not None
    planned = went.plan
    moved = measure(went.trunk, planned.window, planned.robot.length, len(went.falls))
    scene = planned.scene
    # Of the draw, as it was run.
    friction = scene.friction if isinstance(scene, Floor) else 0.0
    delay = planned.scenario.servo.delay
    return Outcome(friction, planned.robot.mass, delay, moved, jumped(went))
