"""Many robots that learn to walk as one Gymnasium vector environment, on `mujoco.batch`.

This module needs Gymnasium: install the extra `rl`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.render.leg_picture import HEIGHT, WIDTH, Camera, Picture
from fivebar_sim.robots import Robot
from fivebar_sim.tasks.episodes import Outcome
from fivebar_sim.tasks.many import RENDER_MODES, GroupEnv, check_count
from fivebar_sim.tasks.options import check_whole
from fivebar_sim.tasks.pictures import Pictures, check_render_mode
from fivebar_sim.walking.env import spaces
from fivebar_sim.walking.episodes.episode import check_action
from fivebar_sim.walking.episodes.group import WalkGroup
from fivebar_sim.walking.episodes.options import task_of


class WalkVectorEnv(GroupEnv):
    """Many robots with one task, stepped together; robot i equals a `WalkEnv` bit for bit.

    That is WalkEnv(robot, **options), reset with seed + i, or with the i-th of the seeds. With
    randomise each draws its friction, mass and delay anew for each of its episodes. info has the
    reward's "terms" by name and the "reason" of each end, "" for the other robots.

    A robot whose episode ended begins a new one in the next step and ignores that step's action
    ("NextStep"), or in the same step, whose observation is then the first of the new episode and
    whose info has the last one in "final_obs" ("SameStep"), or waits for a reset ("Disabled").

    Args:
        robot: A preset's name, a TOML file, or a `Robot`.
        num_envs: Number of robots n.
        nthread: Number of threads; 0: one for every processor.
        autoreset_mode: When a new episode begins: "NextStep", "SameStep" or "Disabled".
        max_episode_steps: Control periods after which an episode is truncated; None: as many as
            the task's duration has.
        render_mode: "rgb_array" for one picture with all robots, "rgb_array_list" for a picture of
            each, or None.
        width: Width of a robot's picture [pixels].
        height: Height of a robot's picture [pixels].
        camera: Where the camera stands, as in `WalkEnv`.
        options: Attributes of `WalkTask`, as in `WalkEnv`.

    Raises:
        ArgumentError: An unknown option, a value of the wrong type or out of range, or less than
            one robot.
        ConfigError: An unknown preset, or a file with an illegal value.
    """

    MANY = "robots"

    def __init__(
        self,
        robot: str | Robot = "q8bot",
        num_envs: int = 1,
        nthread: int = 0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        width: int = WIDTH,
        height: int = HEIGHT,
        camera: Camera | Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        self.num_envs = check_count(num_envs)
        check_render_mode(render_mode, RENDER_MODES)
        self.render_mode = render_mode
        self._pictures = Pictures.of(camera, width, height)
        threads = check_whole("nthread", nthread, 0)

        task = task_of(robot, options)
        if max_episode_steps is not None:
            steps = check_whole("max_episode_steps", max_episode_steps, 1)
            shorter = min(steps, task.periods) * task.period
            task = task_of(robot, {**options, "duration": shorter})

        self.task = task
        self._walkers = WalkGroup(task, self.num_envs, threads)
        self._group = self._walkers
        self._set_up(spaces(), autoreset_mode, task.period)

    @property
    def robots(self) -> list[Robot]:
        """The robot of each one's episode, drawn if the task says so."""
        return self._walkers.robots

    def _checked(self, actions: Any) -> Array:
        if self.closed:
            raise ArgumentError("the environment is closed: make another one")
        return check_action(actions, self.num_envs)

    def _reasons(self, outcome: Outcome) -> NDArray[Any]:
        return outcome.reason

    def _taker(self) -> Picture:
        return self._pictures.of_robot(self._walkers.models[0], self.task.robot)

    def _poses(self) -> Iterable[Array]:
        if not self._walkers.has_begun:
            raise ArgumentError("render comes after reset")
        return self._walkers.qpos
