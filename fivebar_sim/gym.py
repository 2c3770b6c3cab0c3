"""One leg as a Gymnasium environment; importing this registers the tasks as fivebar/Track-v0, ...

Only this module and `vector` need Gymnasium: install the extra `rl`.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box, Space

from fivebar_sim import tasks
from fivebar_sim.arrays import Array
from fivebar_sim.render.leg_picture import HEIGHT, WIDTH, Camera, Picture
from fivebar_sim.tasks import REASONS, Randomise, Task, options
from fivebar_sim.tasks.episodes import Episodes, Outcome
from fivebar_sim.tasks.legs import LegGroup
from fivebar_sim.tasks.pictures import Pictures, check_render_mode, check_reset_options

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


class Registered:
    """What knows how Gymnasium makes it, with the length of its episodes, as JSON can hold it.

    A base of both environments, before Gymnasium's own: `gymnasium.make` sets their `spec`.
    """

    task: Task
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """How `gymnasium.make` or `make_vec` makes this environment; None unless one did.

        Options that are objects become tables, from which it makes the same ones.
        """
        return self._spec

    @spec.setter
    def spec(self, value: EnvSpec | None) -> None:
        kept = copy.copy(value)
        if kept is not None:
            kept.kwargs = {name: options.plain(each) for name, each in kept.kwargs.items()}
            kept.max_episode_steps = self.task.periods
        self._spec = kept


class LegEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Registered, gymnasium.Env[Array, Array]
):
    """One leg with one task.

    Observations are the task's `parts` one after the other (`layout` says where), actions its
    `actions` within their bounds, both in SI units and radians; nothing but rounding is clipped.
    `gymnasium.wrappers.RescaleAction` makes actions of [-1, 1]. info has the reward's "terms" by
    name and the "reason" why the episode ended, "" before its end. A copy, also a pickled one, goes
    on with the same bits.

    Args:
        task: "track", "stand", "hop", "gait", or a Task.
        render_mode: "rgb_array" or None.
        randomise: Ranges of the leg's random parameters, or a table of them; None: no
            randomisation.
        model_seed: Seed of the random parameters.
        width: Width of a picture [pixels].
        height: Height of a picture [pixels].
        camera: Where the camera stands: a `Camera`, or a table of azimuth, elevation [deg],
            distance and lookat [m]; None for its defaults.
        task_options: The task's keywords: leg, servo, action, period ...; leg, servo, path and
            sensors also as tables with the keys of scenarios.

    Raises:
        ArgumentError: Unknown task, option or render mode, or a value of the wrong type.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012 - as in Env

    def __init__(
        self,
        task: str | Task | Mapping[str, Any],
        render_mode: str | None = None,
        randomise: Randomise | Mapping[str, Any] | None = None,
        model_seed: int = 0,
        width: int = WIDTH,
        height: int = HEIGHT,
        camera: Camera | Mapping[str, Any] | None = None,
        **task_options: Any,
    ) -> None:
        check_render_mode(render_mode, RENDER_MODES)
        self._pictures = Pictures.of(camera, width, height)
        ranges = tasks.ranges(randomise)
        seed = options.check_whole("model_seed", model_seed, 0)
        self._group = LegGroup(tasks.task(task, **task_options), [seed], ranges)
        self.render_mode = render_mode
        # Made by the first `render`: training without pictures needs no GL.
        self._picture: Picture | None = None
        self._data: mujoco.MjData | None = None
        self.task = self._group.task
        self.episodes = self._group.episodes
        self.observation_space, self.action_space = spaces(self.episodes)
        self.layout = layout(self.task)
        self.metadata = {**self.metadata, "render_fps": 1.0 / self.task.period}

    def __getstate__(self) -> dict[str, Any]:
        # GL contexts cannot be copied, and MjData is made from the state again.
        return {**self.__dict__, "_picture": None, "_data": None}

    @property
    def model(self) -> mujoco.MjModel:
        """The leg's MuJoCo model; the leg itself is stepped with a copy."""
        return self._group.models[0]

    @property
    def data(self) -> mujoco.MjData:
        """The leg's state, with all that follows from it; writing into it changes nothing."""
        if self._data is None:
            self._data = mujoco.MjData(self.model)
        self._group.write(0, self._data)
        return self._data

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Return the first observation of an episode and info.

        Args:
            seed: Seed of this and the following episodes; None: continue with the last one.
            options: None or {}: a reset has no options.

        Raises:
            gymnasium.error.Error: The seed is not a whole number >= 0.
            ArgumentError: An option.
        """
        check_reset_options(options)
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
        """Return a picture of the leg, (height, width, 3); None without a render mode.

        Raises:
            ConfigError: There is no working GL.
        """
        if self.render_mode is None:
            return None
        if self._picture is None:
            self._picture = self._pictures.of_leg(self.model, self.task.leg)
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
    """Register every task, for one leg and for many, and that of a robot; twice is harmless."""
    for kind in tasks.KINDS:
        name = f"fivebar/{kind.capitalize()}-v0"
        # Gymnasium warns when a name is registered twice.
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="fivebar_sim.gym:LegEnv",
                vector_entry_point="fivebar_sim.vector:vector_env",
                kwargs={"task": kind},
            )

    if "fivebar/Walk-v0" not in gymnasium.registry:
        gymnasium.register(
            "fivebar/Walk-v0",
            entry_point="fivebar_sim.walking.env:WalkEnv",
            vector_entry_point="fivebar_sim.walking.episodes.vector:WalkVectorEnv",
        )


register()
