"""Many robots at once: the bits of each alone, autoreset, what each draws, what is refused."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import fivebar_sim.gym  # noqa: F401 - registers
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.errors import ArgumentError
from fivebar_sim.robots import Robot
from fivebar_sim.walking.env import WalkEnv
from fivebar_sim.walking.episodes.vector import WalkVectorEnv

ROBOT = Robot.load("q8bot")
ROBOTS = 2
NOISY: dict[str, Any] = {
    "sensors": Sensors(noise=0.01, delay=0.002),
    "gyro_noise": 0.1,
    "down_noise": 0.01,
    "span": 1.2,
    "duration": 0.12,
}


def together(**options: Any) -> WalkVectorEnv:
    return WalkVectorEnv(ROBOT, ROBOTS, **{"nthread": 2, "duration": 0.04, **options})


# oracle


@pytest.mark.parametrize(
    ("mode", "drawn"),
    [(AutoresetMode.NEXT_STEP, {"randomise": True}), (AutoresetMode.SAME_STEP, {})],
)
def test_robots_together_are_gymnasiums_one_by_one(
    mode: AutoresetMode, drawn: dict[str, Any]
) -> None:
    """Every number, with noise, falls and ends at times of their own; 2 threads."""
    options = {**NOISY, **drawn}
    ours = together(autoreset_mode=mode, **options)
    alone = [lambda: WalkEnv(ROBOT, **options)] * ROBOTS
    theirs = SyncVectorEnv(alone, autoreset_mode=mode)
    np.testing.assert_array_equal(ours.reset(seed=7)[0], theirs.reset(seed=7)[0])
    # One of them begins anew before the others, so that episodes end at other times.
    mask = np.array([False, True])
    random = np.random.default_rng(0)
    ends = 0
    for k in range(9):
        if k == 3:
            again = {"seed": [1, 2], "options": {"reset_mask": mask}}
            np.testing.assert_array_equal(ours.reset(**again)[0], theirs.reset(**again)[0])
        actions = random.uniform(-1.0, 1.0, (ROBOTS, 8))
        *mine, info = ours.step(actions)
        *expected, more = theirs.step(actions)
        for one, other in zip(mine, expected, strict=True):
            np.testing.assert_array_equal(one, other)
        for i in np.flatnonzero(info.get("_final_obs", np.zeros(ROBOTS))).tolist():
            np.testing.assert_array_equal(info["final_obs"][i], more["final_obs"][i])
        ends += int(np.sum(mine[2]) + np.sum(mine[3]))
    assert ends >= ROBOTS
    masses = {each.mass for each in ours.robots}
    assert len(masses) == (ROBOTS if drawn else 1)


def test_copy_goes_on_with_the_same_bits() -> None:
    ours = together(randomise=True, duration=0.2)
    ours.reset(seed=1)
    other = copy.deepcopy(ours)
    for _ in range(3):
        actions = np.full((ROBOTS, 8), 0.3)
        np.testing.assert_array_equal(ours.step(actions)[0], other.step(actions)[0])


# edge


@pytest.mark.parametrize("vectorization", ["vector_entry_point", "sync"])
def test_gymnasium_makes_both(vectorization: Any) -> None:
    made = gymnasium.make_vec(
        "fivebar/Walk-v0", num_envs=2, vectorization_mode=vectorization, duration=0.04
    )
    assert isinstance(made.unwrapped, WalkVectorEnv) == (vectorization == "vector_entry_point")
    seen, _ = made.reset(seed=3)
    assert seen in made.observation_space
    seen, reward, terminated, truncated, info = made.step(np.zeros((2, 8)))
    assert reward.shape == terminated.shape == truncated.shape == (2,)
    assert info["reason"].tolist() == ["", ""]
    made.close()


def test_shortened_episodes_end_as_asked() -> None:
    ours = together(max_episode_steps=1)
    ours.reset(seed=0)
    assert ours.step(np.zeros((ROBOTS, 8)))[3].all()


# refusal


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros((3, 8)), r"one for each of 2 robots, got shape \(3, 8\)"),
        (np.zeros(8), r"one for each of 2 robots, got shape \(8,\)"),
        (np.full((2, 8), np.nan), r"one for each of 2 robots, got nan at index \(0, 0\)"),
        (np.full((2, 8), 1.1), r"got 1\.1 at index \(0, 0\)"),
        ("up", "one for each of 2 robots, got 'up'"),
    ],
)
def test_refusal_of_actions(actions: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        together().step(actions)


def test_refusal_out_of_turn() -> None:
    ours = together(autoreset_mode="Disabled", duration=0.02)
    still = np.zeros((ROBOTS, 8))
    with pytest.raises(ArgumentError, match=r"^step comes after reset$"):
        ours.step(still)
    ours.reset(seed=0)
    ours.step(still)
    with pytest.raises(ArgumentError, match=r"^the episodes of robots \[0, 1\] are over"):
        ours.step(still)
    ours.close()
    with pytest.raises(ArgumentError, match=r"^the environment is closed"):
        ours.step(still)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"randomise": {"height": [1, 2]}}, "randomise must be True or a table of friction, mass"),
        ({"speeed": 1.0}, "unknown option of Walk-v0 'speeed'"),
        ({"nthread": -1}, r"nthread must be a whole number in \[0, inf\), got -1"),
        ({"max_episode_steps": 0}, r"max_episode_steps must be a whole number in \[1, inf\)"),
        ({"render_mode": "human"}, "unknown render_mode 'human'; known: rgb_array, rgb_array_list"),
        ({"autoreset_mode": "Never"}, "unknown autoreset_mode 'Never'"),
    ],
)
def test_refusal_of_options(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        together(**options)
