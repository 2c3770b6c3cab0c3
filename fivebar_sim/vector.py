"""Many legs as one Gymnasium vector environment, on `mujoco.batch`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from fivebar_sim import tasks
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.gym import Registered, layout, spaces
from fivebar_sim.render.leg_picture import HEIGHT, WIDTH, Camera, Picture
from fivebar_sim.tasks import REASONS, Randomise, Task, options
from fivebar_sim.tasks.episodes import Outcome
from fivebar_sim.tasks.legs import LegGroup
from fivebar_sim.tasks.many import RENDER_MODES, GroupEnv, check_count, check_mode
from fivebar_sim.tasks.pictures import Pictures, check_render_mode


class LegVectorEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Registered, GroupEnv
):
    """Many legs with one task, stepped together; leg i equals a `LegEnv` of its seeds bit for bit.

    That is LegEnv(task, randomise=randomise, model_seed=model_seed + i), reset with seed + i, or
    with the i-th of the seeds. info has the reward's "terms" by name and the "reason" of each end,
    "" for the other legs.

    A leg whose episode ended begins a new one in the next step and ignores that step's action
    ("NextStep"), or in the same step, whose observation is then the first of the new episode and
    whose info has the last one in "final_obs" ("SameStep"), or waits for a reset ("Disabled").

    Args:
        task: "track", "stand", "hop", "gait", or a Task.
        num_envs: Number of legs n.
        nthread: Number of threads; 0: one for every processor.
        randomise: Ranges of each leg's random parameters, drawn once, or a table of them; None: no
            randomisation.
        model_seed: Leg i draws its parameters with the seed model_seed + i.
        autoreset_mode: When a new episode begins: "NextStep", "SameStep" or "Disabled".
        max_episode_steps: Control periods after which an episode is truncated; None: as many as
            the task's duration has.
        render_mode: "rgb_array" for one picture with all legs, "rgb_array_list" for a picture of
            each, or None.
        width: Width of a leg's picture [pixels].
        height: Height of a leg's picture [pixels].
        camera: Where the camera stands, as in `LegEnv`.
        task_options: The task's keywords, as in `LegEnv`.

    Raises:
        ArgumentError: Unknown task or option, a value of the wrong type, or less than one leg.
        UnreachableError: A leg with its random lengths cannot follow the path.
    """

    def __init__(
        self,
        task: str | Task | Mapping[str, Any],
        num_envs: int = 1,
        nthread: int = 0,
        randomise: Randomise | Mapping[str, Any] | None = None,
        model_seed: int = 0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        width: int = WIDTH,
        height: int = HEIGHT,
        camera: Camera | Mapping[str, Any] | None = None,
        **task_options: Any,
    ) -> None:
        self.num_envs = check_count(num_envs)
        check_render_mode(render_mode, RENDER_MODES)
        self._pictures = Pictures.of(camera, width, height)

        first = options.check_whole("model_seed", model_seed, 0)
        threads = options.check_whole("nthread", nthread, 0)
        wanted = _shortened(tasks.task(task, **task_options), max_episode_steps)
        seeds = range(first, first + self.num_envs)
        self._group = LegGroup(wanted, seeds, tasks.ranges(randomise), threads)
        self.render_mode = render_mode
        self.task = self._group.task
        self.episodes = self._group.episodes
        self.drawn = self._group.drawn
        self.models = self._group.models
        self.layout = layout(self.task)
        self._set_up(spaces(self.episodes), autoreset_mode, self.task.period)

    def _checked(self, actions: Any) -> Array:
        return self.episodes.check_action(actions, (self.num_envs, len(self.episodes.low)))

    def _reasons(self, outcome: Outcome) -> NDArray[Any]:
        return REASONS[outcome.reason]

    def _taker(self) -> Picture:
        return self._pictures.of_leg(self.models[0], self.task.leg)

    def _poses(self) -> Array:
        return self.episodes.qpos


def vector_env(
    task: str | Task | Mapping[str, Any],
    num_envs: int = 1,
    *,
    device: str | None = None,
    **options: Any,
) -> VectorEnv[Any, Any, Any]:
    """Return many legs as one environment: `gymnasium.make_vec` calls this.

    Args:
        task: "track", "stand", "hop", "gait", or a Task.
        num_envs: Number of legs.
        device: None for MuJoCo on the processor; "cuda:0" for a card, "cpu-warp" for what a card
            does without one.
        options: Those of `LegVectorEnv`; on a device all but nthread and pictures.

    Raises:
        FiveBarError: As `LegVectorEnv`; on a device as its environment.
    """
    if device is None:
        return LegVectorEnv(task, num_envs, **options)
    return _on_device(device, task, num_envs, **options)


def _on_device(
    device: str,
    task: str | Task | Mapping[str, Any],
    num_envs: int,
    randomise: Randomise | Mapping[str, Any] | None = None,
    model_seed: int = 0,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    max_episode_steps: int | None = None,
    **task_options: Any,
) -> VectorEnv[Any, Any, Any]:
    """Return legs on a device; see `vector_env`."""
    for name in ("nthread", "render_mode", "width", "height", "camera"):
        if task_options.pop(name, None) is not None:
            raise ArgumentError(f"no device can use {name}; with device=None it is used")
    # Slow to import, and an extra.
    from fivebar_sim.warp.episodes.vector import DeviceVectorEnv

    wanted = _shortened(tasks.task(task, **task_options), max_episode_steps)
    seed = options.check_whole("model_seed", model_seed, 0)
    n = options.check_whole("num_envs", num_envs, 1)
    return DeviceVectorEnv(wanted, n, device, randomise, seed, check_mode(autoreset_mode))


def _shortened(task: Task, steps: Any) -> Task:
    """Return a task whose episodes have at most so many control periods."""
    if steps is None or options.check_whole("max_episode_steps", steps, 1) >= task.periods:
        return task
    return tasks.task(task, duration=int(steps) * task.period)
