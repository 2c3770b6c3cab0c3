"""Legs at one task, stepped by `mujoco.batch`: one leg or many at once."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from fivebar_sim import model, motion
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, UnreachableError
from fivebar_sim.scenario.scenes import Ground
from fivebar_sim.tasks import Randomise, Task
from fivebar_sim.tasks.episodes import Episodes, Outcome
from fivebar_sim.tasks.stepped import SteppedLegs

STARTS = 32
"""Start poses per leg; each episode draws one of them."""


class LegGroup:
    """Legs that are stepped together through episodes; each starts a new one after its end.

    Args:
        task: The task.
        seeds: Seed of each leg's draw from `randomise`, (n,).
        randomise: Ranges of the numbers in which legs differ; None for equal legs.
        nthread: Threads; 0 is one for every processor.

    Attributes:
        task: The task, with its path spelt out.
        drawn: The task with each leg's own numbers, n of them.
        models: Each leg's model; the legs are stepped with copies.
        episodes: The legs' episodes.
        over: Whether each leg's episode is over, (n,).

    Raises:
        UnreachableError: A leg cannot follow the path.
    """

    def __init__(
        self,
        task: Task,
        seeds: Sequence[int],
        randomise: Randomise | None = None,
        nthread: int = 1,
    ) -> None:
        self.task = task.resolved()
        self.drawn, self.models, starts = prepare(self.task, seeds, randomise)
        self.episodes = Episodes(self.task, self.drawn, starts)
        self._legs = SteppedLegs(self.models, starts[:, 0], nthread)
        self.over = np.zeros(len(seeds), dtype=bool)
        self._random: list[np.random.Generator] = []

    @property
    def has_begun(self) -> bool:
        """Whether there are episodes to step through."""
        return bool(self._random)

    def reset(self, random: Sequence[np.random.Generator]) -> Outcome:
        """Start a new episode of every leg and return its first outcome.

        Args:
            random: A generator for each leg, for this and the following episodes.
        """
        self._random = list(random)
        self._begin(np.arange(self.episodes.size))
        return self.episodes.outcome()

    def restart(self, rows: NDArray[np.int64], random: Sequence[np.random.Generator]) -> Outcome:
        """Start a new episode of some legs; of the outcome only their rows count.

        Args:
            rows: Indices of those legs.
            random: A generator for each leg of the group.
        """
        self._random = list(random)
        self._begin(rows)
        return self.episodes.outcome(rows)

    def step(self, action: Array) -> Outcome:
        """Return the outcome of an action; a leg whose episode was over starts a new one instead.

        Args:
            action: A checked action, (n, size).
        """
        if not self.has_begun:
            raise ArgumentError("step comes after reset")
        over = np.flatnonzero(self.over)
        self.episodes.update(*self._legs.moved(self.episodes.commands(action)))
        # The action of a leg that was over is thrown away: Gymnasium's next-step autoreset.
        if over.size:
            self._begin(over)
        outcome = self.episodes.outcome()
        self.over = outcome.terminated | outcome.truncated
        return outcome

    def write(self, row: int, data: mujoco.MjData) -> None:
        """Put the state of a leg into an MjData of its model, and compute what follows from it."""
        self._legs.write(row, data)
        with model.without_log():
            mujoco.mj_forward(self.models[row], data)

    def _begin(self, rows: NDArray[np.int64]) -> None:
        random = [self._random[row] for row in rows.tolist()]
        self._legs.restart(rows, self.episodes.begin(rows, random))
        self.over[rows] = False


def prepare(
    task: Task, seeds: Sequence[int], randomise: Randomise | None
) -> tuple[list[Task], list[mujoco.MjModel], Array]:
    """Return the drawn tasks, their models and their start poses (n, STARTS, nq).

    Raises:
        UnreachableError: A leg cannot follow the path; names the seed it was drawn from.
    """
    # Equal legs share one model and one set of poses.
    if randomise is None:
        one = model_of(task), starts(task)
        return [task] * len(seeds), [one[0]] * len(seeds), np.repeat(one[1][None], len(seeds), 0)
    drawn = [randomise.drawn(task, seed) for seed in seeds]
    poses = []
    for seed, each in zip(seeds, drawn, strict=True):
        try:
            poses.append(starts(each))
        except UnreachableError as error:
            raise UnreachableError(f"the leg drawn from seed {seed}: {error}") from None
    return drawn, [model_of(each) for each in drawn], np.stack(poses)


def model_of(task: Task) -> mujoco.MjModel:
    """Return the model of a task's leg in its scene."""
    return model.build(
        task.leg,
        servo=task.servo,
        scene=task.scene,
        timestep=task.timestep,
        integrator=task.integrator,
        drive=task.drive,
    )


def starts(task: Task) -> Array:
    """Return poses at rest with the foot near the start of the task's path, (STARTS, nq).

    They fill a disc of radius `spread` evenly, from the path's start outwards, like the seeds of a
    sunflower: point i at spread sqrt(i / STARTS) in the direction i (3 - sqrt(5)) pi. On the ground
    the foot is the task's drop above the floor.

    Raises:
        UnreachableError: The leg cannot follow the path, or reach all of that disc.
    """
    steps = task.periods * task.every
    # The whole episode, so that a path which the leg cannot follow is refused here.
    wanted = motion.plan(task.leg, task.foot_path, steps, task.timestep)
    i = np.arange(STARTS)
    angle = i * (3.0 - np.sqrt(5.0)) * np.pi
    away = task.spread * np.sqrt(i / STARTS)
    feet = wanted.foot[0] + away[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    q = np.tile(wanted.q[0], (STARTS, 1))
    if task.spread > 0.0:
        q[1:] = motion.poses(task.leg, feet[1:])

    if not isinstance(task.scene, Ground):
        return q

    drop = max(task.scene.drop, model.CLEAR)
    height = [model.standing(task.leg, pose) + drop for pose in q]
    return np.concatenate([np.array(height)[:, None], q], axis=1)
