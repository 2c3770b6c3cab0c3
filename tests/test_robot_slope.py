"""A robot on a slope: its weight along the floor, and how it slides where friction is too small."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim import Scenario
from fivebar_sim.errors import ConfigError
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import Walk, walk

STILL = "path.points=[[0, -0.04336], [0, -0.04336]]"


def stood(*settings: str) -> Walk:
    """Return 0.4 s of a Q8bot that holds its legs still."""
    short = ["duration=0.4", "path.seconds=0.4", "path.ramp=0.2", "limits={}", STILL]
    scenario = Scenario.load("robot-q8bot-stand", [*short, *settings])
    assert isinstance(scenario, RobotScenario)
    return walk(plan_scenario(scenario))


def test_feet_hold_the_weight_along_and_across_the_slope() -> None:
    """Uphill m g sin a, and m g cos a."""
    went = stood("scene.slope=0.2")
    weight = 9.81 * went.plan.robot.mass
    along, across = (
        sum(went.record[f"{leg}_ground_{axis}"][-100:].mean() for leg in LEGS) for axis in "xz"
    )
    assert along == pytest.approx(weight * np.sin(0.2), rel=5e-3)
    assert across == pytest.approx(weight * np.cos(0.2), rel=1e-3)
    assert went.falls == []


def test_robot_slides_down_where_friction_is_less_than_the_slope() -> None:
    """Downhill with g (sin a - mu cos a)."""
    went = stood('scene.slope="12 deg"', "scene.friction=0.1")
    speed = went.record["trunk_dot_x"]
    angle = np.radians(12.0)
    wanted = -9.81 * (np.sin(angle) - 0.1 * np.cos(angle))
    assert (speed[-1] - speed[199]) / 0.2 == pytest.approx(wanted, rel=0.02)


def test_slope_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"scene\.slope must be in \[-0\.785.*, 0\.785.*\] rad"):
        stood("scene.slope=1.0")
