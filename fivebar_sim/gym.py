"""One leg as a Gymnasium environment; importing this registers the tasks as fivebar/Track-v0, ...

Only this module and `vector` need Gymnasium: install the extra `rl`.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Space

from fivebar_sim import tasks
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.render.leg_picture import LegPicture
from fivebar_sim.tasks import REASONS, Randomise, Task
from fivebar_sim.tasks.episodes import Episodes, Outcome
from fivebar_sim.tasks.legs import LegGroup

RENDER_MODES = ("rgb_array",)


def spaces(episodes: Episodes) -> tuple[Space[Array], Space[Array]]:
    """Return the observation space and the action space of one leg."""
    size = sum(part.size for part in episodes.task.parts.values())
    seen: Any = Box(-np.inf, np.inf, (size,), np.float64)
    acted: Any = Box(episodes.low, episodes.high, dtype=np.float64)
    return seen, acted


def layout(task: Task) -> dict[str, slice]:
    """Return the slice of an observation that holds each of its parts."""
    found = {}
    start = 0
    for name, part in task.parts.items():
        found[name] = slice(start, start + part.size)
        start += part.size
    return found


class LegEnv(gymnasium.Env[Array, Array]):
    """One leg with one task.

    Observations are the task's `parts` one after the other (`layout` says where), actions its
    `actions` within their bounds, both in SI units and radians; nothing but rounding is clipped.
    `gymnasium.wrappers.RescaleAction` makes actions of [-1, 1]. info has the reward's "terms" by
    name and the "reason" why the episode ended, "" before its end.

    Args:
        task: "track", "stand", "hop", "gait", or a Task.
        render_mode: "rgb_array" or None.
        randomise: Ranges of the leg's random parameters; None: no randomisation.
        model_seed: Seed of the random parameters.
        options: The task's keywords: leg, servo, action, period ...

    Raises:
        ArgumentError: Unknown task, option or render mode.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012 - as in Env

    def __init__(
        self,
        task: str | Task,
        render_mode: str | None = None,
        randomise: Randomise | None = None,
        model_seed: int = 0,
        **options: Any,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ArgumentError(unknown("render_mode", str(render_mode), RENDER_MODES))
        self._group = LegGroup(tasks.task(task, **options), [model_seed], randomise)
        self.render_mode = render_mode
        # Made by the first `render`: training without pictures needs no GL.
        self._picture = None
        self.task = self._group.task
        self.episodes = self._group.episodes
        self.observation_space, self.action_space = spaces(self.episodes)
        self.layout = layout(self.task)
        self.metadata = {**self.metadata, "render_fps": 1.0 / self.task.period}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Return the first observation of an episode and info.

        Args:
            seed: Seed of this and the following episodes; None: continue with the last one.
            options: Unused.

        Raises:
            gymnasium.error.Error: The seed is not a whole number >= 0.
        """
        super().reset(seed=seed)
        return _row(self._group.reset([self.np_random]))[0], {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Return observation, reward, terminated, truncated and info after a control period.

        Raises:
            ArgumentError: The action is not in the action space.
        """
        values = self.episodes.check_action(action, self.episodes.low.shape)
        outcome = self._group.step(values[None])
        observation, info = _row(outcome)
        over = bool(outcome.terminated[0]), bool(outcome.truncated[0])
        return observation, float(outcome.reward[0]), *over, info

    def render(self) -> Any:
        """Return a picture of the leg, (480, 640, 3); None without a render mode.

        Raises:
            ConfigError: There is no working GL.
        """
        if self.render_mode is None:
            return None
        if self._picture is None:
            self._picture = LegPicture(self._group.model, self.task.leg)
        return self._picture.take(self.episodes.qpos[0])

    def close(self) -> None:
        """Free the GL context of the pictures."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None


def _row(outcome: Outcome) -> tuple[Array, dict[str, Any]]:
    """Return observation and info of the only leg of a group."""
    info = {
        "terms": {name: float(term[0]) for name, term in outcome.terms.items()},
        "reason": str(REASONS[outcome.reason[0]]),
    }
    return outcome.observation[0], info


def register() -> None:
    """Register every task with Gymnasium, for one leg and for many; twice is harmless."""
    for kind in tasks.KINDS:
        name = f"fivebar/{kind.capitalize()}-v0"
        # Gymnasium warns when a name is registered twice.
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="fivebar_sim.gym:LegEnv",
                vector_entry_point="fivebar_sim.vector:LegVectorEnv",
                kwargs={"task": kind},
            )


register()
