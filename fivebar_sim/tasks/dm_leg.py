"""A leg as dm_control's physics and task; import it after `gl.set_mujoco_gl()`."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from dm_control.mujoco import Physics
from dm_control.mujoco.wrapper import MjModel
from dm_control.rl import control
from dm_env import specs

from fivebar_sim.arrays import Array
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.model import without_log
from fivebar_sim.model.gears import Gears, rubbed
from fivebar_sim.simulation.lean import recorded_columns
from fivebar_sim.simulation.limits.clipping import Clipping
from fivebar_sim.simulation.limits.limited import STATE, rollout
from fivebar_sim.tasks import REASONS
from fivebar_sim.tasks.episodes import Episodes, Outcome


class _One:
    """As much of `mujoco.batch.Batch` as `clipping.rollout` needs, for one MjData.

    Attributes:
        model: The model.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.model = model
        self._data = data
        self.qpos = data.qpos[None]
        self.qvel = data.qvel[None]
        self.qacc_warmstart = data.qacc_warmstart[None]
        # Unlike the others, MjData's time is no array to be written to.
        self.time = np.array([data.time])
        self.warning = np.stack([data.warning.lastinfo, data.warning.number], axis=-1)[None]

    def rollout(
        self, nstep: int, control: Array, control_spec: int, record: Sequence[Any], ids: Any = None
    ) -> dict[Any, Any]:
        """Return what is recorded after each step, (1, nstep, ...)."""
        del ids
        data = self._data
        data.time = self.time[0]
        data.warning.lastinfo[:] = self.warning[0, :, 0]
        data.warning.number[:] = self.warning[0, :, 1]
        rows: dict[Any, list[Array]] = {item: [] for item in record}
        for k in range(nstep):
            mujoco.mj_setState(self.model, data, control[0, k], control_spec)
            mujoco.mj_step(self.model, data)
            for item, each in rows.items():
                each.append(self._read(item))

        self.time[0] = data.time
        self.warning[0, :, 0] = data.warning.lastinfo
        self.warning[0, :, 1] = data.warning.number
        return {item: np.array(each)[None] for item, each in rows.items()}

    def expand(self, name: str) -> Array:
        """Return a field of the model, (1, ...), to be written."""
        return getattr(self.model, name)[None]

    def _read(self, item: Any) -> Array:
        if isinstance(item, str):
            return np.array(getattr(self._data, item))
        state = np.empty(mujoco.mj_stateSize(self.model, int(item)))
        mujoco.mj_getState(self.model, self._data, state, int(item))
        return state


class LegPhysics(Physics):
    """A leg that is given the commands of every step before `step`, and keeps the states after it.

    Attributes:
        ctrl: Commands of the next n steps, (n, nu).
        qpos, qvel: States after each of the last n steps, (n, nq).
    """

    legacy_step = False

    ctrl: Array
    qpos: Array
    qvel: Array
    _gears: Gears | None = None

    def begin(self) -> None:
        """Begin an episode: nothing has passed through the gears yet."""
        self._gears = Gears.of([self.model.ptr], recorded_columns(self.model.ptr))

    def step(self, nstep: int = 1) -> None:
        """Take nstep steps, each with its row of ctrl; the last row is repeated."""
        # MuJoCo takes its own objects, not dm_control's wrappers of them.
        one = _One(self.model.ptr, self.data.ptr)
        ctrl = self.ctrl[np.minimum(np.arange(nstep), len(self.ctrl) - 1)][None]
        clipping = Clipping.of([one.model])

        def taken(sent: Array, record: Sequence[Any]) -> dict[Any, Any]:
            if clipping is None:
                commands = int(mujoco.mjtState.mjSTATE_CTRL)
                return one.rollout(sent.shape[1], sent, commands, record)
            return rollout(one, clipping, sent, record)

        with without_log():
            if self._gears is None:
                states = taken(ctrl, (STATE,))
            else:
                states = rubbed(one, self._gears, ctrl, (STATE,), taken)
        self.qpos, self.qvel = np.split(states[STATE][0, :, 1:], [one.model.nq], axis=1)

    @property
    def warnings(self) -> int:
        """Number of MuJoCo's warnings since the reset."""
        return int(self.data.ptr.warning.number.sum())


Random = np.random.Generator | np.random.RandomState


