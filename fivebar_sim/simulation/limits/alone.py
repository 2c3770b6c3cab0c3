"""Steps of one leg or robot that need a look each: for a torque limit, or friction that changes.

Where a limit is not kept a step is taken again, as `limited` does for many, to the same bits. Far
from the limits many steps are one call. Near them each is MuJoCo's own, with nothing around it: a
call for one step of a batch costs more than the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from fivebar_sim.arrays import Array
from fivebar_sim.simulation.limits.clipping import MOST_MODES, Clipping, settle
from fivebar_sim.simulation.limits.limited import ITERATIONS, STATE, UNSOLVED
from fivebar_sim.simulation.limits.servos import Servos

KEPT = STATE | mujoco.mjtState.mjSTATE_WARMSTART.value
"""What a step begins with: as STATE, and behind it where the solver starts."""

WHOLE = mujoco.mjtState.mjSTATE_INTEGRATION
"""All that the next step depends on."""

FAR = 128
"""After so many steps that were right, a quarter as many are taken together; fewer do not pay."""

BEGIN = 512
"""Stands for the steps before the first: most runs never come to a limit."""


class Alone:
    """One leg or robot, whose state is its batch's before and after every call.

    Args:
        model: Its model, which no other has: its friction is changed.
        batch: A batch of it alone.
        clipping: Its servos; None without torque limits.
        friction: Its joints' friction before each call, (1, nv); None where it does not change.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        batch: Batch,
        clipping: Clipping | None,
        friction: Array | None,
    ) -> None:
        self._model = model
        self._data = mujoco.MjData(model)
        self._ctrl = self._data.ctrl
        self._batch = batch
        self._friction = friction

        self._warnings = self._data.warning.number
        self._servos = None if clipping is None else Servos(clipping, self._data)
        self._right = BEGIN

    def rollout(self, ctrl: Array, record: Sequence[Any]) -> dict[Any, Array]:
        """Return what is recorded after each step; after a warning the last records repeat.

        Args:
            ctrl: Commands of every step, (1, N, nu).
            record: What to record.
        """
        steps = ctrl.shape[1]
        state = self._batch.state[0]
        mujoco.mj_setState(self._model, self._data, state, WHOLE)
        if self._friction is not None:
            self._model.dof_frictionloss[:] = self._friction[0]
        rows = _Rows(self._model, self._data, record, steps)
        warned = self._warnings.tolist()
        k = 0

        while k < steps and self._warnings.tolist() == warned:
            length = min(self._right // 4, steps - k)
            if self._servos is not None and self._right >= FAR and length > 1:
                k += self._together(self._servos, ctrl[:, k : k + length], rows, k)
            else:
                k = self._singly(ctrl[0], rows, k)

        if self._warnings.tolist() != warned:
            rows.repeat(k)
            self._batch.warning[0, :, 0] = self._data.warning.lastinfo
            self._batch.warning[0, :, 1] += self._warnings - np.array(warned)
        mujoco.mj_getState(self._model, self._data, state, WHOLE)
        return rows.arrays

    def _together(self, servos: Servos, ctrl: Array, rows: _Rows, k: int) -> int:
        """Take the steps from k on with commands (1, n, nu), and return how many are right."""
        length = ctrl.shape[1]
        mujoco.mj_getState(self._model, self._data, self._batch.state[0], WHOLE)
        out = {item: each[:, k : k + length] for item, each in rows.recorded.items()}
        warned = self._batch.warning.copy()
        self._batch.rollout(length, ctrl, record=tuple(out), out=out)

        # The step in question is found singly: this is still in the state before.
        if (self._batch.warning != warned).any():
            self._batch.warning[:] = warned
            self._right = 0
            return 0

        states = np.concatenate([rows.before(k)[None, None], out[KEPT]], axis=1)
        wrong = servos.wrong(ctrl, states[:, :-1], states[:, 1:])
        good = int(wrong.argmax()) if wrong.any() else length
        self._right = 0 if good < length else self._right + length
        if good:
            self._put_back(states[0, good])
        return good

    def _singly(self, ctrl: Array, rows: _Rows, k: int) -> int:
        """Take steps from k on one by one, until more can be taken together or MuJoCo warns.

        Args:
            ctrl: Commands of every step, (N, nu).
            rows: What is recorded.
            k: The first.

        Returns:
            The step after them.
        """
        servos = self._servos
        warned = self._warnings.tolist()
        if servos is not None:
            servos.begin()

        while k < len(ctrl):
            self._ctrl[:] = ctrl[k]
            mujoco.mj_step(self._model, self._data)
            solved = True
            if servos is not None:
                if servos.is_right(ctrl[k, servos.own].tolist()):
                    self._right += 1
                else:
                    self._right = 0
                    solved = self._retake(servos, rows.before(k), warned)
                servos.go_on()
            rows.keep(k, solved=solved)
            k += 1
            if self._warnings.tolist() != warned or self._right >= FAR:
                break
        return k

    def _retake(self, servos: Servos, before: Array, warned: list[int]) -> bool:
        """Take a step again, that was just taken, until its modes agree with its end.

        Args:
            servos: The servos.
            before: The state before it.
            warned: MuJoCo's warnings before it, (kinds,).

        Returns:
            Whether its torques were found.
        """
        # Warnings of a step that is thrown away do not count.
        reset = self._warnings.tolist() != warned
        self._warnings[:] = warned

        def again() -> None:
            # MuJoCo has what it found from the state before, unless a warning made it begin anew.
            anew = reset or self._warnings.tolist() != warned
            self._put_back(before)
            (mujoco.mj_step if anew else mujoco.mj_step2)(self._model, self._data)
            servos.release()

        def ended(torque: Array) -> Array:
            servos.push_constant(torque)
            again()
            return servos.asked()

        begun = servos.begun()
        modes = servos.ended(begun)
        tried = {begun}
        while len(tried) < MOST_MODES:
            tried.add(modes)
            servos.push(modes)
            again()
            asked = servos.ended(modes)
            if asked == modes:
                return True
            # One that was tried already would be tried for ever: the first that was not is next.
            every = product((0, 1, -1), repeat=len(modes))
            left = (each for each in every if each not in tried)
            modes = next(left, modes) if asked in tried else asked
        return settle(ended, servos.limit)

    def _put_back(self, state: Array) -> None:
        mujoco.mj_setState(self._model, self._data, state, KEPT)


class _Rows:
    """What is recorded of some steps.

    Args:
        model: The model.
        data: What is recorded from.
        record: What to record.
        steps: How many steps.

    Attributes:
        recorded: Of each item, (1, steps, ...); of the state, `KEPT`.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, record: Sequence[Any], steps: int
    ) -> None:
        self._model = model
        self._data = data
        self._start = np.empty(mujoco.mj_stateSize(model, KEPT))
        mujoco.mj_getState(model, data, self._start, KEPT)
        self._states = np.empty((steps, len(self._start)))

        self.recorded: dict[Any, Array] = {KEPT: self._states[None]}
        self._pairs: list[tuple[Array, Array]] = []
        for item in dict.fromkeys([*record, ITERATIONS]):
            if item != STATE:
                now = getattr(data, item)
                kept = np.empty((1, steps, *now.shape), now.dtype)
                self.recorded[item] = kept
                self._pairs.append((kept[0], now))

    @property
    def arrays(self) -> dict[Any, Array]:
        """Of each item that was to be recorded, (1, steps, ...)."""
        state = self._states[None, :, : mujoco.mj_stateSize(self._model, STATE)]
        return {STATE: state} | self.recorded

    def keep(self, k: int, *, solved: bool) -> None:
        """Keep what MuJoCo has after step k."""
        mujoco.mj_getState(self._model, self._data, self._states[k], KEPT)
        for kept, now in self._pairs:
            kept[k] = now
        if not solved:
            # Nothing else is known of this step than that its equations are not solved.
            self.recorded[ITERATIONS][0, k] = UNSOLVED

    def repeat(self, count: int) -> None:
        """Repeat the last of some steps until the end."""
        for each in self.recorded.values():
            each[:, count:] = each[:, count - 1 : count]

    def before(self, k: int) -> Array:
        """Return the state before step k, `KEPT`."""
        return self._states[k - 1] if k > 0 else self._start
