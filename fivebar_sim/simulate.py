"""Steps of many legs at once: setpoints in, the whole state of every step out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, DivergedError

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
"""What is recorded of every step: time, qpos, qvel."""


CHUNK = 50_000
"""Steps, over all legs, between two moments at which an interrupt is heard: about 0.2 s."""


class States(NamedTuple):
    """The states after each step, k = 0..N-1 at the time (k + 1) h.

    Attributes:
        time: [s], (nsim, N).
        qpos: [rad] (hinges), (nsim, N, nq).
        qvel: [rad/s], (nsim, N, nv).
        warnings: MuJoCo's warnings of each simulation, (nsim,).
    """

    time: Array
    qpos: Array
    qvel: Array
    warnings: Array


def simulate(
    models: mujoco.MjModel | Sequence[mujoco.MjModel],
    qpos: Array,
    ctrl: Array,
    nthread: int = 1,
) -> States:
    """Return the states of legs that start at rest and follow their setpoints.

    Every simulation gives the same bits alone, in a batch, and on any number of threads.

    Args:
        models: One model for all simulations, or one each (of one structure and timestep).
        qpos: Start poses, (nsim, nq).
        ctrl: Setpoints of every step, (nsim, N, nu).
        nthread: Threads; 0 is one for every processor.

    Raises:
        ArgumentError: Shapes that do not fit, or setpoints that are not finite.
    """
    shared = isinstance(models, mujoco.MjModel)
    first: Any = models if shared else models[0]
    nsim, nq = len(qpos), first.nq
    if qpos.shape != (nsim, nq) or ctrl.ndim != 3 or ctrl.shape[::2] != (nsim, first.nu):
        raise ArgumentError(
            f"qpos must have shape (nsim, {nq}) and ctrl (nsim, N, {first.nu}), "
            f"got {qpos.shape} and {ctrl.shape}"
        )
    if not np.isfinite(ctrl).all():
        raise ArgumentError("ctrl must be finite: MuJoCo would reset the leg and go on")
    batch = Batch(first, nsim, nthread)
    if not shared:
        batch.set_models(list(models))
    batch.qpos = qpos
    with _warnings_kept():
        state = np.concatenate(list(_chunks(batch, ctrl)), axis=1)
    return States(
        time=state[..., 0],
        qpos=state[..., 1 : 1 + nq],
        qvel=state[..., 1 + nq : 1 + nq + first.nv],
        warnings=batch.warning[..., 1].sum(axis=1),  # (last info, count) of each kind
    )


def _chunks(batch: Batch, ctrl: Array) -> Iterator[Array]:
    """Yield the states of some steps after the other, so that Ctrl-C is heard in between."""
    length = max(1, CHUNK // len(ctrl))
    for start in range(0, ctrl.shape[1], length):
        part = ctrl[:, start : start + length]
        yield batch.rollout(part.shape[1], part, record=(STATE,))[STATE]


@contextmanager
def _warnings_kept() -> Iterator[None]:
    """Keep MuJoCo from printing warnings and logging them in the working directory.

    They are counted in `States.warnings`.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


SPEED_LIMIT = 1e4
"""Joint rate beyond which a simulation has broken down [rad/s]: a hundred thousand rpm."""


def check(states: States, timestep: float) -> None:
    """Raise if a simulation broke down: not finite, too fast, warned about, or time stood still.

    MuJoCo stops stepping a simulation at its first warning; its later rows repeat.

    Raises:
        DivergedError: With the time of the first bad step.
    """
    steps = np.arange(1, states.time.shape[1] + 1)
    on_time = np.abs(states.time - steps * timestep) < 0.5 * timestep
    finite = np.isfinite(states.qpos).all(-1) & np.isfinite(states.qvel).all(-1)
    slow = np.abs(np.nan_to_num(states.qvel, nan=np.inf)).max(-1) < SPEED_LIMIT
    bad = ~(on_time & finite & slow)
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
            float(steps[-1] * timestep),
        )
