"""A robot that learns to walk: as Gymnasium wants it, and as `walk` simulates it."""

from __future__ import annotations

from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import fivebar_sim.gym  # noqa: F401 - registers
from fivebar_sim import FiveBar, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError
from fivebar_sim.motion import Motion
from fivebar_sim.paths import Step
from fivebar_sim.robots import LEGS, TROT, Floor, Gait, Robot
from fivebar_sim.walking import plan, walk
from fivebar_sim.walking.env import PARTS, WalkEnv

ROBOT = Robot.load("q8bot")
SPACES_IN_SI = pytest.mark.filterwarnings("ignore:.*A Box observation space")
STILL = np.zeros(8)


def env(**options: Any) -> WalkEnv:
    return WalkEnv(ROBOT, **{"duration": 0.2, **options})


def played(played_by: WalkEnv, seed: int) -> np.ndarray:
    """Return the observations of an episode of random actions."""
    rows = [played_by.reset(seed=seed)[0]]
    over = False
    while not over:
        row, _, ended, cut, _ = played_by.step(played_by.np_random.uniform(-1.0, 1.0, 8))
        rows.append(row)
        over = ended or cut
    return np.array(rows)


@SPACES_IN_SI
def test_gymnasiums_checker_passes() -> None:
    made = gymnasium.make("fivebar/Walk-v0", duration=0.04, randomise=True).unwrapped
    check_env(made, skip_render_check=True)  # which makes four more of them


class Steps(msgspec.Struct, frozen=True):
    """A controller that sends each motor of a leg its standing angle and a row of a table [rad]."""

    rows: tuple[tuple[float, float], ...]
    every: int

    def setpoints(self, leg: FiveBar, servo: Servo, motion: Motion, integrator: str) -> Array:
        """Return them, (N, 2)."""
        del leg, servo, integrator
        return motion.q[:-1, ::2] + np.repeat(np.array(self.rows), self.every, axis=0)


def test_robot_does_what_walk_simulates() -> None:
    """All legs are told the same, through the same bus, late by the same delay.

    From the same start to the last bit: whether a foot at height 0 touches the floor in the first
    step is rounding, and leaves 1e-3 rad.
    """
    rng = np.random.default_rng(3)
    rows = rng.uniform(-0.3, 0.3, (10, 2))
    made = env(friction=0.7)
    made.reset(seed=1)
    for row in rows[:-1]:
        assert not any(made.step(np.tile(row / made.task.span, 4))[2:4])
    seen, _, ended, over, _ = made.step(np.tile(rows[-1] / made.task.span, 4))
    assert (ended, over) == (False, True)

    x, z = kinematics.forward(ROBOT.leg, kinematics.hanging(ROBOT.leg)[::2])
    path = Step(start=(x, z), stop=(x, z), lift=0.0, seconds=0.2)
    held = Gait(path=path, phases=dict.fromkeys(TROT, 0.0))
    sent = Steps(tuple(map(tuple, rows.tolist())), made.task.every)
    planned = plan(ROBOT, held, duration=0.2, controller=sent, scene=Floor(friction=0.7))
    stands = planned.model.key("stand").qpos
    np.testing.assert_allclose(planned.start, stands, atol=1e-15)
    went = walk(planned._replace(start=stands))
    angles = [went.record[f"{leg}_theta_{motor}"][-1] for leg in LEGS for motor in "AE"]
    np.testing.assert_allclose(seen[8:16], angles, atol=1e-9)


def test_a_seed_says_all_and_draws_within_the_ranges() -> None:
    options: dict[str, Any] = {"randomise": {"mass": [0.8, 0.9]}, "gyro_noise": 0.1}
    made = env(duration=0.06, **options)
    first = played(made, 3)
    mass = made.robot.mass
    assert 0.8 * ROBOT.mass <= mass <= 0.9 * ROBOT.mass
    np.testing.assert_array_equal(first, played(made, 3))
    second = played(made, 4)
    assert not np.array_equal(first[0], second[0])
    assert made.robot.mass != mass
    # Nothing is left of the robot before.
    np.testing.assert_array_equal(second, played(env(duration=0.06, **options), 4))
    assert first.shape[1] == sum(PARTS.values())


def test_robot_told_to_stand_is_paid_for_standing() -> None:
    made = env(speed=(0.0, 0.0), turn=(-1e-9, 1.0))
    made.reset(seed=1)
    made.episode.wanted = np.zeros(2)
    for _ in range(9):
        made.step(STILL)
    _, reward, _, _, info = made.step(STILL)
    assert info["terms"]["turn"] == pytest.approx(0.5, abs=1e-3)
    assert -0.01 < info["terms"]["effort"] < 0.0
    assert reward == pytest.approx(sum(info["terms"].values()))


def test_fall_ends_the_episode_and_says_why() -> None:
    trunk = msgspec.structs.replace(ROBOT.trunk, center=(0.0, 0.08, 0.006))
    made = WalkEnv(msgspec.structs.replace(ROBOT, trunk=trunk), duration=1.0)
    made.reset(seed=1)
    ended = cut = False
    info: dict[str, Any] = {}
    while not (ended or cut):
        _, _, ended, cut, info = made.step(STILL)
    assert ended
    assert "trunk" in info["reason"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"speeed": 1.0}, r"unknown option of Walk-v0 'speeed'; known: .*did you mean 'speed'"),
        ({"speed": (0.3, 0.1)}, r"speed\[1\] must be in \[0\.3, 1000\]"),
        ({"span": 0.0}, r"span must be in \(0, .*\) rad, got 0"),
        ({"period": 0.0155}, "period must be a whole number of timesteps"),
        ({"randomise": {"height": [1, 2]}}, "randomise must be True or a table of friction, mass"),
        ({"randomise": {"mass": 1.0}}, r"randomise\.mass must be two numbers \(low, high\), got 1"),
        (
            {"randomise": {"mass": [1, np.nan]}},
            r"randomise\.mass\[1\] must be in \[1, 10\], got nan",
        ),
        ({"randomise": {"delay": [1, 0]}}, r"randomise\.delay\[1\] must be in \[1, 1\] s, got 0"),
        ({"render_mode": "human"}, "unknown render_mode 'human'; known: rgb_array"),
        ({"width": 0}, r"width must be a whole number in \[1, inf\), got 0"),
        ({"camera": {"azimut": 0}}, "unknown key 'azimut'"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        env(**options)


@pytest.mark.parametrize("action", [np.zeros(7), np.full(8, 1.1), np.full(8, np.nan), "up"])
def test_action_out_of_its_space_is_refused(action: Any) -> None:
    made = env()
    made.reset(seed=1)
    with pytest.raises(ArgumentError, match=r"^an action must be 8 numbers in \[-1, 1\], got "):
        made.step(action)


def test_step_out_of_turn_is_refused() -> None:
    made = env(duration=0.02)
    with pytest.raises(ArgumentError, match=r"^step comes after reset$"):
        made.step(STILL)
    made.reset(seed=1)
    assert made.step(STILL)[3]
    with pytest.raises(ArgumentError, match=r"^the episode is over: reset comes before"):
        made.step(STILL)
    made.close()
    with pytest.raises(ArgumentError, match=r"^the environment is closed"):
        made.step(STILL)
