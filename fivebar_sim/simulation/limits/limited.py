"""Steps of legs with torque limits: those in which a limit is not kept are taken again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.simulation.limits.clipping import (
    MOST_MODES,
    Clipping,
    Integers,
    modes_of,
    number,
    settle,
)

INPUTS = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED
"""What every step is given: commands, then forces on the joints."""

STATE = (
    mujoco.mjtState.mjSTATE_TIME.value
    | mujoco.mjtState.mjSTATE_QPOS.value
    | mujoco.mjtState.mjSTATE_QVEL.value
)
"""All that the models' state is; for more kinds, of which there is none, every step looks too."""

WARMSTART = "qacc_warmstart"
"""Where the solver starts: with it and the state a step that is taken again has the same bits."""

ITERATIONS = "solver_niter"
"""Iterations of MuJoCo's solver."""

UNSOLVED = 1_000_000
"""Iterations that stand for a step whose torques were not found."""


class Stepper(Protocol):
    """As much of `mujoco.batch.Batch` as is needed here.

    Attributes:
        time, qpos, qvel, qacc_warmstart: The state of each simulation, (nsim, ...), to be written.
        warning: (last info, count) of each kind of MuJoCo's warnings, (nsim, kinds, 2).
    """

    time: Array
    qpos: Array
    qvel: Array
    qacc_warmstart: Array
    warning: NDArray[Any]

    def rollout(
        self, nstep: int, control: Array, control_spec: int, record: Sequence[Any], ids: Integers
    ) -> dict[Any, Any]:
        """Return what is recorded after each step of some simulations, (n, nstep, ...) each."""
        ...


def rollout(
    stepper: Stepper, clipping: Clipping, ctrl: Array, record: Sequence[Any]
) -> dict[Any, Array]:
    """Return what is recorded after each step, as `Batch.rollout` does, but with limits kept.

    Each simulation gives the same bits alone and beside others. One that MuJoCo warns about stops;
    its remaining records repeat.

    Args:
        stepper: The simulations.
        clipping: Their servos.
        ctrl: Commands of every step, (nsim, N, nu).
        record: What to record.
    """
    steps = ctrl.shape[1]
    wanted = tuple(dict.fromkeys([*record, STATE, WARMSTART, ITERATIONS]))
    out: dict[Any, Array] = {}
    done = np.zeros(len(ctrl), dtype=np.int64)
    span = steps

    while (ids := np.flatnonzero(done < steps)).size:
        at = done[ids, None] + np.arange(span)
        part = _Part(stepper, clipping.rows(ids), ids, wanted)
        part.take(ctrl[ids[:, None], np.minimum(at, steps - 1)], steps - done[ids])
        if not out and (part.taken == steps).all() and not part.stopped.any():
            return part.rows

        for item, rows in part.rows.items():
            whole = out.setdefault(item, np.empty((len(ctrl), steps, *rows.shape[2:]), rows.dtype))
            for row, (i, n) in enumerate(zip(ids, part.taken, strict=True)):
                whole[i, done[i] : done[i] + n] = rows[row, :n]
                if part.stopped[row]:
                    whole[i, done[i] + n :] = rows[row, n - 1]

        done[ids] = np.where(part.stopped, steps, done[ids] + part.taken)
        # Twice as far as simulations came this time: few steps are in vain, few are taken singly.
        span = int(np.clip(2.0 * part.taken.mean(), 1, steps))
    return out


