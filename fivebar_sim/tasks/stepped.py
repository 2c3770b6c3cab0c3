"""Legs that are stepped by `mujoco.batch`, started again, copied, pickled, and taken across a fork.

A batch has threads and memory of its own, which nothing copies: a copy makes a new batch of the
same models and puts the whole state into it, so that it goes on with the same bits.
"""

from __future__ import annotations

import ctypes
import os
import weakref
from functools import cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.simulation.steps import Legs

_alive: weakref.WeakSet[SteppedLegs] = weakref.WeakSet()
"""The legs of this process, for `_forked`."""


class SteppedLegs(Legs):
    """Legs of which some can be started again.

    Args:
        models: A model for each leg.
        qpos: Start poses, (nsim, nq).
        nthread: Threads; 0 is one for every processor.
    """

    def __init__(self, models: list[mujoco.MjModel], qpos: Array, nthread: int) -> None:
        super().__init__(models, qpos, nthread, forces=False)
        self._models = models
        self._nthread = nthread
        self._is_stale = False
        _watch_forks()
        _alive.add(self)

    def restart(self, rows: NDArray[np.int64], qpos: Array) -> None:
        """Put some legs at rest into poses (k, nq)."""
        self._renew()
        # No mj_forward: it would be of the model's default pose, which the next line replaces.
        self._batch.reset(rows, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._batch.qpos[rows] = qpos
        if self._gears is not None:
            self._gears.restart(rows)

    def change(self, models: list[mujoco.MjModel]) -> None:
        """Go on with other models of the same structure; those that stay keep their bits."""
        self.__setstate__({**self.__getstate__(), "models": models})

    def moved(self, ctrl: Array) -> tuple[Array, Array, NDArray[Any]]:
        """Return what `Legs.moved` does."""
        self._renew()
        return super().moved(ctrl)

    def write(self, row: int, data: mujoco.MjData) -> None:
        """Put the state of a leg into an MjData of its model."""
        whole = mujoco.mjtState.mjSTATE_INTEGRATION.value
        mujoco.mj_setState(self._models[row], data, self._batch.state[row], whole)

    def __getstate__(self) -> dict[str, Any]:
        return {
            "models": self._models,
            "nthread": self._nthread,
            "state": self._batch.state.copy(),
            "warning": self._batch.warning.copy(),
            "gears": None if self._gears is None else self._gears.memory.copy(),
        }

    def __setstate__(self, kept: dict[str, Any]) -> None:
        models = kept["models"]
        SteppedLegs.__init__(self, models, np.zeros((len(models), models[0].nq)), kept["nthread"])
        self._batch.state[:] = kept["state"]
        self._batch.warning[:] = kept["warning"]
        if self._gears is not None:
            self._gears.memory = kept["gears"]

    def _renew(self) -> None:
        """In a process that was forked off, make a batch whose threads are alive."""
        if self._is_stale:
            self.__setstate__(self.__getstate__())

    def _leave(self) -> None:
        """Never free this batch, and make another one before the next step."""
        # A fork copies memory but no threads: to step the batch would wait for them for ever, and
        # to free it ends the process.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._batch))
        self._is_stale = True


@cache
def _watch_forks() -> None:
    """Have `_forked` called in every process that is forked off from now on."""
    # Windows has no fork.
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_forked)


def _forked() -> None:
    for legs in list(_alive):
        legs._leave()