def _generator(random: Random) -> np.random.Generator:
    """Return a generator that takes its numbers from the same stream."""
    if isinstance(random, np.random.Generator):
        return random
    # The only way to it from a RandomState, and a public attribute of neither of them.
    return np.random.Generator(random._bit_generator)


class LegTask(control.Task):
    """One of our tasks behind dm_control's interface.

    Args:
        episodes: The episodes of one leg.
        random: Generator of starts and sensor noise.

    Attributes:
        episodes: The episodes of the leg.
        outcome: The last outcome, with its reward terms.
    """

    outcome: Outcome

    def __init__(self, episodes: Episodes, random: Random) -> None:
        self.episodes = episodes
        # Not private to all: Shimmy writes a RandomState here to seed the episodes.
        self._random = random
        self._names = list(episodes.task.parts)
        sizes = [part.size for part in episodes.task.parts.values()]
        self._cuts = np.cumsum(sizes)[:-1]

    @property
    def random(self) -> Random:
        """What starts and sensor noise are drawn from, as the wrappers of dm_control's suite ask.

        A `numpy.random.RandomState` may take its place, as in the suite.
        """
        return self._random

    @random.setter
    def random(self, value: Random) -> None:
        self._random = value

    def initialize_episode(self, physics: LegPhysics) -> None:
        """Put the leg at rest near the start of its path."""
        one = np.zeros(1, dtype=np.int64)
        physics.begin()
        physics.data.qpos[:] = self.episodes.begin(one, [_generator(self._random)])[0]
        self.outcome = self.episodes.outcome()

    def before_step(self, action: Any, physics: LegPhysics) -> None:
        """Set the commands of the control period.

        Raises:
            ArgumentError: An action that does not conform to the action spec.
        """
        values = self.episodes.check_action(action, self.episodes.low.shape)
        physics.ctrl = self.episodes.commands(values[None])[0]

    def after_step(self, physics: LegPhysics) -> None:
        """Report the period's states to the episodes."""
        warnings = np.array([physics.warnings])
        self.episodes.update(physics.qpos[None], physics.qvel[None], warnings)
        self.outcome = self.episodes.outcome()

    def action_spec(self, physics: LegPhysics) -> Any:
        """Return the shape and the bounds of actions; the name lists their parts."""
        low = self.episodes.low
        high = self.episodes.high
        # Separated by tabs, as in the specs of dm_control's own physics.
        name = "\t".join(
            f"{name}_{motor}" for name in self.episodes.task.actions for motor in MOTORS
        )
        return specs.BoundedArray(low.shape, np.float64, low, high, name)

    def observation_spec(self, physics: LegPhysics) -> OrderedDict[str, specs.Array]:
        """Return the shapes of the observation's parts."""
        parts = self.episodes.task.parts.items()
        return OrderedDict((n, specs.Array((p.size,), np.float64, n)) for n, p in parts)

    def get_observation(self, physics: LegPhysics) -> Any:
        """Return the observation's parts by name."""
        pieces = np.split(self.outcome.observation[0], self._cuts)
        return OrderedDict(zip(self._names, pieces, strict=True))

    def get_reward(self, physics: LegPhysics) -> Any:
        """Return the weighted sum of the reward terms."""
        return float(self.outcome.reward[0])

    def get_termination(self, physics: LegPhysics) -> Any:
        """Return the discount at the end of an episode, None before it."""
        # Only time ran out: the agent may bootstrap from the last state, so the discount is 1.
        if self.outcome.truncated[0]:
            return 1.0
        return 0.0 if self.outcome.terminated[0] else None

    @property
    def terms(self) -> dict[str, float]:
        """The reward terms of the last control period, by name."""
        return {name: float(term[0]) for name, term in self.outcome.terms.items()}

    @property
    def reason(self) -> str:
        """Why the episode is over: limit, flip, gap, broken, time; "" while it is not."""
        return str(REASONS[self.outcome.reason[0]])


def environment(
    model: mujoco.MjModel,
    episodes: Episodes,
    random: np.random.Generator,
    *,
    flat_observation: bool,
) -> control.Environment:
    """Return the environment of a leg's model and its episodes."""
    return control.Environment(
        LegPhysics.from_model(MjModel(model)),
        LegTask(episodes, random),
        n_sub_steps=episodes.task.every,
        flat_observation=flat_observation,
        legacy_step=False,
    )
