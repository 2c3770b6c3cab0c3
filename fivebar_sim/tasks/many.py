"""Many legs or robots as one Gymnasium vector environment; this module needs Gymnasium."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np
from gymnasium.spaces import Space
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.checks import is_finite
from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.render.leg_picture import Picture
from fivebar_sim.tasks.episodes import Outcome
from fivebar_sim.tasks.pictures import check_reset_options

RENDER_MODES = ("rgb_array", "rgb_array_list")
"""One picture of all, and a picture of each."""

MODES = {mode.value: mode for mode in AutoresetMode}


class Group(Protocol):
    """What steps through episodes together; see `tasks.legs.LegGroup`."""

    over: Bools

    def reset(self, random: Sequence[np.random.Generator]) -> Outcome:
        """Start a new episode of each."""
        ...

    def restart(self, rows: NDArray[np.int64], random: Sequence[np.random.Generator]) -> Outcome:
        """Start a new episode of some."""
        ...

    def step(self, action: Array) -> Outcome:
        """Return the outcome of checked actions."""
        ...


class GroupEnv(VectorEnv[Array, Array, Any]):
    """A vector environment of a group that is stepped together: seeds, autoreset, pictures.

    Who derives from it calls `_set_up` and says what an action may be, why episodes ended, and what
    pictures are of.
    """

    MANY = "legs"
    """What there are many of, for messages."""

    metadata = {  # noqa: RUF012 - as in VectorEnv
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": list(RENDER_MODES),
        "render_fps": 50,
    }
    _group: Group

    def _set_up(
        self, spaces: tuple[Space[Array], Space[Array]], autoreset_mode: Any, period: float
    ) -> None:
        """Make the spaces of all, and begin without any generator.

        Args:
            spaces: Observation space and action space of one.
            autoreset_mode: When a new episode begins.
            period: Time between two actions [s].
        """
        self._autoreset = check_mode(autoreset_mode)
        self._picture: Picture | None = None
        self.single_observation_space, self.single_action_space = spaces
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata = {
            **self.metadata,
            "autoreset_mode": self._autoreset,
            "render_fps": 1.0 / period,
        }
        self._random: list[np.random.Generator] = []
        # What each showed last, which a reset of others leaves as it is.
        self._seen = np.zeros(self.observation_space.shape or ())

    def _checked(self, actions: Any) -> Array:
        """Return actions as an array.

        Raises:
            ArgumentError: Some action is not in the action space.
        """
        raise NotImplementedError

    def _reasons(self, outcome: Any) -> NDArray[Any]:
        """Return why each episode ended, "" where it did not."""
        raise NotImplementedError

    def _taker(self) -> Picture:
        """Return what takes pictures of one."""
        raise NotImplementedError

    def _poses(self) -> Iterable[Array]:
        """Return the pose of each."""
        raise NotImplementedError

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
            seed: Number i gets seed + i, or the i-th of a sequence; None: continue with the last
                ones.
            options: {"reset_mask": mask} resets only those with a True in the array of bools
                (n,); the others go on with their episodes.

        Raises:
            gymnasium.error.Error: A seed is not a whole number >= 0.
            ArgumentError: The number of seeds is another one, or an unknown option.
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
            ArgumentError: Some action is not in the action space; or an episode is over and
                nothing resets it.
        """
        values = self._checked(actions)
        if self._autoreset is AutoresetMode.DISABLED and self._group.over.any():
            over = np.flatnonzero(self._group.over).tolist()
            raise ArgumentError(
                f"the episodes of {self.MANY} {over} are over: reset them first, with "
                'options={"reset_mask": mask}'
            )

        outcome = self._group.step(values)
        info = {"terms": outcome.terms, "reason": self._reasons(outcome)}
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
        """Return the picture of all, row by row; or of each; None without a render mode.

        Raises:
            ConfigError: There is no working GL.
        """
        if self.render_mode is None:
            return None
        if self._picture is None:
            self._picture = self._taker()
        each = [self._picture.take(qpos) for qpos in self._poses()]
        return tuple(each) if self.render_mode == "rgb_array_list" else tiled(each)

    def close_extras(self, **kwargs: Any) -> None:
        """Free the GL context of the pictures."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    def _begin_anew(self, outcome: Outcome) -> dict[str, Any]:
        """Start a new episode of those whose episode is over; return what their ends were."""
        over = self._group.over.copy()
        rows = np.flatnonzero(over)
        final = np.full(self.num_envs, None, dtype=object)
        for row in rows.tolist():
            final[row] = outcome.observation[row].copy()

        fresh = self._group.restart(rows, self._random).observation
        self._seen = np.where(over[:, None], fresh, outcome.observation)
        terms = {name: np.where(over, term, 0.0) for name, term in outcome.terms.items()}
        ends = {"terms": terms, "reason": np.where(over, self._reasons(outcome), "")}
        return {
            "final_obs": final,
            "_final_obs": over,
            "final_info": {**ends, "_terms": over, "_reason": over},
            "_final_info": over,
        }

    def _masked(self, given: dict[str, Any]) -> NDArray[np.int64]:
        """Return those that a reset is for."""
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
            raise ArgumentError(f"reset_mask leaves {self.MANY} out that were never reset")
        return np.flatnonzero(mask)

    def _seeds(self, seed: Any) -> list[int | None]:
        """Return the seed of each."""
        if seed is None:
            return [None] * self.num_envs
        if not isinstance(seed, Sequence):
            # Called for its error: adding i to what is not a number raises another one.
            seeding.np_random(seed)
            return [seed + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ArgumentError(f"seed must be {self.num_envs} numbers, got {len(seed)}")
        return list(seed)


def check_count(num_envs: Any) -> int:
    """Return a number of environments.

    Raises:
        ArgumentError: It is none.
    """
    if not (is_finite(num_envs) and num_envs >= 1 and num_envs == int(num_envs)):
        raise ArgumentError(f"num_envs must be in [1, inf), got {num_envs!r}")
    return int(num_envs)


def _generator(seed: int | None) -> np.random.Generator:
    return seeding.np_random(seed)[0]


def check_mode(given: Any) -> AutoresetMode:
    """Return when a new episode begins.

    Raises:
        ArgumentError: None of Gymnasium's modes.
    """
    if isinstance(given, AutoresetMode):
        return given
    if not isinstance(given, str) or given not in MODES:
        raise ArgumentError(unknown("autoreset_mode", str(given), MODES))
    return MODES[given]


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
