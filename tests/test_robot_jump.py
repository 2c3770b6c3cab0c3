"""How high a robot jumps: a trunk thrown by a formula, and the Doggo by its firmware's gains."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim import Scenario
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ConfigError
from fivebar_sim.robots.jump import jump
from fivebar_sim.robots.measure import Trunk

H = 1e-4
G = 9.81


def thrown(push: float, rise: float, wait: float) -> tuple[Trunk, Bools]:
    """Return a trunk that waits, is pushed over a rise [m] by `push` [m/s^2], and flies."""
    t: Array = H * np.arange(1, 12001, dtype=np.float64)
    leave = np.sqrt(2.0 * rise / push)
    speed = push * leave
    since = np.maximum(t - wait, 0.0)
    z = np.where(
        since < leave,
        0.5 * push * since**2,
        rise + speed * (since - leave) - 0.5 * G * (since - leave) ** 2,
    )
    stands = (since < leave) | (z < rise)
    position = np.stack([0.0 * t, 0.0 * t, 0.1 + np.maximum(z, 0.0)], axis=-1)
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    return Trunk(t, position, turned, np.zeros((len(t), 3))), stands


@pytest.mark.parametrize("wait", [0.0, 0.2])
def test_height_and_time_are_those_of_push_and_flight(wait: float) -> None:
    """Height = rise (1 + a/g), time = sqrt(2 rise / a) (1 + a/g), whenever the push comes."""
    push = 60.0
    rise = 0.15
    found = jump(*thrown(push, rise, wait))
    assert found is not None
    height = rise * (1.0 + push / G)
    seconds = np.sqrt(2.0 * rise / push) * (1.0 + push / G)
    # The hundredth of the speed below which it counts as still: a hundredth of the push's time.
    assert found.height == pytest.approx(height, rel=1e-4)
    assert found.apogee - found.begin == pytest.approx(seconds, abs=0.01 * np.sqrt(2 * rise / push))
    assert found.agility == pytest.approx(height / seconds, rel=2e-3)


def test_robot_that_stays_down_has_not_jumped() -> None:
    trunk, stands = thrown(60.0, 0.15, 0.2)
    assert jump(trunk, np.ones_like(stands)) is None
    sinking = trunk._replace(position=np.linspace([0, 0, 0.1], [0, 0, 0.05], len(stands)))
    assert jump(sinking, stands) is None


def test_limit_on_a_jump_needs_one() -> None:
    with pytest.raises(ConfigError, match=r"limits\.robot\.agility needs a path that does not rep"):
        Scenario.load("robot-doggo-trot", ["limits.robot.agility=2.0"])
