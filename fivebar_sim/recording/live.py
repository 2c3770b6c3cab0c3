"""Show a run in Rerun while it is simulated: poses and plots, sent from a second thread."""

from __future__ import annotations

import queue
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.errors import ConfigError
from fivebar_sim.recording import foot, ground, layout, rrd
from fivebar_sim.recording import leg as scene
from fivebar_sim.recording import viewer as recording_viewer
from fivebar_sim.recording.look import Look
from fivebar_sim.recording.plots import Series, series
from fivebar_sim.recording.poses import DrawnMotion, Room, Rows, drawn_motion, room_of
from fivebar_sim.recording.relay import Relay
from fivebar_sim.recording.summary import colours
from fivebar_sim.scenario.scenes import Ground
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.record import Part, columns, points
from fivebar_sim.simulation.steps import States, Watch

if TYPE_CHECKING:
    import rerun as rr


RATE = 60.0
"""Poses per second of the run [Hz]."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")
SWITCH = 5e-4
"""How long the sending thread may keep the physics' thread waiting for the interpreter [s]."""
SETTINGS = bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
"""An empty SETTINGS frame of HTTP/2, with which either side of gRPC begins (RFC 9113)."""
HELLO = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + SETTINGS
ANSWER = 2.0
"""How long a viewer may take to answer HELLO [s]."""
PATIENCE = 20.0
"""How long a new viewer may take to listen [s]."""
STALLED = 3.0
"""How long a viewer may take nothing of what is left to send before it is given up [s]."""
FOREVER = 1e6
"""Longer than any viewer takes [s]: it is `finish` that gives up."""

Begin = Callable[["rr.RecordingStream"], Watch]
"""Returns what sends the states of some steps to a new recording."""


def streaming(planned: Plan, address: str) -> AbstractContextManager[Watch]:
    """Return a context with a watcher for `rollout.execute` that shows a leg's run in a viewer.

    Args:
        planned: The plan that will be simulated.
        address: HOST:PORT of the viewer, as `spawn_viewer` returns it; see `check_address`.

    Raises:
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    return sending(planned.scenario.name, address, lambda stream: _Leg(planned, stream).send)


@contextmanager
def sending(name: str, address: str, begin: Begin) -> Iterator[Watch]:
    """Yield a watcher that has a run shown in a listening viewer.

    Args:
        name: The recording's name.
        address: HOST:PORT of the viewer.
        begin: Says how states are shown; they are sent from a second thread.

    Raises:
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    # The relay is left first: Rerun's own clean-up would wait for a viewer that does not read.
    with rrd.session(), Relay(address) as relay:
        stream = rrd.started(name)
        stream.connect_grpc(f"rerun+http://{relay.address}/proxy")
        sender = _Sender(begin(stream), stream)
        # Python's own interval is ten times as long: so long the sender would hold up the physics.
        before = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH)
        try:
            yield sender.put
        except Exception:
            # What led to the error is worth seeing; a signal, which is no Exception, ends at once.
            sender.finish(relay)
            raise
        else:
            sender.finish(relay)
        finally:
            sys.setswitchinterval(before)
            sender.give_up(relay)


def check_address(address: str) -> str:
    """Return the address of a viewer unchanged, if one listens there, on this machine.

    Raises:
        ConfigError: Not HOST:PORT, a host that is not this machine, or no viewer listens.
    """
    host, colon, port = address.rpartition(":")
    if not colon or not re.fullmatch(r"\d{1,5}", port, re.ASCII) or not 0 < int(port) < 2**16:
        raise ConfigError(f"--live-at takes HOST:PORT, as 127.0.0.1:9876, got {address!r}")
    if host.strip("[]") not in LOOPBACK:
        raise ConfigError(f"--live-at must be on this machine, {', '.join(LOOPBACK)}, got {host!r}")

    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER) as viewer:
            # A port that is open need not be a viewer's: it must answer as gRPC does.
            viewer.sendall(HELLO)
            # The fourth byte of a frame is its type.
            if viewer.recv(5)[3:4] != SETTINGS[3:4]:
                raise OSError("what answers there does not speak gRPC")
    except OSError as error:
        reason = error.strerror or error
        raise ConfigError(f"no Rerun viewer listens at {address}: {reason}") from None
    return address


