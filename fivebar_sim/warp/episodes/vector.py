"""Many legs on a device as one Gymnasium vector environment: arrays by DLPack, without a copy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Space
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from fivebar_sim import tasks
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.gym import Registered, check_reset_options, layout
from fivebar_sim.tasks import Randomise, Task
from fivebar_sim.tasks.episodes import part_at
from fivebar_sim.tasks.legs import STARTS, model_of, prepare
from fivebar_sim.warp import device as devices
from fivebar_sim.warp import possible
from fivebar_sim.warp.episodes.group import DeviceGroup
from fivebar_sim.warp.memory import check_fits
from fivebar_sim.warp.models import lean_models

LOOKED_AT = 100
"""Steps on a card after which actions out of bounds are found, at the latest: it is waited for."""

OTHERS = 40
"""Numbers of a leg beside its poses, actions and observations, about."""


class DeviceVectorEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Registered, VectorEnv[Any, Any, Any]
):
    """Many legs with one task on a device; leg i is `LegVectorEnv`'s in single precision.

    Seeds, draws, episodes, observations and rewards are those of `LegVectorEnv`. What `reset` and
    `step` return are Warp's arrays, which torch, JAX, CuPy and NumPy take over by DLPack without a
    copy: they are written again in the next step. An action is any array of the device that knows
    DLPack. info has the "terms" by name, and the "reason" by number in `tasks.REASONS`; in mode
    "SameStep" also "final_obs" with "_final_obs", which says for which legs it counts.

    An action out of bounds raises where the device is the processor; on a card at the next reset,
    or after `LOOKED_AT` steps. Until then the middle of the bounds is taken.

    Args:
        task: The task, without noise of the sensors.
        num_envs: Number of legs n.
        device: "cuda:0", "cpu-warp".
        randomise: Ranges of each leg's random parameters; None: no randomisation.
        model_seed: Leg i draws its parameters with the seed model_seed + i.
        autoreset_mode: When a new episode begins: "NextStep" or "SameStep".

    Raises:
        ArgumentError: Not the name of a device.
        ConfigError: What no device can do, no such device, or too little memory on it.
        ExtraError: MuJoCo Warp is not installed.
        UnreachableError: A leg with its random lengths cannot follow the path.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - as in VectorEnv

    def __init__(
        self,
        task: Task,
        num_envs: int,
        device: str,
        randomise: Randomise | Mapping[str, Any] | None = None,
        model_seed: int = 0,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        devices.check_name(device)
        self.task = task.resolved()
        self._same_step = _is_same_step(autoreset_mode)
        obstacle = possible.task_obstacle(self.task)
        if obstacle is not None:
            raise ConfigError(f"no device can run {obstacle}; with device=None it runs")

        self._there = devices.opened(device)
        self.num_envs = num_envs
        _check_memory(self.task, num_envs, self._there)
        seeds = range(model_seed, model_seed + num_envs)
        self.drawn, models, starts = prepare(self.task, seeds, tasks.ranges(randomise))
        if randomise is None:
            starts = starts[:1]
        self._group = DeviceGroup(
            self.task, self.drawn, models, starts, self._there, same_step=self._same_step
        )

        self.device = device
        self.layout = layout(self.task)
        self.single_observation_space, self.single_action_space = spaces(self.task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {"autoreset_mode": autoreset_mode, "render_fps": 1.0 / self.task.period}
        self._has_begun = False
        self._steps = 0

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Return the first observations (n, size) and info.

        Args:
            seed: Leg i gets seed + i, or the i-th of a sequence; None: continue with the last
                ones.
            options: None or {}: on a device all legs are reset.

        Raises:
            gymnasium.error.Error: A seed is not a whole number >= 0.
            ArgumentError: The number of seeds is not that of the legs, an option, or an action of
                the last steps that was out of bounds.
        """
        check_reset_options(options)
        self._check_actions()
        random = {
            i: seeding.np_random(one)[0]
            for i, one in enumerate(self._seeds(seed))
            if one is not None or not self._has_begun
        }
        self._group.reset(random)
        self._has_begun = True
        return self._group.shown.observation, {}

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Return observations, rewards, terminations, truncations and info, on the device.

        Args:
            actions: An array (n, size) of floats on the device.

        Raises:
            ArgumentError: Not an array of the device of that shape; or out of bounds.
        """
        if not self._has_begun:
            raise ArgumentError("step comes after reset")
        self._take(actions)
        self._group.step()
        self._steps += 1
        if self._there.is_cpu or self._steps % LOOKED_AT == 0:
            self._check_actions()

        shown = self._group.shown
        terms = {name: shown.terms[k] for k, name in enumerate(self.task.WEIGHTS)}
        info: dict[str, Any] = {"terms": terms, "reason": shown.reason}
        if self._same_step:
            info |= {"final_obs": shown.last, "_final_obs": shown.ended}
        return shown.observation, shown.reward, shown.terminated, shown.truncated, info

    def _take(self, actions: Any) -> None:
        """Put the actions where the device looks for them."""
        wp = devices.warp()
        wanted = self._group.action
        if not hasattr(actions, "__dlpack__"):
            raise ArgumentError(f"actions must be an array that knows DLPack, got {type(actions)}")
        given = actions if isinstance(actions, wp.array) else wp.from_dlpack(actions)
        if given.shape != wanted.shape or given.dtype not in (wp.float32, wp.float64):
            raise ArgumentError(
                f"actions must be floats of shape {wanted.shape}, got {given.dtype.__name__} of "
                f"{given.shape}"
            )
        if given.device != self._there:
            raise ArgumentError(f"actions must be on {self.device}, got some on {given.device}")

        with devices.on(self._there):
            if given.dtype == wanted.dtype:
                wp.copy(wanted, given)
            else:
                wp.utils.array_cast(given, wanted)

    def _check_actions(self) -> None:
        """Raise if some action was out of bounds."""
        found = self._group.refused()
        if found is None:
            return
        row, i = divmod(found, len(self.task.bounds[0]))
        name, unit, number = part_at(self.task.actions, i)
        low, high = (float(bound[i]) for bound in self.task.bounds)
        raise ArgumentError(
            f"action {name}[{number}] of leg {row} must be in [{low:.6g}, {high:.6g}] {unit}; "
            "reset the legs"
        )

    def _seeds(self, seed: Any) -> list[int | None]:
        """Return the seed of each leg."""
        if seed is None:
            return [None] * self.num_envs
        if not isinstance(seed, Sequence):
            # Called for its error: adding i to what is not a number raises another one.
            seeding.np_random(seed)
            return [seed + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ArgumentError(f"seed must be {self.num_envs} numbers, got {len(seed)}")
        return list(seed)


def spaces(task: Task) -> tuple[Space[Any], Space[Any]]:
    """Return the observation space and the action space of one leg, in single precision."""
    size = sum(part.size for part in task.parts.values())
    low, high = (bound.astype(np.float32) for bound in task.bounds)
    return Box(-np.inf, np.inf, (size,), np.float32), Box(low, high, dtype=np.float32)


def _is_same_step(mode: AutoresetMode) -> bool:
    """Return whether new episodes begin in the same step.

    Raises:
        ConfigError: They wait for a reset.
    """
    if mode is AutoresetMode.DISABLED:
        raise ConfigError(
            'no device can wait for resets of single legs: autoreset_mode must be "NextStep" or '
            '"SameStep"'
        )
    return mode is AutoresetMode.SAME_STEP


def _check_memory(task: Task, n: int, device: Any) -> None:
    """Raise unless n legs fit into a device's memory, before any of them is made."""
    (model,) = lean_models([model_of(task)], forces=False)
    size = sum(part.size for part in task.parts.values())
    poses = STARTS * int(model.nq)
    check_fits(model, n, poses + 2 * size + OTHERS, device)
