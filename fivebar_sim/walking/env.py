"""A robot that learns to walk, as a Gymnasium environment: fivebar/Walk-v0.

This module needs Gymnasium: install the extra `rl`. Importing `fivebar_sim.gym` registers it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.spaces import Box

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.render.leg_picture import HEIGHT, WIDTH, Camera, Picture
from fivebar_sim.robots import Robot
from fivebar_sim.tasks.pictures import Pictures, check_render_mode, check_reset_options
from fivebar_sim.walking.episodes.episode import MOTORS, PARTS, Episode, check_action
from fivebar_sim.walking.episodes.group import WalkGroup
from fivebar_sim.walking.episodes.options import task_of

RENDER_MODES = ("rgb_array",)


class WalkEnv(gymnasium.Env[Array, Array]):
    """A robot that is told how fast to go and to turn, and tells its eight motors their angles.

    An action in [-1, 1] moves each motor by up to `span` from its standing angle, A and E of FL,
    FR, RL, RR. Observations are `PARTS` one after the other: the commanded speed [m/s] and turning
    rate [rad/s], the gyroscope [rad/s], the direction of down in the trunk's frame, the motors'
    angles [rad] and rates [rad/s] as their sensors show them, and the last action. An episode
    ends when the robot falls. info has the reward's "terms", and the "reason" of an end.

    Args:
        robot: A preset's name, a TOML file, or a `Robot`.
        render_mode: "rgb_array" or None.
        width: Width of a picture [pixels].
        height: Height of a picture [pixels].
        camera: Where the camera stands: a `Camera`, or a table of azimuth, elevation [deg],
            distance and lookat [m]; None for its defaults.
        options: Attributes of `WalkTask`; randomise also as a table or True, its defaults.

    Raises:
        ArgumentError: An unknown option, or a value of the wrong type or out of range.
        ConfigError: An unknown preset, or a file with an illegal value.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012 - as in Env

    def __init__(
        self,
        robot: str | Robot = "q8bot",
        render_mode: str | None = None,
        width: int = WIDTH,
        height: int = HEIGHT,
        camera: Camera | Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        check_render_mode(render_mode, RENDER_MODES)
        self._pictures = Pictures.of(camera, width, height)
        self.task = task_of(robot, options)
        self.render_mode = render_mode
        # Made by the first `render`: training without pictures needs no GL.
        self._picture: Picture | None = None
        self._group = WalkGroup(self.task, 1)
        self._is_closed = False
        self.observation_space, self.action_space = spaces()
        self.metadata = {**self.metadata, "render_fps": 1.0 / self.task.period}

    def __getstate__(self) -> dict[str, Any]:
        # A GL context cannot be copied; the next `render` makes one.
        return {**self.__dict__, "_picture": None}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Return the first observation of an episode, and info.

        Args:
            seed: Seed of this and the following episodes; None: go on with the last one.
            options: None or {}: a reset has no options.
        """
        check_reset_options(options)
        super().reset(seed=seed)
        return self._group.reset([self.np_random]).observation[0], {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Return observation, reward, terminated, truncated and info after a control period.

        Raises:
            ArgumentError: An action that is not eight numbers in [-1, 1], or no episode that goes
                on.
        """
        values = check_action(action)
        if self._is_closed:
            raise ArgumentError("the environment is closed: make another one")
        if self._group.over[0]:
            raise ArgumentError("the episode is over: reset comes before the next step")
        outcome = self._group.step(values[None])
        terms = {name: float(term[0]) for name, term in outcome.terms.items()}
        info = {"terms": terms, "reason": str(outcome.reason[0])}
        over = bool(outcome.terminated[0]), bool(outcome.truncated[0])
        return outcome.observation[0], float(outcome.reward[0]), *over, info

    def render(self) -> Any:
        """Return a picture of the robot, (height, width, 3); None without a render mode.

        Raises:
            ArgumentError: There is no episode yet.
            ConfigError: There is no working GL.
        """
        if self.render_mode is None:
            return None
        if not self._group.has_begun:
            raise ArgumentError("render comes after reset")
        if self._picture is None:
            self._picture = self._pictures.of_robot(self.model, self.task.robot)
        return self._picture.take(self._group.qpos[0])

    def close(self) -> None:
        """Free the GL context of the pictures."""
        self._is_closed = True
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    @property
    def robot(self) -> Robot:
        """The robot of this episode, drawn if the task says so."""
        return self._group.robots[0]

    @property
    def model(self) -> mujoco.MjModel:
        """Its MuJoCo model; the robot itself is stepped with a copy."""
        return self._group.models[0]

    @property
    def down(self) -> Array:
        """Direction of gravity in the trunk's frame, without noise, (3,)."""
        return self.episode.down

    @property
    def theta(self) -> Array:
        """Angles of the motors, without noise [rad], (4, 2)."""
        return self.episode.theta

    @property
    def episode(self) -> Episode:
        """The episode that goes on."""
        return self._group.episodes[0]


def spaces() -> tuple[Any, Any]:
    """Return the observation space and the action space of one robot."""
    seen = Box(-np.inf, np.inf, (sum(PARTS.values()),), np.float64)
    return seen, Box(-1.0, 1.0, (len(MOTORS),), np.float64)
