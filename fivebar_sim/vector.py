"""Many legs as one Gymnasium vector environment, on `mujoco.batch`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from fivebar_sim import tasks
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.checks import is_finite
from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.gym import Registered, layout, spaces
from fivebar_sim.render.leg_picture import HEIGHT, WIDTH, Camera, Picture
from fivebar_sim.tasks import REASONS, Randomise, Task, options
from fivebar_sim.tasks.episodes import Outcome
from fivebar_sim.tasks.legs import LegGroup
from fivebar_sim.tasks.pictures import Pictures, check_render_mode, check_reset_options

RENDER_MODES = ("rgb_array", "rgb_array_list")
"""One picture of all legs, and a picture of each."""

MODES = {mode.value: mode for mode in AutoresetMode}


class LegVectorEnv(  # pyright: ignore[reportIncompatibleVariableOverride]
    Registered, VectorEnv[Array, Array, Any]
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

    metadata = {  # noqa: RUF012 - as in VectorEnv
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": list(RENDER_MODES),
        "render_fps": 50,
    }

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
        if not (is_finite(num_envs) and num_envs >= 1 and num_envs == int(num_envs)):
            raise ArgumentError(f"num_envs must be in [1, inf), got {num_envs!r}")
        check_render_mode(render_mode, RENDER_MODES)
        self._pictures = Pictures.of(camera, width, height)

        self._autoreset = _mode(autoreset_mode)
        self.num_envs = int(num_envs)
        first = options.check_whole("model_seed", model_seed, 0)
        threads = options.check_whole("nthread", nthread, 0)
        wanted = _shortened(tasks.task(task, **task_options), max_episode_steps)
        seeds = range(first, first + self.num_envs)
        self._group = LegGroup(wanted, seeds, tasks.ranges(randomise), threads)
        self.render_mode = render_mode
        self._picture: Picture | None = None
        self.task = self._group.task
        self.episodes = self._group.episodes
        self.drawn = self._group.drawn
        self.models = self._group.models
        self.layout = layout(self.task)
        self.single_observation_space, self.single_action_space = spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata = {
            **self.metadata,
            "autoreset_mode": self._autoreset,
            "render_fps": 1.0 / self.task.period,
        }
        self._random: list[np.random.Generator] = []
        # What each leg showed last, which a reset of other legs leaves as it is.
        self._seen = np.zeros(self.observation_space.shape or ())

    def __getstate__(self) -> dict[str, Any]:
        # A GL context cannot be copied; the next `render` makes one.
        return {**self.__dict__, "_picture": None}

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
            options: {"reset_mask": mask} resets only the legs with a True in the array of bools
                (n,); the others go on with their episodes.

        Raises:
            gymnasium.error.Error: A seed is not a whole number >= 0.
            ArgumentError: The number of seeds is not that of the legs, or an unknown option.
        """
        rows = self._masked(check_reset_options(options, ("reset_mask",)))
        seeds = self._seeds(seed)
        before = self._random or [None] * self.num_envs
        chosen = set(rows.tolist())
        random = [
            kept if kept is not None and (one is None or i not in chosen) else _generator(one)
            for i, (one, kept) in enumerate(zip(seeds, before, strict=True))
        ]
        self._random = random

        if len(rows) == self.num_envs:
            self._seen = self._group.reset(random).observation
        else:
            fresh = self._group.restart(rows, random).observation
            self._seen = self._seen.copy()
            self._seen[rows] = fresh[rows]
        return self._seen.copy(), {}

    def step(self, actions: Array) -> tuple[Array, Array, Bools, Bools, dict[str, Any]]:
        """Return observations, rewards, terminations, truncations and info.

        Raises:
            ArgumentError: Some action is not in the action space; or a leg's episode is over and
                nothing resets it.
        """
        values = self.episodes.check_action(actions, (self.num_envs, len(self.episodes.low)))
        if self._autoreset is AutoresetMode.DISABLED and self._group.over.any():
            over = np.flatnonzero(self._group.over).tolist()
            raise ArgumentError(
                f"the episodes of legs {over} are over: reset them first, with "
                'options={"reset_mask": mask}'
            )

        outcome = self._group.step(values)
        info = {"terms": outcome.terms, "reason": REASONS[outcome.reason]}
        self._seen = outcome.observation
        if self._autoreset is AutoresetMode.SAME_STEP and self._group.over.any():
            info |= self._begin_anew(outcome)
        return (
            self._seen.copy(),
            outcome.reward,
            outcome.terminated,
            outcome.truncated,
            info,
        )

    def render(self) -> Any:
        """Return the picture of all legs, row by row; or of each; None without a render mode.

        Raises:
            ConfigError: There is no working GL.
        """
        if self.render_mode is None:
            return None
        if self._picture is None:
            self._picture = self._pictures.of_leg(self.models[0], self.task.leg)
        each = [self._picture.take(qpos) for qpos in self.episodes.qpos]
        return tuple(each) if self.render_mode == "rgb_array_list" else tiled(each)

    def close_extras(self, **kwargs: Any) -> None:
        """Free the GL context of the pictures."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    def _begin_anew(self, outcome: Outcome) -> dict[str, Any]:
        """Start a new episode of the legs whose episode is over; return what their ends were."""
        over = self._group.over.copy()
        rows = np.flatnonzero(over)
        final = np.full(self.num_envs, None, dtype=object)
        for row in rows.tolist():
            final[row] = outcome.observation[row].copy()

        fresh = self._group.restart(rows, self._random).observation
        self._seen = np.where(over[:, None], fresh, outcome.observation)
        terms = {name: np.where(over, term, 0.0) for name, term in outcome.terms.items()}
        ends = {"terms": terms, "reason": np.where(over, REASONS[outcome.reason], "")}
        return {
            "final_obs": final,
            "_final_obs": over,
            "final_info": {**ends, "_terms": over, "_reason": over},
            "_final_info": over,
        }

    def _masked(self, given: dict[str, Any]) -> NDArray[np.int64]:
        """Return the legs that a reset is for."""
        if "reset_mask" not in given:
            return np.arange(self.num_envs)

        mask = given["reset_mask"]
        fits = isinstance(mask, np.ndarray) and mask.dtype == np.bool_
        if not (fits and mask.shape == (self.num_envs,) and mask.any()):
            raise ArgumentError(
                f"reset_mask must be an array of {self.num_envs} bools, one True at least, "
                f"got {mask!r}"
            )
        if not self._random and not mask.all():
            raise ArgumentError("reset_mask leaves legs out that were never reset")
        return np.flatnonzero(mask)

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
    return DeviceVectorEnv(wanted, n, device, randomise, seed, _mode(autoreset_mode))


def _generator(seed: int | None) -> np.random.Generator:
    return seeding.np_random(seed)[0]


def _mode(given: Any) -> AutoresetMode:
    """Return when a new episode begins.

    Raises:
        ArgumentError: None of Gymnasium's modes.
    """
    if isinstance(given, AutoresetMode):
        return given
    if not isinstance(given, str) or given not in MODES:
        raise ArgumentError(unknown("autoreset_mode", str(given), MODES))
    return MODES[given]


def _shortened(task: Task, steps: Any) -> Task:
    """Return a task whose episodes have at most so many control periods."""
    if steps is None or options.check_whole("max_episode_steps", steps, 1) >= task.periods:
        return task
    return tasks.task(task, duration=int(steps) * task.period)


def tiled(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return one picture of many of one size, row by row, as square as can be; the rest is black.

    Args:
        pictures: n pictures (height, width, 3).
    """
    columns = math.ceil(math.sqrt(len(pictures)))
    rows = math.ceil(len(pictures) / columns)
    height, width, colours = pictures[0].shape
    whole = np.zeros((rows, columns, height, width, colours), np.uint8)
    for k, picture in enumerate(pictures):
        whole[k // columns, k % columns] = picture
    return whole.swapaxes(1, 2).reshape(rows * height, columns * width, colours)
