"""Many legs as one Gymnasium vector environment, on `mujoco.batch`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from fivebar_sim import tasks
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.checks import is_finite
from fivebar_sim.errors import ArgumentError
from fivebar_sim.gym import layout, spaces
from fivebar_sim.tasks import REASONS, Randomise, Task
from fivebar_sim.tasks.legs import LegGroup


class LegVectorEnv(VectorEnv[Array, Array, Any]):
    """Many legs with one task, stepped together; leg i equals a `LegEnv` of its seeds bit for bit.

    That is LegEnv(task, randomise=randomise, model_seed=model_seed + i), reset with seed + i, or
    with the i-th of the seeds. A leg whose episode ended begins a new one in the next step and
    ignores that step's action (Gymnasium's next-step autoreset). info has the reward's "terms" by
    name and the "reason" of each end, "" for the other legs.

    Args:
        task: "track", "stand", "hop", "gait", or a Task.
        num_envs: Number of legs n.
        nthread: Number of threads; 0: one for every processor.
        randomise: Ranges of each leg's random parameters, drawn once; None: no randomisation.
        model_seed: Leg i draws its parameters with the seed model_seed + i.
        options: The task's keywords: leg, servo, action, period ...

    Raises:
        ArgumentError: Unknown task or option, or less than one leg.
        UnreachableError: A leg with its random lengths cannot follow the path.
    """

    metadata = {  # noqa: RUF012 - as in VectorEnv
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": [],
    }

    def __init__(
        self,
        task: str | Task,
        num_envs: int = 1,
        nthread: int = 0,
        randomise: Randomise | None = None,
        model_seed: int = 0,
        **options: Any,
    ) -> None:
        if not (is_finite(num_envs) and num_envs >= 1 and num_envs == int(num_envs)):
            raise ArgumentError(f"num_envs must be in [1, inf), got {num_envs!r}")

        self.num_envs = int(num_envs)
        seeds = range(model_seed, model_seed + self.num_envs)
        self._group = LegGroup(tasks.task(task, **options), seeds, randomise, nthread)
        self.task = self._group.task
        self.episodes = self._group.episodes
        self.drawn = self._group.drawn
        self.layout = layout(self.task)
        self.single_observation_space, self.single_action_space = spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._random: list[np.random.Generator] = []

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Return the first observations (n, size) and info.

        Args:
            seed: Leg i gets seed + i, or the i-th of a sequence; None: continue with the last
                ones.
            options: Unused.

        Raises:
            gymnasium.error.Error: A seed is not a whole number >= 0.
            ArgumentError: The number of seeds is not that of the legs.
        """
        if seed is None:
            seeds: list[int | None] = [None] * self.num_envs
        elif isinstance(seed, Sequence):
            seeds = list(seed)
        else:
            # Called for its error: adding i to what is not a number raises another one.
            seeding.np_random(seed)
            seeds = [seed + i for i in range(self.num_envs)]

        if len(seeds) != self.num_envs:
            raise ArgumentError(f"seed must be {self.num_envs} numbers, got {len(seeds)}")

        before = self._random or [None] * self.num_envs
        self._random = [
            random if one is None and random is not None else seeding.np_random(one)[0]
            for one, random in zip(seeds, before, strict=True)
        ]
        return self._group.reset(self._random).observation, {}

    def step(self, actions: Array) -> tuple[Array, Array, Bools, Bools, dict[str, Any]]:
        """Return observations, rewards, terminations, truncations and info.

        Raises:
            ArgumentError: Some action is not in the action space.
        """
        values = self.episodes.check_action(actions, (self.num_envs, len(self.episodes.low)))
        outcome = self._group.step(values)
        info = {"terms": outcome.terms, "reason": REASONS[outcome.reason]}
        return (
            outcome.observation,
            outcome.reward,
            outcome.terminated,
            outcome.truncated,
            info,
        )
