"""Stable-Baselines3 on the legs; where it is not installed, that the adapter says so."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

import fivebar_sim.gym  # noqa: F401 - registers the tasks

HERE = importlib.util.find_spec("stable_baselines3") is not None
NEEDS = pytest.mark.skipif(not HERE, reason="Stable-Baselines3 is not installed: it brings torch")
QUIET = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")


@pytest.mark.skipif(HERE, reason="Stable-Baselines3 is installed")
def test_without_the_library_the_adapter_names_it() -> None:
    with pytest.raises(ModuleNotFoundError, match="pip install stable-baselines3"):
        importlib.import_module("fivebar_sim.sb3")


@NEEDS
@pytest.mark.long
@QUIET
@pytest.mark.parametrize("name", ["Track", "Stand", "Hop", "Gait"])
def test_its_checker_passes(name: str) -> None:
    from stable_baselines3.common.env_checker import (  # pyright: ignore[reportMissingImports]
        check_env,
    )

    env = gymnasium.make(f"fivebar/{name}-v0")
    check_env(env, skip_render_check=True)


@NEEDS
@pytest.mark.long
@QUIET
def test_adapter_gives_what_the_legs_give() -> None:
    from fivebar_sim.sb3 import LegVecEnv
    from fivebar_sim.vector import LegVectorEnv

    ours: Any = LegVecEnv("hop", 3, seed=5, duration=0.05, nthread=1)
    legs = LegVectorEnv("hop", 3, duration=0.05, nthread=1, autoreset_mode="SameStep")
    np.testing.assert_array_equal(ours.reset(), legs.reset(seed=[5, 6, 7])[0].astype(np.float32))
    random = np.random.default_rng(0)
    ends = 0
    for _ in range(25):
        part = random.uniform(-1.0, 1.0, (3, 2)).astype(np.float32)
        seen, reward, over, infos = ours.step(part)
        low = legs.episodes.low
        high = legs.episodes.high
        wanted = 0.5 * (low + high) + 0.5 * (high - low) * part.astype(np.float64)
        expected, gained, terminated, truncated, info = legs.step(wanted)
        np.testing.assert_array_equal(seen, expected.astype(np.float32))
        np.testing.assert_array_equal(reward, gained.astype(np.float32))
        np.testing.assert_array_equal(over, terminated | truncated)
        for i in np.flatnonzero(over).tolist():
            last = info["final_obs"][i].astype(np.float32)
            np.testing.assert_array_equal(infos[i]["terminal_observation"], last)
            assert infos[i]["TimeLimit.truncated"] == truncated[i]
            ends += 1
    assert ends > 3


LEARNS = """
import warnings
warnings.simplefilter("ignore")
import gymnasium, torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.evaluation import evaluate_policy
import fivebar_sim.gym
from fivebar_sim.sb3 import LegVecEnv

torch.set_num_threads(1)
if "{algorithm}" == "PPO":
    model = PPO("MlpPolicy", LegVecEnv("track", 4, seed=0), n_steps=128, seed=0, device="cpu")
else:
    env = gymnasium.make("fivebar/Track-v0", duration=1.0)
    model = SAC("MlpPolicy", env, learning_starts=100, seed=0, device="cpu")
model.learn(2000)
assert model.num_timesteps >= 2000
print("learnt")
"""


@NEEDS
@pytest.mark.long
@pytest.mark.parametrize("algorithm", ["PPO", "SAC"])
def test_learns_for_two_thousand_steps(algorithm: str) -> None:
    """PPO on the adapter; SAC on Gymnasium's environment itself, in float32 up to its bounds."""
    code = LEARNS.replace("{algorithm}", algorithm)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "learnt\n", done.stderr
