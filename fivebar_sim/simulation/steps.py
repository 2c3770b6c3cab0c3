"""Steps of many legs at once: commands in, the whole state of every step out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ArgumentError, DivergedError
from fivebar_sim.kinematics.stops import SPEED_LIMIT
from fivebar_sim.model import without_log
from fivebar_sim.simulation.clipping import Clipping
from fivebar_sim.simulation.limited import STATE, rollout

STEP = ("qfrc_constraint", "solver_niter")
"""What is recorded of every step besides."""

CHUNK = 50_000
"""Steps, over all legs, between two moments at which an interrupt is heard: about 0.2 s."""

WATCHED = 10_000
"""Steps of a run whose commands are known that whoever watches is shown at once: about 0.06 s."""

GLANCE = 0.2
"""Time between two moments at which whoever watches a run in the loop is shown its steps [s]."""

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
            ground (nsim, N, 0).
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

    Raises:
        ArgumentError: Poses that do not fit the model.
    """

    def __init__(
        self,
        models: mujoco.MjModel | Sequence[mujoco.MjModel],
        qpos: Array,
        nthread: int = 1,
    ) -> None:
        shared = isinstance(models, mujoco.MjModel)
        first: Any = models if shared else models[0]
        if qpos.ndim != 2 or qpos.shape[1] != first.nq:
            raise ArgumentError(f"qpos must have shape (nsim, {first.nq}), got {qpos.shape}")
        self._batch = Batch(first, len(qpos), nthread)
        if not shared:
            self._batch.set_models(list(models))
        self._batch.qpos = qpos
        self._clipping = Clipping.of([first] * len(qpos) if shared else models)
        self._sizes = first.nq, first.nv, first.nu
        ground = mujoco.mj_name2id(first, mujoco.mjtObj.mjOBJ_SENSOR, "ground")
        self._ground = None if ground < 0 else int(first.sensor_adr[ground]) + 1  # after "found"

    def advance(self, ctrl: Array) -> States:
        """Return the states of the next steps.

        Args:
            ctrl: Commands of each of them, (nsim, n, nu).

        Raises:
            ArgumentError: Commands of another shape, or that are not finite.
        """
        nq, nv, nu = self._sizes
        nsim = self._batch.nsim
        if ctrl.ndim != 3 or ctrl.shape[::2] != (nsim, nu):
            raise ArgumentError(f"ctrl must have shape ({nsim}, N, {nu}), got {ctrl.shape}")
        if not np.isfinite(ctrl).all():
            raise ArgumentError("ctrl must be finite: MuJoCo would reset the leg and go on")

        record = (STATE, *STEP) if self._ground is None else (STATE, *STEP, "sensordata")
        with without_log():
            if self._clipping is None:
                out = self._batch.rollout(ctrl.shape[1], ctrl, record=record)
            else:
                out = rollout(self._batch, self._clipping, ctrl, record)

        state = out[STATE]
        start = self._ground
        ground = state[..., :0]
        if start is not None:
            ground = out["sensordata"][..., [start, start + 2]]

        return States(
            time=state[..., 0],
            qpos=state[..., 1 : 1 + nq],
            qvel=state[..., 1 + nq : 1 + nq + nv],
            # A step that keeps a torque limit may have been sent another command.
            ctrl=np.ascontiguousarray(ctrl),
            ground=ground,
            constraint=out["qfrc_constraint"],
            iterations=out["solver_niter"].max(axis=-1),  # over the islands
            warnings=self._batch.warning[..., 1].sum(axis=1),  # (last info, count) of each kind
        )

    def nothing(self, steps: int) -> States:
        """Return room for the states of some steps, to be filled."""
        nq, nv, nu = self._sizes
        nsim = self._batch.nsim
        sizes = (nq, nv, nu, 0 if self._ground is None else 2, nv)
        fields = (np.empty((nsim, steps, size)) for size in sizes)
        iterations: Any = np.empty((nsim, steps), dtype=np.int32)
        warnings: Any = np.zeros(nsim, dtype=np.int64)
        return States(np.empty((nsim, steps)), *fields, iterations=iterations, warnings=warnings)


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
    legs = Legs(models, qpos, nthread)
    parts = []
    if ctrl.ndim != 3:
        legs.advance(ctrl)
    for part in _chunks(ctrl, CHUNK // max(len(ctrl), 1) if watch is None else WATCHED):
        parts.append(legs.advance(part))
        if watch is not None:
            watch(parts[-1])
    return States.joined(parts)


def _chunks(ctrl: Array, length: int) -> Iterator[Array]:
    """Yield some steps after the other, so that Ctrl-C is heard in between."""
    length = max(1, length)
    for start in range(0, ctrl.shape[1], length):
        yield ctrl[:, start : start + length]


def simulate_asking(
    models: mujoco.MjModel | Sequence[mujoco.MjModel],
    qpos: Array,
    steps: int,
    ask: Callable[[States], Array | None],
    nthread: int = 1,
    watch: Watch | None = None,
) -> States:
    """Return the states of legs whose commands depend on how they move.

    Args:
        models: One model for all simulations, or one each (of one structure and timestep).
        qpos: Start poses, (nsim, nq).
        steps: N.
        ask: Given the states so far, none at first, returns the commands of the next n steps,
            (nsim, n, nu), n as it likes; None ends the run early.
        nthread: Threads; 0 is one for every processor.
        watch: Is shown the states as they come.

    Raises:
        ArgumentError: Shapes that do not fit, or commands that are not finite.
    """
    legs = Legs(models, qpos, nthread)
    states = legs.nothing(steps)
    k = 0
    shown = 0
    last = time.monotonic()

    while k < steps:
        ctrl = ask(states.part(slice(k)))
        if ctrl is None:
            break
        part = legs.advance(ctrl[:, : steps - k])
        n = part.time.shape[1]
        for whole, piece in zip(states[:-1], part[:-1], strict=True):
            whole[:, k : k + n] = piece
        states = states._replace(warnings=part.warnings)
        k = k + n
        if watch is not None and (time.monotonic() - last >= GLANCE or k == steps):
            watch(states.part(slice(shown, k)))
            shown = k
            last = time.monotonic()
    return states.part(slice(k))


def check_states(states: States, timestep: float) -> None:
    """Raise if a simulation broke down: not finite, too fast, warned about, or time stood still.

    MuJoCo stops stepping a simulation at its first warning; its later rows repeat.

    Raises:
        DivergedError: With the time of the first bad step.
    """
    bad = ~_sound(states, timestep)
    if bad.any():
        k = int(np.argmax(bad.any(axis=0)))
        raise DivergedError(
            f"the simulation broke down at t = {(k + 1) * timestep:g} s: joint rates beyond "
            f"{SPEED_LIMIT:g} rad/s or a state that is not finite; try a timestep below "
            f"{timestep:g} s or softer gains",
            (k + 1) * timestep,
        )

    if states.warnings.any():
        raise DivergedError(
            f"MuJoCo gave {int(states.warnings.sum())} warnings in the last step",
            states.time.shape[1] * timestep,
        )


def is_broken(states: States, steps: slice) -> bool:
    """Return whether a simulation broke down in some of the steps."""
    return not (_moves(states.part(steps)).all() and not states.warnings.any())


def _sound(states: States, timestep: float) -> Bools:
    """Return which states, from the first step on, are finite, slow enough and on time."""
    steps = np.arange(1, states.time.shape[1] + 1)
    return (np.abs(states.time - steps * timestep) < 0.5 * timestep) & _moves(states)


def _moves(states: States) -> Bools:
    """Return which states are finite and slow enough."""
    # NaN and inf are not below the limit either.
    return np.isfinite(states.qpos).all(-1) & (np.abs(states.qvel).max(-1) < SPEED_LIMIT)
