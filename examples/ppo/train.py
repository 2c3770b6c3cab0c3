"""python train.py [--steps 1000000] [--legs 64] [--seed 0]: PPO learns to hop; see README.md."""
# ruff: noqa: T201 - it prints what it measured

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

import fivebar_sim.gym  # noqa: F401 - registers the tasks
from fivebar_sim.control.servo import Servo

LIMIT = 1.0  # [N m]
THREADS = 2


class Legs(VecEnv):
    """The vector environment as Stable-Baselines3 asks for it, actions in [-1, 1].

    A leg whose episode is over begins the next one in the following step, whose action it ignores:
    that one step of an episode teaches nothing.
    """

    def __init__(self, envs: gymnasium.vector.VectorEnv, seed: int) -> None:
        self.envs, self.render_mode = envs, None
        self.low, self.high = envs.single_action_space.low, envs.single_action_space.high
        seen = envs.single_observation_space
        acts = Box(-1.0, 1.0, self.low.shape, np.float32)
        super().__init__(envs.num_envs, Box(-np.inf, np.inf, seen.shape, np.float32), acts)
        self.start: int | None = seed

    def reset(self) -> np.ndarray:
        """Begin an episode of every leg, the first time from the seed."""
        seen, _ = self.envs.reset(seed=self.start)
        self.start = None
        return seen.astype(np.float32)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions, turned into setpoints."""
        part = 0.5 * (np.clip(actions, -1.0, 1.0).astype(np.float64) + 1.0)
        self.setpoints = np.clip(self.low + part * (self.high - self.low), self.low, self.high)

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all legs."""
        seen, reward, terminated, truncated, _ = self.envs.step(self.setpoints)
        seen = seen.astype(np.float32)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(terminated | truncated):
            infos[i] = {"terminal_observation": seen[i], "TimeLimit.truncated": bool(truncated[i])}
        return seen, reward.astype(np.float32), terminated | truncated, infos

    def close(self) -> None:
        """Let go of the legs."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute, the same for each leg."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Legs have nothing to set."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Legs have no methods of their own."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that none is wrapped."""
        return [False for _ in self._get_indices(indices)]


def legs(number: int, seed: int) -> Legs:
    """Return legs that shall hop, two seconds an episode."""
    options = {"nthread": THREADS, "duration": 2.0, "servo": Servo(limit=LIMIT)}
    return Legs(gymnasium.make_vec("fivebar/Hop-v0", num_envs=number, **options), seed)


def episode(model: PPO, scales: VecNormalize, seed: int, number: int = 64) -> np.ndarray:
    """Return the mean reward a control step of each of some legs with the policy's mean actions."""
    envs = legs(number, seed)
    task = envs.envs.unwrapped.task
    seen, total, on = envs.reset(), np.zeros(number), np.ones(number, dtype=bool)
    for _ in range(task.periods):
        actions, _ = model.predict(scales.normalize_obs(seen), deterministic=True)
        seen, reward, over, _ = envs.step(actions)
        total += reward * on
        on &= ~over
    return total / task.periods


def main(given: Sequence[str] | None = None) -> None:
    """Train and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--legs", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(given)
    torch.set_num_threads(THREADS)
    scales = VecNormalize(VecMonitor(legs(chosen.legs, chosen.seed)), gamma=0.99)
    model = PPO(
        "MlpPolicy",
        scales,
        n_steps=128,
        batch_size=1024,
        n_epochs=5,
        learning_rate=1e-3,
        policy_kwargs={"log_std_init": -1.0},
        seed=chosen.seed,
        device="cpu",
    )
    before = episode(model, scales, 1000).mean()
    start = time.perf_counter()
    model.learn(chosen.steps)
    seconds = time.perf_counter() - start
    after = episode(model, scales, 1000)
    print(
        f"{model.num_timesteps} control steps in {seconds:.0f} s; reward a control step "
        f"{before:.3f} before, {after.mean():.3f} after ({after.min():.3f} to {after.max():.3f})"
    )


if __name__ == "__main__":
    main()
