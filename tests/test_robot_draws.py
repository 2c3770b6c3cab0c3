"""A robot in draws of friction, mass and delay: what is drawn, what comes of it, and a fall."""

from __future__ import annotations

import runpy
from pathlib import Path

import msgspec
import numpy as np
import pytest

from fivebar_sim import Scenario
from fivebar_sim.robots import Floor
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.draws import draw, outcomes

SCRIPT = Path(__file__).parents[1] / "scripts" / "robot_draws.py"
SEED = runpy.run_path(str(SCRIPT))["SEED"]


def loaded(name: str, *settings: str) -> RobotScenario:
    scenario = Scenario.load(name, settings)
    assert isinstance(scenario, RobotScenario)
    return scenario


TROT = loaded("robot-q8bot-trot-fast", "duration=0.5")


def test_draws_are_within_their_ranges_and_the_same_again() -> None:
    drawn = draw(TROT, 200, 1)
    frictions = [each.scene.friction for each in drawn if isinstance(each.scene, Floor)]
    masses = np.array([each.robot.mass for each in drawn]) / TROT.robot.mass
    delays = np.array([each.servo.delay for each in drawn])
    for values, low, high in ((frictions, 0.5, 1.2), (masses, 0.9, 1.1), (delays, 1e-3, 3e-3)):
        assert low <= min(values) < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < max(values) <= high
    # The legs keep their mass: what is more or less is the trunk's.
    assert {each.leg for each in drawn} == {TROT.leg}
    assert draw(TROT, 5, 1) == drawn[:5]
    (uphill,) = draw(loaded("robot-q8bot-trot-fast", "scene.slope=0.1"), 1, 1)
    assert uphill.scene == Floor(friction=frictions[0], slope=0.1)
    assert draw(TROT, 5, 2) != drawn[:5]


def test_robots_together_do_what_each_does_alone() -> None:
    drawn = draw(TROT, 3, 1)
    together = outcomes(drawn)
    assert together[1] == outcomes(drawn[1:2])[0]
    assert together[0] != together[1]


def test_fall_is_counted() -> None:
    box = msgspec.structs.replace(TROT.robot.trunk, center=(0.0, 0.08, 0.006))
    robot = msgspec.structs.replace(TROT.robot, trunk=box)
    (fell,) = outcomes(draw(msgspec.structs.replace(TROT, robot=robot), 1, 1))
    assert fell.moved.falls > 0


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "up"), [("q8bot-trot", 64), ("q8bot-trot-fast", 64), ("doggo-trot", 64)]
)
def test_robot_stays_up_in_64_of_64(name: str, up: int) -> None:
    """As docs/robots.md says."""
    found = outcomes(draw(loaded(f"robot-{name}"), 64, SEED), nthread=0)
    assert sum(each.moved.falls == 0 for each in found) == up


def test_q8bot_stays_up_in_the_first_two() -> None:
    found = outcomes(draw(loaded("robot-q8bot-trot-fast", "duration=1"), 2, SEED))
    assert [each.moved.falls for each in found] == [0] * 2