def spawn_viewer() -> str:
    """Start a viewer that outlives this program, and return its address.

    Raises:
        ViewerMissingError: The installation lacks the viewer's binary.
        ConfigError: It does not listen in time.
    """
    with socket.socket() as free:
        free.bind((recording_viewer.LOOPBACK, 0))
        port = free.getsockname()[1]

    command = [str(recording_viewer.binary()), "--bind", recording_viewer.LOOPBACK]
    # It prints every graphics device that it tries. In a session of its own, since Ctrl-C in the
    # terminal should end the run and not the viewer.
    viewer = subprocess.Popen(
        [*command, "--port", str(port)],
        env=recording_viewer.quiet_environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    deadline = time.monotonic() + PATIENCE
    while viewer.poll() is None and time.monotonic() < deadline:
        try:
            return check_address(f"{recording_viewer.LOOPBACK}:{port}")
        except ConfigError:
            time.sleep(0.1)

    raise ConfigError("Rerun's viewer did not start to listen; is there a screen?")


class _Sender:
    """Sends states from its own thread, so that the physics does not wait."""

    def __init__(self, send: Watch, stream: rr.RecordingStream) -> None:
        self._send = send
        self._stream = stream
        self._queue: queue.SimpleQueue[States | None] = queue.SimpleQueue()
        self._error: Exception | None = None
        self._gone = False
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def put(self, states: States) -> None:
        """Queue states for sending."""
        self._queue.put(states)

    def finish(self, relay: Relay) -> None:
        """Wait until everything is sent, or the viewer has stalled.

        Raises:
            Exception: The error of the sending thread, if any.
        """
        self._queue.put(None)
        begun = time.monotonic()
        # Waits in pieces, between which a signal is heard.
        while self._thread.is_alive():
            self._thread.join(0.05)
            if relay.idle(begun) > STALLED:
                break

        if self._error is not None:
            raise self._error

    def give_up(self, relay: Relay) -> None:
        """End the connection and the sending thread, whether everything was sent or not."""
        self._gone = True
        relay.cut()
        self._queue.put(None)
        # Nothing to wait for is left; but a thread that is stuck must not keep the program.
        self._thread.join(STALLED)

    def _work(self) -> None:
        while (states := self._queue.get()) is not None:
            if self._error is None and not self._gone:
                try:
                    self._send(states)
                except Exception as error:
                    # Kept for `finish`: raised here, nobody would see it.
                    self._error = error

        # A viewer that the user has closed does no harm to the run.
        with suppress(RuntimeError):
            self._stream.flush(timeout_sec=FOREVER)
            self._stream.disconnect()


class _Leg:
    """A leg's run as it is shown so far."""

    def __init__(self, planned: Plan, stream: rr.RecordingStream) -> None:
        self._planned = planned
        self._stream = stream
        self._room = _room(planned)
        self._has_begun = False
        self._begin = 0
        self._before = planned.start

    def send(self, states: States) -> None:
        """Send some steps."""
        part = Part(states, self._begin, self._before)
        record = columns(self._planned, part, points(self._planned, part))
        # A single row does not tell the timestep, which the plots need.
        if len(record["time"]) > 1:
            self._show(record)
        self._begin += states.time.shape[1]
        # The torque of the next step needs the state before it.
        self._before = states.qpos[0, -1]

    def _show(self, record: rrd.Record) -> None:
        planned = self._planned
        stream = self._stream
        look = Look()
        leg = planned.scenario.leg
        plots = list(series(planned.scenario, record))

        if not self._has_begun:
            self._begin_recording(plots, look)
            self._has_begun = True

        rows = shown_rows(len(record["time"]), planned.motion.timestep)
        moved = drawn_motion(record, rows)
        at = rrd.times(record["time"][rows], self._begin + rows + 1)
        scene.send_leg(stream, leg, moved, look, at)
        foot.send_foot(stream, leg, moved, look, at)
        ground.send_ground(stream, leg, moved, look, at, self._room)
        send_plots(stream, plots, rows, look, at)

    def _begin_recording(self, plots: list[Series], look: Look) -> None:
        planned = self._planned
        stream = self._stream
        layout.send(stream, layout.contents(self._room, [look], [plots]))
        rrd.log_room(stream, self._room)
        log_summary(stream, planned.scenario.name)
        scene.log_leg(stream, planned.scenario.leg, look)
        foot.log_foot(stream, planned.motion.foot[1:], look)


def shown_rows(count: int, timestep: float) -> Rows:
    """Return which of some steps are shown: the first, and `RATE` each second of the run.

    Args:
        count: Number of steps.
        timestep: h [s].
    """
    return np.arange(0, count, max(1, round(1.0 / (RATE * timestep))))


def log_summary(stream: rr.RecordingStream, name: str) -> None:
    """Log what there is to say of a run that is not over."""
    import rerun as rr

    text = f"# {name}\n\nNo verdict yet: shown while it is simulated.\n\n{colours([name])}\n"
    document = rr.TextDocument(text, media_type="text/markdown")
    stream.log(layout.SUMMARY, document, static=True)


def send_plots(
    stream: rr.RecordingStream,
    plots: Sequence[Series],
    rows: Rows,
    look: Look,
    at: list[rr.TimeColumn],
) -> None:
    """Send some rows of plots, whose times are given."""
    for plot in plots:
        shown = plot.shown[rows]
        # `values` has rows only where `shown` is true: the running count is their index.
        values = plot.values[(np.cumsum(plot.shown) - 1)[rows[shown]]]
        rrd.send_series(stream, plot._replace(values=values, shown=shown), look, at)


def _room(planned: Plan) -> Room:
    """Return the room that the planned motion needs; how large forces will be is not known yet."""
    leg = planned.scenario.leg
    record = planned.motion
    # Some 500 poses show where the leg goes, however long the run is.
    every = slice(None, None, max(1, len(record.q) // 500))
    ground_scene = planned.scenario.scene
    hip = None

    if isinstance(ground_scene, Ground):
        hip = np.full(len(record.q[every]), planned.start[0])

    room = room_of(
        [leg], [DrawnMotion(record.q[every], record.foot[every], record.foot[every], hip)]
    )
    if not isinstance(ground_scene, Ground):
        return room

    # The forces are not known yet: the weight gets an arrow of a tenth of the leg's size.
    weight = 9.81 * (ground_scene.mass + sum(link.mass for link in leg.links))
    return room._replace(metre_per_newton=0.1 * leg.size / weight)
