"""Robots that learn to walk, stepped together by `mujoco.batch`: one or many at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fivebar_sim import model
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ArgumentError
from fivebar_sim.kinematics.stops import SPEED_LIMIT
from fivebar_sim.robots import Floor, Robot
from fivebar_sim.tasks.episodes import Outcome
from fivebar_sim.tasks.stepped import SteppedLegs
from fivebar_sim.walking.draws import draw_robot
from fivebar_sim.walking.episodes.episode import TERMS, Episode, Period
from fivebar_sim.walking.task import WalkTask


class WalkGroup:
    """Robots that are stepped together through episodes; each starts a new one after its end.

    Args:
        task: The task.
        count: Number of robots n.
        nthread: Threads; 0 is one for every processor.

    Attributes:
        task: The task.
        over: Whether each robot's episode is over, (n,).
        robots: The robot of each one's episode, drawn if the task says so.
        episodes: The episode of each by its index; empty before the first reset.
    """

    def __init__(self, task: WalkTask, count: int, nthread: int = 1) -> None:
        self.task = task
        self.over = np.zeros(count, dtype=bool)
        self.robots = [task.robot] * count
        self.episodes: dict[int, Episode] = {}
        self._nthread = nthread
        self._models: list[mujoco.MjModel] = []
        self._bodies: SteppedLegs | None = None
        self._random: list[np.random.Generator] = []

    @property
    def has_begun(self) -> bool:
        """Whether there are episodes to step through."""
        return bool(self.episodes)

    @property
    def models(self) -> list[mujoco.MjModel]:
        """Each robot's model; the robots are stepped with copies."""
        if not self._models:
            self._models = [_built(self.task.robot, self.task, None)] * len(self.over)
        return self._models

    @property
    def qpos(self) -> Array:
        """The present coordinates of each robot, (n, nq)."""
        return np.stack([self.episodes[row].qpos[-1] for row in range(len(self.over))])

    def reset(self, random: Sequence[np.random.Generator]) -> Outcome:
        """Start a new episode of every robot and return its first outcome.

        Args:
            random: A generator for each robot, for this and the following episodes.
        """
        return self.restart(np.arange(len(self.over)), random)

    def restart(self, rows: NDArray[np.int64], random: Sequence[np.random.Generator]) -> Outcome:
        """Start a new episode of some robots; of the outcome only their rows count.

        Args:
            rows: Indices of those robots.
            random: A generator for each robot of the group.
        """
        self._random = list(random)
        return self._outcome(self._begin(rows))

    def step(self, action: Array) -> Outcome:
        """Return the outcome of an action; a robot whose episode was over starts a new one instead.

        Args:
            action: A checked action, (n, 8).
        """
        if self._bodies is None:
            raise ArgumentError("step comes after reset")
        rows = np.flatnonzero(self.over)
        going = np.flatnonzero(~self.over)
        # The action of a robot that was over is thrown away: Gymnasium's next-step autoreset.
        ctrl = [
            self.episodes[row].held if over else self.episodes[row].commands(action[row])
            for row, over in enumerate(self.over.tolist())
        ]
        qpos, qvel, warnings = self._bodies.moved(np.stack(ctrl))
        sound = _sound(qpos, qvel, warnings)
        periods = {
            row: self.episodes[row].update(qpos[row], qvel[row], sound=bool(sound[row]))
            for row in going.tolist()
        }

        if rows.size:
            periods |= self._begin(rows)
        outcome = self._outcome(periods)
        self.over = outcome.terminated | outcome.truncated
        return outcome

    def _begin(self, rows: NDArray[np.int64]) -> dict[int, Period]:
        """Start new episodes of some robots."""
        models = [*self.models]
        first = {}
        for row in rows.tolist():
            random = self._random[row]
            if self.task.randomise is not None:
                self.robots[row], friction = draw_robot(
                    self.task.robot, self.task.randomise, random
                )
                models[row] = _built(self.robots[row], self.task, friction)
            self.episodes[row] = Episode(self.task, self.robots[row], models[row], random)
            first[row] = _first(self.episodes[row].observe())

        starts = np.stack([each.key("stand").qpos for each in models])
        self._models = models
        if self._bodies is None:
            self._bodies = SteppedLegs(models, starts, self._nthread)
        elif self.task.randomise is not None:
            self._bodies.change(models)
        self._bodies.restart(rows, starts[rows])
        self.over[rows] = False
        return first

    def _outcome(self, periods: dict[int, Period]) -> Outcome:
        """Return the outcome of some robots as arrays; the others' rows do not count."""
        some = next(iter(periods.values()))
        blank = _first(np.zeros_like(some.observation))
        every = [periods.get(row, blank) for row in range(len(self.over))]

        return Outcome(
            observation=np.stack([each.observation for each in every]),
            reward=np.array([each.reward for each in every]),
            terms={name: np.array([each.terms[name] for each in every]) for name in TERMS},
            terminated=np.array([each.terminated for each in every]),
            truncated=np.array([each.truncated for each in every]),
            reason=np.array([each.reason for each in every]),
        )


def _first(observation: Array) -> Period:
    """Return what there is at the start of an episode: neither a reward nor an end."""
    return Period(observation, dict.fromkeys(TERMS, 0.0), False, False, "")


def _sound(qpos: Array, qvel: Array, warnings: NDArray[Any]) -> Bools:
    """Return which simulations did not break down, (n,)."""
    # A comparison with NaN is False, so NaN is unsound too.
    slow = np.abs(qvel).max(axis=(1, 2)) < SPEED_LIMIT
    return slow & np.isfinite(qpos).all(axis=(1, 2)) & (warnings == 0)


def _built(robot: Robot, task: WalkTask, friction: float | None) -> mujoco.MjModel:
    """Return the model of a robot on a floor of some friction, or of the task's."""
    floor = Floor(friction=task.friction if friction is None else friction, slope=task.slope)
    return model.build_robot(robot, floor, timestep=task.timestep)
