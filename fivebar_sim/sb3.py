"""The vector environment for Stable-Baselines3: only this module needs that library.

Install `stable-baselines3` yourself; none of fivebar-sim's extras brings it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from fivebar_sim.vector import LegVectorEnv

try:
    from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        f"fivebar_sim.sb3 needs Stable-Baselines3 ({error}): pip install stable-baselines3",
        name=error.name,
    ) from error


class LegVecEnv(VecEnv):
    """Legs as Stable-Baselines3 asks for them: float32, actions in [-1, 1].

    An answer a of the policy, of [-1, 1], becomes centre + half a of the action space; what is
    outside is clipped. A leg whose episode ended begins the next one in the same step, with the
    last observation in info["terminal_observation"].

    Args:
        task: As in `LegVectorEnv`.
        num_envs: Number of legs.
        seed: Seed of the first reset.
        options: The other arguments of `LegVectorEnv`.

    Raises:
        ArgumentError: As in `LegVectorEnv`.
    """

    def __init__(
        self, task: Any, num_envs: int = 1, seed: int | None = None, **options: Any
    ) -> None:
        self.envs = LegVectorEnv(task, num_envs, autoreset_mode="SameStep", **options)
        self.render_mode = self.envs.render_mode
        self.metadata = self.envs.metadata
        size = self.envs.single_observation_space.shape
        seen = Box(-np.inf, np.inf, size, np.float32)
        acted = Box(-1.0, 1.0, self.envs.episodes.low.shape, np.float32)
        self._actions = np.zeros((num_envs, *acted.shape))
        super().__init__(num_envs, seen, acted)
        self.seed(seed)

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode of every leg; the first time, and after `seed`, from the seeds."""
        seen, _ = self.envs.reset(seed=self._seeds)
        self._reset_seeds()
        self._reset_options()
        return seen.astype(np.float32)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        low = self.envs.episodes.low
        high = self.envs.episodes.high
        part = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)
        self._actions = 0.5 * (low + high) + 0.5 * (high - low) * part

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[Any], list[dict[str, Any]]]:
        """Step all legs."""
        seen, reward, terminated, truncated, info = self.envs.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        over = terminated | truncated
        for i in np.flatnonzero(over).tolist():
            infos[i] = {
                "terminal_observation": info["final_obs"][i].astype(np.float32),
                "TimeLimit.truncated": bool(truncated[i]),
                "reason": str(info["reason"][i]),
            }
        return seen.astype(np.float32), reward.astype(np.float32), over, infos

    def close(self) -> None:
        """Let go of the legs."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return one picture with all legs, where there is a render mode."""
        return [self.envs.render()]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the vector environment, the same for each leg."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the vector environment, for all legs."""
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Call a method of the vector environment once; return what it returns for each leg."""
        returned = getattr(self.envs, method_name)(*args, **kwargs)
        return [returned for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that none is wrapped."""
        return [False for _ in self._get_indices(indices)]