class _Part:
    """The next steps of some simulations.

    Attributes:
        rows: What was recorded, (n, N, ...) each.
        taken: How many of these steps are right, (n,).
        stopped: Whether MuJoCo warned in the last of them, (n,).
    """

    rows: dict[Any, Array]
    taken: Integers
    stopped: Bools

    def __init__(
        self, stepper: Stepper, clipping: Clipping, ids: Integers, record: Sequence[Any]
    ) -> None:
        self._stepper = stepper
        self._clipping = clipping
        self._ids = ids
        self._record = record
        self._warned = stepper.warning[ids].copy()
        self._start = {
            STATE: np.concatenate(
                [stepper.time[ids, None], stepper.qpos[ids], stepper.qvel[ids]], 1
            ),
            WARMSTART: stepper.qacc_warmstart[ids],
        }
        self._nq = stepper.qpos.shape[1]
        # The motors are the last actuators.
        self._own = slice(-clipping.motors, None)
        self._joints = clipping.joints

    def take(self, ctrl: Array, most: Integers) -> None:
        """Take steps; of each simulation the first wrong one is taken again, and is the last.

        Args:
            ctrl: Commands of the steps, (n, N, nu).
            most: How many of them are wanted, (n,).
        """
        u = ctrl[..., self._own]
        everyone = np.arange(len(ctrl))
        self.rows = self._step(everyone, ctrl, np.zeros_like(u))
        q, v = self._motors(self._before())
        begun = self._clipping.begun(u, q, v)
        asked = self._clipping.ended(begun, u, q, *self._motors(self.rows[STATE]))

        wrong = (begun != asked).any(axis=-1)
        warns = self._warns(everyone)
        if not wrong.any() and not warns.any() and (most >= u.shape[1]).all():
            self.taken = np.full(len(ctrl), u.shape[1])
            self.stopped = warns
            return

        # After a warning a simulation stands still: its last step is the last that took time.
        moves = np.diff(self.rows[STATE][..., 0], axis=1, prepend=-np.inf) > 0.0
        last = moves.sum(axis=1)
        end = np.minimum(last, most)
        wrong &= np.arange(u.shape[1]) < end[:, None]
        first = np.where(wrong.any(axis=1), wrong.argmax(axis=1), end)

        self.taken = np.minimum(first + 1, end)
        self.stopped = warns & (first == last)
        # Warnings of steps that are thrown away do not count.
        self._stepper.warning[self._ids] = np.where(
            self.stopped[:, None, None], self._stepper.warning[self._ids], self._warned
        )
        if (again := np.flatnonzero(first < end)).size:
            k = first[again]
            self._retake(again, k, ctrl[again, k], begun[again, k], asked[again, k])
        # Those that were taken again stand where they ended.
        if (early := np.flatnonzero((first == end) & (end < u.shape[1]))).size:
            self._put_back(early, end[early])

    def _retake(
        self, who: Integers, k: Integers, ctrl: Array, begun: Integers, modes: Integers
    ) -> None:
        """Take step k of some simulations again, (m,), until its modes agree with its end.

        Args:
            who: Which simulations.
            k: Their steps.
            ctrl: Commands, (m, nu).
            begun: The modes that MuJoCo chose, in which the step is wrong, (m, motors).
            modes: The modes to try first, (m, motors).
        """
        clipping = self._clipping.rows(who)
        q, v = self._motors(self._before()[who, k, None])
        u = ctrl[:, None, self._own]
        left = np.arange(len(who))
        every = modes_of(clipping.motors)
        tried = np.zeros((len(who), len(every)), dtype=bool)
        tried[left, number(begun)] = True

        while left.size:
            tried[left, number(modes)] = True
            mine = clipping.rows(left)
            forced = mine.forced(modes[:, None], u[left], q[left], v[left])
            rows = self._again(who[left], k[left], ctrl[left], forced)
            asked = mine.ended(modes[:, None], u[left], q[left], *self._motors(rows[STATE]))[:, 0]
            wrong = (asked != modes).any(axis=-1)
            hopeless = wrong & (tried[left].sum(axis=1) >= MOST_MODES)
            for i in left[hopeless].tolist():
                self._settle(who[[i]], k[[i]], ctrl[[i]])

            wrong &= ~hopeless
            left = left[wrong]
            modes = asked[wrong]
            # One that was tried already would be tried for ever: the first that was not is next.
            known = tried[left, number(modes)]
            modes = np.where(known[:, None], every[tried[left].argmin(axis=1)], modes)

        self.stopped[who] = self._warns(who)

    def _settle(self, one: Integers, k: Integers, ctrl: Array) -> None:
        """Take step k of one simulation, (1,), with the constant torques that it ends with."""
        clipping = self._clipping.rows(one)
        q, v = self._motors(self._before()[one, k, None])
        limit = clipping.limit[0, 0]

        def asked(torque: Array) -> Array:
            rows = self._again(one, k, ctrl, clipping.constant(torque[None, None], q, v))
            return clipping.asked(ctrl[:, None, self._own], q, *self._motors(rows[STATE]))[0, 0]

        if not settle(asked, limit):
            # Nothing else is known of this step than that its equations are not solved.
            self.rows[ITERATIONS][one, k] = UNSOLVED

    def _again(self, who: Integers, k: Integers, ctrl: Array, forced: Array) -> dict[Any, Array]:
        """Take step k of some simulations again, (m,), keep and return what is recorded."""
        self._put_back(who, k)
        motors = self._clipping.motors
        pushes = ctrl[:, None, : ctrl.shape[-1] - motors]
        sent = np.concatenate([pushes, forced[..., :motors]], axis=-1)
        rows = self._step(who, sent, forced[..., motors:])
        for item, each in rows.items():
            self.rows[item][who, k] = each[:, 0]
        return rows

    def _before(self) -> Array:
        """Return the state before each step, (n, N, 1 + nq + nv)."""
        if self.rows[STATE].shape[1] == 1:
            return self._start[STATE][:, None]
        return np.concatenate([self._start[STATE][:, None], self.rows[STATE][:, :-1]], axis=1)

    def _motors(self, state: Array) -> tuple[Array, Array]:
        """Return motor angles and rates in some states, (..., motors) each."""
        qpos = state[..., 1 : 1 + self._nq]
        qvel = state[..., 1 + self._nq :]
        return qpos[..., self._joints], qvel[..., self._joints]

    def _step(self, who: Integers, ctrl: Array, lacks: Array) -> dict[Any, Array]:
        """Return what is recorded of steps with torques on top at the motors, (m, N, motors)."""
        forces = np.zeros((*ctrl.shape[:2], self._start[WARMSTART].shape[-1]))
        forces[..., self._joints] = lacks
        given = np.concatenate([ctrl, forces], axis=-1)
        ids = self._ids[who]
        return self._stepper.rollout(ctrl.shape[1], given, int(INPUTS), self._record, ids)

    def _put_back(self, who: Integers, k: Integers) -> None:
        """Put some simulations into the states before their steps k, (m,)."""
        first = (k == 0)[:, None]
        state, warm = (
            np.where(first, self._start[item][who], self.rows[item][who, k - 1])
            for item in (STATE, WARMSTART)
        )
        ids = self._ids[who]
        self._stepper.time[ids] = state[:, 0]
        self._stepper.qpos[ids] = state[:, 1 : 1 + self._nq]
        self._stepper.qvel[ids] = state[:, 1 + self._nq :]
        self._stepper.qacc_warmstart[ids] = warm

    def _warns(self, who: Integers) -> Bools:
        """Return whether MuJoCo has warned about some simulations since the start, (m,)."""
        return (self._stepper.warning[self._ids[who]] != self._warned[who]).any(axis=(1, 2))
