"""Torque limits of legs on a device, kept at the end of a step as `simulation.limits` does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from fivebar_sim.simulation.limits.clipping import MOST_MODES, Clipping
from fivebar_sim.warp import device as devices
from fivebar_sim.warp.stepping import take_step

UNLIMITED = 1e30
"""Stands for no limit beside legs that have one [N m], in single precision."""

ROUNDING = 5e-7
"""How far an angle may be rounded in a step [rad]: so much torque, times kp, is on the limit."""

UNSOLVED = 1_000_000
"""Iterations that stand for a step of whose modes none agree, not even about."""


class Limits:
    """The motors of legs of which some have a torque limit.

    Args:
        clipping: Their numbers.
        model: The legs' model on the device.
        data: Their state there.
        table: Commands that are sent, (steps, n, nu).
        step: Which step it is, (1,).
    """

    def __init__(self, clipping: Clipping, model: Any, data: Any, table: Any, step: Any) -> None:
        wp = devices.warp()
        self._wp = wp
        self._model = model
        self._data = data
        self._table = table
        self._step = step

        self._late = int(clipping.late.flat[0])
        kp = clipping.kp[:, 0]
        limit = np.minimum(clipping.limit[:, 0], UNLIMITED)
        self._gains = [_sent(wp, each) for each in (kp, clipping.kd[:, 0], limit)]
        self._slack = _sent(wp, ROUNDING * kp)

        self._kept = [wp.clone(each) for each in self._state]
        shape = kp.shape
        self._modes = wp.zeros(shape, dtype=int)
        self._wanted = wp.zeros(shape, dtype=int)
        self._tried = wp.zeros(len(kp), dtype=int)
        self._wrong = wp.zeros(len(kp), dtype=int)
        self._least = wp.zeros(len(kp), dtype=float)
        self._best = wp.zeros(len(kp), dtype=int)
        self._left = wp.zeros(1, dtype=int)
        self._graph: Any = None

    @classmethod
    def of(
        cls, models: Sequence[mujoco.MjModel], model: Any, data: Any, table: Any, step: Any
    ) -> Limits | None:
        """Return the motors of some legs; None if no limit of theirs needs a look."""
        clipping = Clipping.of(models)
        return None if clipping is None else cls(clipping, model, data, table, step)

    def begin(self) -> None:
        """Remember the state before a step, and the modes in which MuJoCo takes it."""
        for kept, now in zip(self._kept, self._state, strict=True):
            self._wp.copy(kept, now)
        self._data.qfrc_applied.zero_()
        inputs = [self._data.ctrl, *self._kept[:2], *self._gains]
        outputs = [self._modes, self._tried, self._wrong, self._least]
        self._wp.launch(
            devices.kernels().begin, dim=self._data.nworld, inputs=inputs, outputs=outputs
        )

    def judge(self) -> None:
        """Find the legs whose step ended in other modes than it was taken in."""
        data = self._data
        self._left.zero_()
        states = [self._kept[0], data.qpos, data.qvel]
        modes = [self._modes, self._wanted, self._tried, self._wrong]
        numbers = [*self._gains, self._slack]
        found = [self._least, self._best, data.solver_niter, UNSOLVED, self._left]
        inputs = [self._late, self._table, self._step, *states, *numbers, *modes, *found]
        self._wp.launch(devices.kernels().judge, dim=data.nworld, inputs=inputs)

    def settle(self) -> None:
        """Take the last step again, until the modes of every leg agree with its end."""
        # Each of the modes, and the best of them again.
        for _ in range(MOST_MODES + 1):
            if not int(self._left.numpy()[0]):
                return
            if self._graph is None:
                # Captured when it is needed first: its kernels may not be compiled before.
                self._again()
                self._graph = self._captured()
            else:
                self._wp.capture_launch(self._graph)

    def _captured(self) -> Any:
        with self._wp.ScopedCapture() as capture:
            self._again()
        return capture.graph

    def _again(self) -> None:
        """Take the step again: with forced modes where it was wrong, else as it was."""
        data = self._data
        inputs = [self._table, self._step, *self._kept[:2], *self._gains]
        modes = [self._wanted, self._wrong, self._modes]
        self._wp.launch(
            devices.kernels().force,
            dim=data.nworld,
            inputs=[*inputs, *modes, data.ctrl, data.qfrc_applied],
        )

        for kept, now in zip(self._kept, self._state, strict=True):
            self._wp.copy(now, kept)
        take_step(self._model, data)
        self.judge()

    @property
    def _state(self) -> list[Any]:
        """The state that a step begins with: the solver's start is part of it."""
        return [self._data.qpos, self._data.qvel, self._data.qacc_warmstart]


def _sent(wp: Any, values: Any) -> Any:
    return wp.array(values.astype(np.float32), dtype=float)
