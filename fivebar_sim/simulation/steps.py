"""Steps of many legs at once: commands in, the whole state of every step out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ArgumentError, DivergedError
from fivebar_sim.kinematics.stops import SPEED_LIMIT
from fivebar_sim.model import friction_law, without_log
from fivebar_sim.model.gears import Gears, rubbed, spread
from fivebar_sim.simulation.lean import lean, recorded_columns, without_clock
from fivebar_sim.simulation.limits.alone import Alone
from fivebar_sim.simulation.limits.clipping import Clipping
from fivebar_sim.simulation.limits.limited import STATE, rollout

STEP = ("qfrc_constraint", "solver_niter")
"""What is recorded of every step besides."""

CHUNK = 50_000
"""Steps, over all legs, between two moments at which an interrupt is heard: about 0.2 s."""

WATCHED = 10_000
"""Steps of a run whose commands are known that whoever watches is shown at once: about 0.06 s."""

Watch = Callable[["States"], None]
"""Is shown the states of some steps after the other while they are simulated."""


class States(NamedTuple):
    """The states after each step, k = 0..N-1 at the time (k + 1) h.

    Attributes:
        time: [s], (nsim, N).
        qpos: [rad] (hinges), (nsim, N, nq).
        qvel: [rad/s], (nsim, N, nv).
        ctrl: The commands of the step, (nsim, N, nu).
        ground: Force (x, z) of the ground on the foot during the step [N], (nsim, N, 2); without a
            ground (nsim, N, 0); of a robot (x, y, z) on each foot, (nsim, N, 12), and on uneven
            ground its torque [N m] and its place [m], (nsim, N, 36).
        constraint: Joint forces of all constraints during the step [N m] (hinges), (nsim, N, nv).
        iterations: Of the constraint solver in the step, (nsim, N).
        warnings: MuJoCo's warnings of each simulation so far, (nsim,).
    """

    time: Array
    qpos: Array
    qvel: Array
    ctrl: Array
    ground: Array
    constraint: Array
    iterations: Array
    warnings: Array

    @classmethod
    def joined(cls, parts: Sequence[States]) -> States:
        """Return the states of steps that follow each other as one."""
        *fields, warnings = zip(*parts, strict=True)
        return cls(*(np.concatenate(field, axis=1) for field in fields), warnings=warnings[-1])

    def part(self, steps: slice) -> States:
        """Return some of the steps, as views."""
        return States(*(field[:, steps] for field in self[:-1]), warnings=self.warnings)

    def by_columns(self) -> States:
        """Return the same with the steps of each number one after the other in memory."""
        # What is worked out of them then runs through memory in one go, two or three times as fast.
        names = ("time", "qpos", "qvel", "ctrl", "ground", "constraint")
        fields = {name: getattr(self, name).swapaxes(1, -1) for name in names}
        ordered = {name: np.ascontiguousarray(each) for name, each in fields.items()}
        return self._replace(**{name: each.swapaxes(1, -1) for name, each in ordered.items()})

    def rows(self, which: slice | list[int]) -> States:
        """Return some of the simulations."""
        return States(*(field[which] for field in self))


class Legs:
    """Legs that are stepped together, begun at rest.

    Every simulation gives the same bits alone, in a batch, and on any number of threads.

    Args:
        models: One model for all simulations, or one each (of one structure and timestep).
        qpos: Start poses, (nsim, nq).
        nthread: Threads; 0 is one for every processor.
        forces: Whether anyone asks for the ground's force: not of legs of which only `moved` is.

    Raises:
        ArgumentError: Poses that do not fit the model.
    """

    def __init__(
        self,
        models: mujoco.MjModel | Sequence[mujoco.MjModel],
        qpos: Array,
        nthread: int = 1,
        *,
        forces: bool = True,
    ) -> None:
        shared = isinstance(models, mujoco.MjModel)
        kept = [models] if shared else list(models)
        # Friction that changes with load has to know the ground's force.
        loaded = any(friction_law(each) is not None for each in kept)
        stepped = lean(kept, forces=forces or loaded)
        first = stepped[0]
        if qpos.ndim != 2 or qpos.shape[1] != first.nq:
            raise ArgumentError(f"qpos must have shape (nsim, {first.nq}), got {qpos.shape}")
        everyone = stepped * len(qpos) if shared else stepped
        self._ground = recorded_columns(first)
        self._gears = Gears.of(everyone, self._ground)
        self._batch = Batch(first, len(qpos), nthread)
        if self._gears is not None:
            spread(self._batch, everyone)
        elif not shared:
            self._batch.set_models(stepped)
        self._batch.qpos = qpos
        self._ctrl = self._batch.bind("ctrl")
        self._clipping = Clipping.of(everyone)
        # One alone is looked at step by step; many are looked at together.
        single = len(qpos) == 1 and not self.whole
        self._alone = self._single(first) if single else None
        self._sizes = first.nq, first.nv, first.nu

    def _single(self, model: mujoco.MjModel) -> Alone:
        """Return the one simulation that there is."""
        friction = None if self._gears is None else self._batch.expand("dof_frictionloss")
        return Alone(model, self._batch, self._clipping, friction)

    def advance(self, ctrl: Array) -> States:
        """Return the states of the next steps.

        Args:
            ctrl: Commands of each of them, (nsim, n, nu).

        Raises:
            ArgumentError: Commands of another shape, or that are not finite.
        """
        record = (STATE, *STEP, "sensordata") if self._ground else (STATE, *STEP)
        out = self._taken(ctrl, record)
        # A step that keeps a torque limit may have been sent another command.
        arrays = [out[STATE], *(out[name] for name in record[1:])]
        return self.states(arrays, ctrl.copy(), self._batch.warning)

    def moved(self, ctrl: Array) -> tuple[Array, Array, NDArray[Any]]:
        """Return qpos and qvel after the next steps, (nsim, n, nq), and the warnings so far.

        Arguments and errors are those of `advance`.
        """
        state = self._taken(ctrl, (STATE,))[STATE]
        nq, nv, _ = self._sizes
        warnings = self._batch.warning[..., 1].sum(axis=1)
        return state[..., 1 : 1 + nq], state[..., 1 + nq : 1 + nq + nv], warnings

    def _taken(self, ctrl: Array, record: Sequence[Any]) -> dict[Any, Array]:
        """Return what is recorded of the next steps; see `advance`."""
        nu = self._sizes[2]
        nsim = self._batch.nsim
        if ctrl.ndim != 3 or ctrl.shape[::2] != (nsim, nu):
            raise ArgumentError(f"ctrl must have shape ({nsim}, N, {nu}), got {ctrl.shape}")
        if not np.isfinite(ctrl).all():
            raise ArgumentError("ctrl must be finite: MuJoCo would reset the leg and go on")

        with without_log(), without_clock():
            if self._gears is None:
                return self._rollout(ctrl, record)
            return rubbed(self._batch, self._gears, ctrl, record, self._rollout)

    def _rollout(self, ctrl: Array, record: Sequence[Any]) -> dict[Any, Array]:
        """Return what is recorded of the next steps, with torque limits kept."""
        if self._alone is not None:
            return self._alone.rollout(ctrl, record)
        if self._clipping is None:
            return self._batch.rollout(ctrl.shape[1], ctrl, record=record)
        return rollout(self._batch, self._clipping, ctrl, record)

    def states(self, arrays: Sequence[Any], ctrl: Array, warnings: NDArray[Any]) -> States:
        """Return states from what `live` lists, of some steps each, (nsim, n, ...).

        Args:
            arrays: What MuJoCo has after each step.
            ctrl: The commands of each step, (nsim, n, nu).
            warnings: (last info, count) of each kind of its warnings so far, (nsim, kinds, 2).
        """
        state, constraint, iterations, *sensors = arrays
        # The state begins with the time, then come qpos and qvel.
        nq, nv, _ = self._sizes
        ground = sensors[0][..., self._ground] if self._ground else state[..., :0]
        return States(
            time=state[..., 0],
            qpos=state[..., 1 : 1 + nq],
            qvel=state[..., 1 + nq : 1 + nq + nv],
            ctrl=ctrl,
            ground=ground,
            constraint=constraint,
            iterations=iterations[..., 0],  # islands are off: one solver for all
            warnings=warnings[..., 1].sum(axis=1),
        )

    @property
    def nu(self) -> int:
        """Number of commands of a leg."""
        return self._sizes[2]

    @property
    def whole(self) -> bool:
        """Whether `once` is right: no limit is kept by a second try, and no friction changes."""
        return self._clipping is None and self._gears is None

    def live(self) -> list[NDArray[Any]]:
        """Return what MuJoCo has now: state, constraint, iterations, any sensors, (nsim, ...).

        They are those of the simulations themselves, and change with every step. The state ends
        with the commands.
        """
        names = (*STEP, "sensordata") if self._ground else STEP
        # The parts of the state come in the order of their bits.
        command = mujoco.mjtState.mjSTATE_CTRL.value
        before = mujoco.mjtState.mjSTATE_INTEGRATION.value & (2 * command - 1)
        size = mujoco.mj_stateSize(self._batch.model, before)
        return [self._batch.state[:, :size], *(self._batch.bind(name) for name in names)]

    def warned(self) -> NDArray[Any]:
        """Return MuJoCo's warnings of each simulation as they are now, (nsim, kinds, 2)."""
        return self._batch.warning

    def once(self, ctrl: Array) -> None:
        """Take one step with finite commands, (nsim, nu)."""
        self._ctrl[:] = ctrl
        self._batch.step()


