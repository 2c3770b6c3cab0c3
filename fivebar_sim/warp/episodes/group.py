"""Legs at one task on a device: `tasks.legs.LegGroup` with Warp's arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.tasks import Task
from fivebar_sim.warp import device as devices
from fivebar_sim.warp.episodes import numbers
from fivebar_sim.warp.limits import Limits
from fivebar_sim.warp.memory import data_of
from fivebar_sim.warp.models import lean_models, put, structure
from fivebar_sim.warp.stepping import take_step


class DeviceGroup:
    """Legs on a device that are stepped together through episodes.

    Args:
        task: The nominal task.
        drawn: The task with each leg's own numbers, n of them.
        models: Each leg's model.
        starts: Poses at rest, (n or 1, m, nq).
        device: Warp's device.
        same_step: Whether a new episode begins in the step in which the last one ends.

    Attributes:
        action: Where the actions of the next step are put, (n, size).
        shown: What agents get, see `structs.Shown`.

    Raises:
        ConfigError: Legs of different structure.
    """

    def __init__(
        self,
        task: Task,
        drawn: Sequence[Task],
        models: Sequence[mujoco.MjModel],
        starts: Array,
        device: Any,
        *,
        same_step: bool,
    ) -> None:
        self._wp = devices.warp()
        self._kernels = devices.kernels("episodes.periods")
        self._device = device
        self._every = task.every
        self._same_step = same_step
        shorts = lean_models(models, forces=False)
        _check_alike(shorts)

        wp = self._wp
        n = len(shorts)
        with devices.on(device):
            self._model = put(shorts, device)
            self._data = data_of(shorts[0], n)
            self._group = numbers.group_of(task, drawn, starts)
            self._now = numbers.now_of(task, self._group, n)
            self.shown = numbers.shown_of(task, n)
            self.action = wp.zeros((n, len(task.bounds[0])), dtype=float)
            self._refused = wp.full(1, -1, dtype=int)
            self._table = wp.zeros((1, n, 2), dtype=float)
            step = wp.zeros(1, dtype=int)
            self._limits = Limits.of(shorts, self._model, self._data, self._table, step)
            self._graphs = self._captured()
            # They were captured with actions of zero.
            self._refused.fill_(-1)

    def reset(self, random: dict[int, np.random.Generator]) -> None:
        """Begin an episode of every leg; those that are given a generator draw from it."""
        with devices.on(self._device):
            if random:
                states = self._now.random.numpy()
                states[list(random)] = numbers.generators(list(random.values()))
                self._now.random.assign(states)
            self._launch(self._kernels.begin_all, *self._states)

    def step(self) -> None:
        """Take a control period with the actions in `action`."""
        with devices.on(self._device):
            for graph in self._graphs:
                self._wp.capture_launch(graph)
                # A step that broke a torque limit is taken again.
                if self._limits is not None and graph is not self._graphs[-1]:
                    self._limits.settle()

    def refused(self) -> int | None:
        """Return the place of a number of an action out of bounds, once; None if there was none.

        The device is waited for.
        """
        found = int(self._refused.numpy()[0])
        if found < 0:
            return None
        self._refused.fill_(-1)
        return found

    def generators(self) -> Any:
        """Return the states of the legs' generators, (n, 6); see `draws`."""
        return self._now.random.numpy()

    @property
    def _states(self) -> list[Any]:
        """What the kernels that begin episodes write."""
        data = self._data
        return [self.shown, data.qpos, data.qvel, data.qacc_warmstart]

    def _captured(self) -> list[Any]:
        """Return the graphs of a control period, with a break after each step that has a limit."""
        parts = self._parts()
        # Kernels are compiled when they are launched first, which a graph cannot do.
        self._launch(self._kernels.begin_all, *self._states)
        for part in parts:
            part()

        if self._limits is None:
            parts = [lambda whole=parts: [part() for part in whole]]
        graphs = []
        for part in parts:
            with self._wp.ScopedCapture() as capture:
                part()
            graphs.append(capture.graph)
        return graphs

    def _parts(self) -> list[Any]:
        """Return what is done in a control period, up to the end of each step's physics."""

        def first() -> None:
            data = self._data
            self._launch(self._kernels.act, self.action, data.qvel, self._refused)
            self._physics(0)

        def later(j: int) -> None:
            self._follow(j - 1)
            self._physics(j)

        def last() -> None:
            self._follow(self._every - 1)
            self._launch(self._kernels.finish, *self._states)
            self._wp.launch(self._kernels.turn, dim=1, inputs=[self._now, self._every])
            if self._same_step:
                self._launch(self._kernels.begin_anew, *self._states)

        return [first, *(lambda j=j: later(j) for j in range(1, self._every)), last]

    def _physics(self, j: int) -> None:
        """Send step j of the period its commands, and take it."""
        data = self._data
        self._wp.launch(
            self._kernels.send,
            dim=(data.nworld, 2),
            inputs=[self._group, self._now, j, self._table, data.ctrl],
        )
        if self._limits is not None:
            self._limits.begin()
        take_step(self._model, data)
        if self._limits is not None:
            self._limits.judge()

    def _follow(self, j: int) -> None:
        """Take note of step j of the period."""
        data = self._data
        kinds = devices.mujoco_warp().OverflowType
        ignored = int(kinds.ITERATIONS | kinds.LS_ITERATIONS)
        state = [data.qpos, data.qvel, data.overflow, ignored]
        self._launch(self._kernels.follow, j, self._table, *state)

    def _launch(self, kernel: Any, *inputs: Any) -> None:
        """Launch a kernel with a thread for each leg."""
        self._wp.launch(kernel, dim=self._data.nworld, inputs=[self._group, self._now, *inputs])


def _check_alike(models: Sequence[mujoco.MjModel]) -> None:
    """Raise unless models have one structure."""
    distinct = {id(model): model for model in models}.values()
    if len({structure(model) for model in distinct}) > 1:
        raise ConfigError("legs on a device must have one structure, and these do not")
