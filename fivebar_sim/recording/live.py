"""A run shown in Rerun while it is simulated: poses and plots, sent beside the physics."""

from __future__ import annotations

import queue
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.errors import ConfigError
from fivebar_sim.recording import foot, ground, layout, rrd
from fivebar_sim.recording import leg as scene
from fivebar_sim.recording import viewer as recording_viewer
from fivebar_sim.recording.look import Look
from fivebar_sim.recording.plots import Series, series
from fivebar_sim.recording.poses import Motion, Stage, motion, stage
from fivebar_sim.scenario.scenes import Ground
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.record import columns
from fivebar_sim.simulation.steps import States, Watch

if TYPE_CHECKING:
    import rerun as rr


RATE = 60.0
"""Poses for a second of the run [Hz]."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")
SWITCH = 5e-4
"""How long the sending thread may keep the physics' thread waiting for the interpreter [s]."""
SETTINGS = bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
"""An empty SETTINGS frame of HTTP/2: how either side of gRPC begins (RFC 9113)."""
HELLO = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + SETTINGS
ANSWER = 2.0
"""How long a viewer may take to answer that [s]."""
PATIENCE = 20.0
"""How long a viewer may take to listen, and the last rows to be sent [s]."""


@contextmanager
def streaming(planned: Plan, address: str) -> Iterator[Watch]:
    """Give what `rollout.execute` shall be watched by, to show a run in a listening viewer.

    Args:
        planned: What will be simulated.
        address: HOST:PORT of the viewer, as `spawned` returns it; see `checked`.

    Raises:
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    with rrd.session():
        stream = rrd.started(planned.scenario.name)
        stream.connect_grpc(f"rerun+http://{address}/proxy")
        sender = _Sender(planned, stream)
        before = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH)
        try:
            yield sender.put
        finally:
            sys.setswitchinterval(before)
            sender.finish()
            _end(stream)


def checked(address: str) -> str:
    """Return the address of a viewer, if one listens there, on this machine.

    Raises:
        ConfigError: No HOST:PORT, a host that is not this one, or nobody listens.
    """
    host, colon, port = address.rpartition(":")
    if not colon or not re.fullmatch(r"\d{1,5}", port, re.ASCII) or not 0 < int(port) < 2**16:
        raise ConfigError(f"--live-at takes HOST:PORT, as 127.0.0.1:9876, got {address!r}")
    if host.strip("[]") not in LOOPBACK:
        raise ConfigError(f"--live-at must be on this machine, {', '.join(LOOPBACK)}, got {host!r}")

    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER) as viewer:
            viewer.sendall(HELLO)
            if viewer.recv(5)[3:4] != SETTINGS[3:4]:
                raise OSError("what answers there speaks no gRPC")
    except OSError as error:
        said = error.strerror or error
        raise ConfigError(f"no Rerun viewer listens at {address}: {said}") from None
    return address


def _end(stream: rr.RecordingStream) -> None:
    """Send what is left and let go; not for ever, as a viewer that has gone does not answer."""

    def end() -> None:
        with suppress(RuntimeError):  # the viewer was closed: the run itself has come to no harm
            stream.flush(timeout_sec=PATIENCE)
            stream.disconnect()

    ending = threading.Thread(target=end, daemon=True)
    ending.start()
    ending.join(PATIENCE)


def spawned() -> str:
    """Return the address of a new viewer, which stays when this program ends.

    Raises:
        ViewerMissingError: The installation lacks the viewer's binary.
        ConfigError: It does not listen in time.
    """
    with socket.socket() as free:
        free.bind((recording_viewer.LOOPBACK, 0))
        port = free.getsockname()[1]

    command = [str(recording_viewer.binary()), "--bind", recording_viewer.LOOPBACK]
    viewer = subprocess.Popen(
        [*command, "--port", str(port)],
        env=recording_viewer.quiet(),
        stdout=subprocess.DEVNULL,  # it tells of every device that it tries
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.monotonic() + PATIENCE
    while viewer.poll() is None and time.monotonic() < deadline:
        try:
            return checked(f"{recording_viewer.LOOPBACK}:{port}")
        except ConfigError:
            time.sleep(0.1)

    raise ConfigError("Rerun's viewer did not start to listen; is there a screen?")


class _Sender:
    """Sends states from a thread of its own, so that the physics need not wait."""

    def __init__(self, planned: Plan, stream: rr.RecordingStream) -> None:
        self._planned = planned
        self._stream = stream
        self._room = _room(planned)
        self._begin = 0
        self._last = None
        self._queue: queue.SimpleQueue[States | None] = queue.SimpleQueue()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def put(self, states: States) -> None:
        """Take states to be sent."""
        self._queue.put(states)

    def finish(self) -> None:
        """Wait until everything is sent; raise what went wrong."""
        self._queue.put(None)
        self._thread.join()
        if self._error is not None:
            raise self._error

    def _work(self) -> None:
        while (states := self._queue.get()) is not None:
            if self._error is None:
                try:
                    self._send(states)
                except Exception as error:  # for the thread that waits
                    self._error = error

    def _send(self, states: States) -> None:
        """Send some steps; those before give the first of them its torque."""
        known = 0 if self._last is None else 1
        joined = states if self._last is None else States.joined([self._last, states])
        record = columns(self._planned, joined, self._begin - known)
        record = {name: column[known:] for name, column in record.items()}
        if len(record["time"]) > 1:
            self._show(record)
        self._begin += states.time.shape[1]
        self._last = states.part(slice(-1, None))

    def _show(self, record: rrd.Record) -> None:
        planned = self._planned
        stream = self._stream
        look = Look()
        leg = planned.scenario.leg
        h = planned.motion.timestep
        plots = list(series(planned.scenario, record))

        if self._begin == 0:
            self._begin_recording(plots, look)

        rows = np.arange(0, len(record["time"]), max(1, round(1.0 / (RATE * h))))
        moved = motion(record, rows)
        at = rrd.times(record["time"][rows], self._begin + rows + 1)
        scene.send_leg(stream, leg, moved, look, at)
        foot.send_foot(stream, leg, moved, look, at)
        ground.send_ground(stream, leg, moved, look, at, self._room)

        for plot in plots:
            shown = plot.shown[rows]
            values = plot.values[(np.cumsum(plot.shown) - 1)[rows[shown]]]
            rrd.send_series(stream, plot._replace(values=values, shown=shown), look, at)

    def _begin_recording(self, plots: list[Series], look: Look) -> None:
        planned = self._planned
        stream = self._stream
        layout.send(stream, layout.contents(self._room, [look], [plots]))
        rrd.log_room(stream, self._room)
        text = f"# {planned.scenario.name}\n\nNo verdict yet: shown while it is simulated."
        stream.log(layout.SUMMARY, _markdown(text), static=True)
        scene.log_leg(stream, planned.scenario.leg, look)
        foot.log_foot(stream, planned.motion.foot[1:], look)


def _markdown(text: str) -> rr.TextDocument:
    import rerun as rr

    return rr.TextDocument(text, media_type="text/markdown")


def _room(planned: Plan) -> Stage:
    """Return the room that the planned motion needs; how large forces will be is not known yet."""
    leg = planned.scenario.leg
    record = planned.motion
    every = slice(None, None, max(1, len(record.q) // 500))
    ground_scene = planned.scenario.scene
    hip = None

    if isinstance(ground_scene, Ground):
        hip = np.full(len(record.q[every]), planned.start[0])

    room = stage([leg], [Motion(record.q[every], record.foot[every], record.foot[every], hip)])
    if not isinstance(ground_scene, Ground):
        return room

    weight = 9.81 * (ground_scene.mass + sum(link.mass for link in leg.links))
    return room._replace(metre_per_newton=0.1 * leg.size / weight)