def simulate(
    models: mujoco.MjModel | Sequence[mujoco.MjModel],
    qpos: Array,
    ctrl: Array,
    nthread: int = 1,
    watch: Watch | None = None,
) -> States:
    """Return the states of legs that start at rest and are sent a table of commands.

    Args:
        models: One model for all simulations, or one each (of one structure and timestep).
        qpos: Start poses, (nsim, nq).
        ctrl: Commands of every step, (nsim, N, nu).
        nthread: Threads; 0 is one for every processor.
        watch: Is shown the states as they come.

    Raises:
        ArgumentError: Shapes that do not fit, or commands that are not finite.
    """
    if ctrl.ndim != 3:
        Legs(models, qpos, nthread).advance(ctrl)
    parts = simulated(models, qpos, ctrl.shape[1], lambda rows: ctrl[:, rows], nthread, watch)
    return States.joined(list(parts))


def simulated(
    models: mujoco.MjModel | Sequence[mujoco.MjModel],
    qpos: Array,
    steps: int,
    ctrl: Callable[[slice], Array],
    nthread: int = 1,
    watch: Watch | None = None,
) -> Iterator[States]:
    """Yield the states of some steps after the other, so that Ctrl-C is heard in between.

    Args:
        models: As in `simulate`.
        qpos: Start poses, (nsim, nq).
        steps: N.
        ctrl: Returns the commands of some steps, (nsim, n, nu).
        nthread: Threads.
        watch: Is shown the states.

    Raises:
        ArgumentError: As in `simulate`.
    """
    legs = Legs(models, qpos, nthread)
    length = WATCHED if watch is not None else max(1, CHUNK // max(len(qpos), 1))
    for start in range(0, steps, length):
        states = legs.advance(ctrl(slice(start, min(start + length, steps))))
        if watch is not None:
            watch(states)
        yield states


def check_states(states: States, timestep: float) -> None:
    """Raise if a simulation broke down: not finite, too fast, warned about, or time stood still.

    MuJoCo stops stepping a simulation at its first warning; its later rows repeat.

    Raises:
        DivergedError: With the time of the first bad step.
    """
    error = fault(states, timestep)
    if error is not None:
        raise error

    if states.warnings.any():
        raise DivergedError(
            f"MuJoCo gave {int(states.warnings.sum())} warnings in the last step",
            states.time.shape[1] * timestep,
        )


def fault(states: States, timestep: float, begin: int = 0) -> DivergedError | None:
    """Return the error of states that are not finite, too fast, or late, if some are.

    Args:
        states: The states of some steps.
        timestep: h [s].
        begin: Index of the first of these steps.
    """
    bad = ~_sound(states, timestep, begin)
    if not bad.any():
        return None
    k = begin + int(np.argmax(bad.any(axis=0)))
    return DivergedError(
        f"the simulation broke down at t = {(k + 1) * timestep:g} s: joint rates beyond "
        f"{SPEED_LIMIT:g} rad/s or a state that is not finite; try a timestep below "
        f"{timestep:g} s or softer gains",
        (k + 1) * timestep,
    )


def is_broken(states: States, steps: slice) -> bool:
    """Return whether a simulation broke down in some of the steps."""
    return not (moving(states.part(steps)).all() and not states.warnings.any())


def _sound(states: States, timestep: float, begin: int) -> Bools:
    """Return which states are finite, slow enough and on time."""
    steps = np.arange(begin + 1, begin + states.time.shape[1] + 1)
    return (np.abs(states.time - steps * timestep) < 0.5 * timestep) & moving(states)


def moving(states: States) -> Bools:
    """Return which states are finite and slow enough."""
    # All of them at once, in a fiftieth of the time: a run that breaks down is rare.
    if np.isfinite(states.qpos).all() and np.abs(states.qvel).max(initial=0.0) < SPEED_LIMIT:
        return np.ones(states.time.shape, dtype=bool)
    # NaN and inf are not below the limit either.
    return np.isfinite(states.qpos).all(-1) & (np.abs(states.qvel).max(-1) < SPEED_LIMIT)
