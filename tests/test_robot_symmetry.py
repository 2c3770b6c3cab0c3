"""A robot has no handedness: begun with its other diagonal, it does the mirror image of its run."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim import Scenario
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import Walk, walk

SIDES = {"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}

MIRRORED = {
    **dict.fromkeys(("trunk_x", "trunk_z", "trunk_qw", "trunk_qy"), 1.0),
    **dict.fromkeys(("trunk_y", "trunk_qx", "trunk_qz"), -1.0),
}
"""What a mirror between left and right makes of the trunk's place and quaternion."""

OTHER = "gait.phases={FL=0.5, FR=0.0, RL=0.0, RR=0.5}"
"""The trot that begins with the other diagonal: the mirror image of a trot."""


def went(*settings: str) -> Walk:
    scenario = Scenario.load("robot-q8bot-trot-fast", ["limits={}", *settings])
    assert isinstance(scenario, RobotScenario)
    return walk(plan_scenario(scenario))


def apart(one: Walk, other: Walk) -> float:
    """Return how far a run is from the mirror image of another, at most [m, rad]."""
    found = [one.record[key] - sign * other.record[key] for key, sign in MIRRORED.items()]
    for leg in LEGS:
        for joint in "ABED":
            angle = other.record[f"{SIDES[leg]}_theta_{joint}"]
            found.append(one.record[f"{leg}_theta_{joint}"] - angle)
    return float(np.abs(found).max())


def test_first_steps_are_mirrored_and_a_lopsided_robot_s_are_not() -> None:
    """More than a period, to rounding; a trunk whose weight is 1 mm to the left shows."""
    short = ["duration=0.24", "path.ramp=0.05"]
    first = went(*short)
    other = went(*short, OTHER)
    assert apart(first, other) < 1e-12
    assert apart(first, first) > 1e-3
    assert apart(went(*short, "robot.trunk.center=[0.0, 0.001, 0.006]"), other) > 1e-5


@pytest.mark.long
def test_whole_run_is_mirrored() -> None:
    """Contacts make errors grow, from 1e-16 to 6e-12 in two seconds."""
    first = went()
    other = went(OTHER)
    assert apart(first, other) < 1e-9
    assert first.record["trunk_qz"][-1] == pytest.approx(-other.record["trunk_qz"][-1], abs=1e-9)
