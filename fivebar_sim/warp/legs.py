"""Legs that are stepped on a device: commands in, the states of every step out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.simulation.lean import recorded_columns
from fivebar_sim.simulation.steps import States
from fivebar_sim.warp import device as devices
from fivebar_sim.warp.limits import Limits
from fivebar_sim.warp.memory import check_fits, data_of
from fivebar_sim.warp.models import lean_models, put
from fivebar_sim.warp.stepping import take_step

CHUNK = 16e6
"""Numbers that are recorded before they are handed over, of all legs: 64 MB of the device."""

LONGEST = 500
"""Most steps that are recorded before they are handed over."""

GRAPH = 50
"""Steps of a CUDA graph: what a launch costs is spread over them."""


class DeviceLegs:
    """Legs on a device, begun at rest.

    Args:
        models: A model for each leg, all of one structure.
        qpos: Start poses, (n, nq).
        device: Warp's device.

    Raises:
        ConfigError: The legs do not fit into the device's memory.
    """

    def __init__(self, models: Sequence[mujoco.MjModel], qpos: Array, device: Any) -> None:
        self._wp = devices.warp()
        self._mjw = devices.mujoco_warp()
        self._device = device
        shorts = lean_models(models)
        first = shorts[0]
        self._nq = int(first.nq)
        self._nv = int(first.nv)
        self._iterations = int(first.opt.iterations)
        self._timestep = float(first.opt.timestep)
        self._columns = recorded_columns(first)
        width = self._nq + 2 * self._nv + 1 + len(self._columns)
        self._length = self._chunk(len(shorts), width)
        check_fits(first, len(shorts), self._length * (width + int(first.nu)), device)

        wp = self._wp
        shape = (self._length, len(shorts))
        with devices.on(device):
            self._model = put(shorts, device)
            self._data = data_of(first, len(shorts))
            self._table = wp.zeros((*shape, int(first.nu)), dtype=float)
            self._rows = wp.zeros((*shape, width), dtype=float)
            self._step = wp.zeros(1, dtype=int)
            self._sensors = wp.array(np.array(self._columns, dtype=np.int32), dtype=int)
            self._limits = Limits.of(shorts, self._model, self._data, self._table, self._step)
            # Kernels are compiled when they are launched first, which a graph cannot do.
            self._take_step()
            self._restart(qpos)
            self._graph = self._captured()

    def _chunk(self, n: int, width: int) -> int:
        """Return how many steps are recorded before they are handed over."""
        most = int(np.clip(CHUNK // (n * width), 1, LONGEST))
        return max(most // GRAPH, 1) * GRAPH

    @property
    def length(self) -> int:
        """The number of steps that `advance` takes at once."""
        return self._length

    def advance(self, ctrl: Array, begin: int) -> States:
        """Return the states of the next steps, `length` at most.

        Args:
            ctrl: Commands of each of them, (n, steps, nu).
            begin: The number of steps so far.

        Raises:
            ArgumentError: Commands that are not finite.
        """
        if not np.isfinite(ctrl).all():
            raise ArgumentError("ctrl must be finite: no servo can be sent anything else")
        steps = ctrl.shape[1]
        sent = ctrl.astype(np.float32).swapaxes(0, 1)
        table = np.concatenate([sent, np.repeat(sent[-1:], self._length - steps, axis=0)])

        with devices.on(self._device):
            self._table.assign(np.ascontiguousarray(table))
            self._step.fill_(-1)
            for _ in range(0, steps, self._in_graph):
                self._wp.capture_launch(self._graph)
                if self._limits is not None:
                    self._limits.settle()
                    self._keep()
            rows = self._rows.numpy()[:steps]
        # What the device was sent, not what it was rounded from: torques are small differences.
        return self._states(rows.astype(np.float64), sent.astype(np.float64), begin)

    @property
    def _in_graph(self) -> int:
        """The steps of a graph: one where a limit may need it again, or a launch costs nothing."""
        return GRAPH if self._device.is_cuda and self._limits is None else 1

    def _captured(self) -> Any:
        """Return the graph of some steps."""
        with self._wp.ScopedCapture() as capture:
            for _ in range(self._in_graph):
                self._take_step()
        return capture.graph

    def _take_step(self) -> None:
        """Take the next step; it is kept at once where no limit can ask for another one."""
        wp = self._wp
        data = self._data
        wp.launch(devices.kernels().next_step, dim=1, inputs=[self._step])
        wp.launch(
            devices.kernels().send, dim=data.ctrl.shape, inputs=[self._table, self._step, data.ctrl]
        )

        if self._limits is not None:
            self._limits.begin()
        take_step(self._model, data)
        if self._limits is not None:
            self._limits.judge()
        else:
            self._keep()

    def _keep(self) -> None:
        """Keep what is recorded of the step."""
        data = self._data
        state = [data.qpos, data.qvel, data.qfrc_constraint, data.sensordata, data.solver_niter]
        inputs = [self._step, *state, self._sensors, self._nq, self._nv, self._rows]
        self._wp.launch(devices.kernels().keep, dim=data.nworld, inputs=inputs)

    def _restart(self, qpos: Array) -> None:
        """Put all legs at rest into poses."""
        data = self._data
        data.qpos.assign(qpos.astype(np.float32))
        data.qvel.zero_()
        data.qacc_warmstart.zero_()
        data.qfrc_applied.zero_()

    def _states(self, rows: Array, sent: Array, begin: int) -> States:
        """Return the states of what was recorded, both (steps, n, ...)."""
        steps, n, _ = rows.shape
        parts = np.cumsum([self._nq, self._nv, self._nv, 1])
        kept = [part.swapaxes(0, 1) for part in np.split(rows, parts, axis=-1)]
        qpos, qvel, constraint, iterations, ground = kept
        # The limit of the processor's Warp is another one than the model's, which guards know.
        most = self._model.opt.iterations
        iterations = np.where(iterations >= most, self._iterations, iterations)
        # A device counts no time: it takes every step that it is told to.
        time = (begin + 1 + np.arange(steps)) * self._timestep
        return States(
            time=np.broadcast_to(time, (n, steps)),
            qpos=qpos,
            qvel=qvel,
            ctrl=sent.swapaxes(0, 1),
            ground=ground,
            constraint=constraint,
            iterations=iterations[..., 0],
            warnings=self._overflows(),
        )

    def _overflows(self) -> Any:
        """Return whether the constraints of a leg had no room on the device, (n,)."""
        # Those of the solver's iterations are told by their number.
        kinds = self._mjw.OverflowType
        ignored = int(kinds.ITERATIONS | kinds.LS_ITERATIONS)
        return (self._data.overflow.numpy() & ~ignored != 0).astype(np.int64)
