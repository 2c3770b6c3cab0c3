"""The Rerun recording of runs, derived from their records: moving legs, plots, limits.

Rerun is slow to import: only the functions that use it do.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import FiveBarError
from fivebar_sim.files import file_stream
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.columns import Record
from fivebar_sim.recording import foot, ground, layout
from fivebar_sim.recording import leg as scene
from fivebar_sim.recording.check import PROPERTY
from fivebar_sim.recording.look import Look, looks
from fivebar_sim.recording.plots import Series, series
from fivebar_sim.recording.poses import (
    DrawnMotion,
    Room,
    Rows,
    drawn_motion,
    drawn_rows,
    points,
    room_of,
)
from fivebar_sim.recording.summary import summary
from fivebar_sim.scenario.leg_words import leg_words
from fivebar_sim.scenario.run import Run
from fivebar_sim.simulation.provenance import identity

if TYPE_CHECKING:
    import rerun as rr


APPLICATION = "fivebar"
CHUNK = 65_536
"""Most rows of a plot that are sent at once: Rerun copies them several times."""
LOCK = threading.RLock()
"""Held by a session; its thread may open another within, as when it writes a run that it shows."""
_sessions = 0


class RerunDisabledError(FiveBarError, RuntimeError):
    """Rerun is switched off by the environment."""


def write(
    path: Path, runs: Sequence[Run], labels: Sequence[str] = (), identities: Sequence[str] = ()
) -> None:
    """Write the recording of one or more runs to a .rrd file; several are drawn over each other.

    Timelines: `sim_time` (the record's time, to the nanosecond) and `step` (from 1: t = step h).
    Series have every row of the record, poses one row every `POSE_PERIOD` and the last one.

    Args:
        path: The file; an existing one is overwritten, and gone if this fails.
        runs: The runs to draw, at least one. Each of several has its own colour, and its entities
            are under run_1, run_2, ...
        labels: Names of the runs, all different; by default the names of their scenarios.
        identities: What identifies each run, see `identity`; by default it is computed.

    Raises:
        OSError: The file cannot be written.
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    names = list(labels) or [run.scenario.name for run in runs]
    with file_of(path, names) as stream:
        send(stream, runs, names, identities)


@contextmanager
def file_of(path: Path, names: Sequence[str]) -> Iterator[rr.RecordingStream]:
    """Within, what is sent to the stream goes into a .rrd file, which is gone if that fails."""
    with session():
        stream = started(" + ".join(names))
        try:
            with path.open("wb") as file, file_stream.into(stream, file):
                yield stream
        except BaseException:
            # Half a recording helps nobody; a device is no file.
            if path.is_file():
                path.unlink()
            raise


@contextmanager
def session() -> Iterator[None]:
    """Make wrong use of Rerun raise, where it would only warn, and clean up after it."""
    _load()
    import rerun as rr
    import rerun_bindings

    global _sessions
    # Rerun's strictness is global, so one thread at a time makes recordings.
    with LOCK:
        _sessions += 1
        before = rr.strict_mode()
        rr.set_strict_mode(True)
        try:
            yield
        finally:
            rr.set_strict_mode(before)
            # A recording that nothing refers to keeps its threads and megabytes until this call,
            # which fails for a live one whose viewer is gone. Within another session it would wait
            # for that one's viewer.
            _sessions -= 1
            if not _sessions:
                with suppress(RuntimeError):
                    rerun_bindings.flush_and_cleanup_orphaned_recordings()


def _load() -> None:
    """Import Rerun so that it does not warn when a signal ends a half-made recording."""
    # Its log reads the environment once, at import; a RUST_LOG that the user has set stays.
    ours = "RUST_LOG" not in os.environ
    os.environ.setdefault("RUST_LOG", "warn,re_sdk=error")
    try:
        import rerun  # noqa: F401
    finally:
        if ours:
            del os.environ["RUST_LOG"]


def send(
    stream: rr.RecordingStream,
    runs: Sequence[Run],
    names: list[str],
    identities: Sequence[str] = (),
) -> None:
    """Send the layout, the text, the floor and all runs, each with its name; see `write`."""
    import rerun as rr

    shown = looks(names)
    moved = [drawn_motion(run.record, drawn_rows(run.record["time"])) for run in runs]
    plots = [list(series(run.scenario, _head(run.record))) for run in runs]
    room = room_of([run.scenario.leg for run in runs], moved)
    text = summary(
        names,
        [run.measured for run in runs],
        [run.scenario.limits for run in runs],
        [leg_words(run.scenario.leg, run.scenario.servo.armature) for run in runs],
    )
    layout.send(stream, layout.contents(room, shown, plots))
    stream.log(layout.SUMMARY, rr.TextDocument(text, media_type="text/markdown"), static=True)
    log_room(stream, room)

    known = identities or [identity(run) for run in runs]
    for run, own, look, poses in zip(runs, known, shown, moved, strict=True):
        log_origin(stream, run.scenario.leg, own, look)
        _send_run(stream, run, look, poses, room)


def _head(record: Record) -> Record:
    """Return so many rows of a record that all its plots are known, but not what they show."""
    return {name: column[:2] for name, column in record.items()}


def started(name: str) -> rr.RecordingStream:
    """Return the stream of a new recording, not connected to any output yet.

    Raises:
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    import rerun as rr

    stream = rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False)
    # A stream that is switched off would take everything and record nothing.
    if not stream.is_enabled():
        raise RerunDisabledError(
            f"Rerun is switched off: RERUN must be unset or 'on', got {os.environ.get('RERUN')!r}"
        )
    stream.send_recording_name(name)
    return stream


def log_room(stream: rr.RecordingStream, room: Room) -> None:
    """Log what does not belong to any leg: which way is up, and the floor."""
    import rerun as rr

    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    if room.floor:
        ground.log_floor(stream, room)


def log_origin(stream: rr.RecordingStream, leg: FiveBar, own: str, look: Look) -> None:
    """Log a run's leg in numbers, and what identifies the run."""
    import rerun as rr

    # As JSON, since a plain value keeps the type that it first had.
    stream.send_property(f"{look.root}leg", rr.AnyValues(json=json.dumps(asdict(leg))))
    stream.send_property(f"{look.root}{PROPERTY}", rr.AnyValues(sha256=own))


def _send_run(
    stream: rr.RecordingStream,
    run: Run,
    look: Look,
    moved: DrawnMotion,
    room: Room,
) -> None:
    """Send one run: the leg's motion, the foot, the ground, the plots."""
    leg = run.scenario.leg
    time = run.record["time"]
    rows = drawn_rows(time)
    drawn = times(time[rows], rows + 1)
    scene.log_leg(stream, leg, look)
    scene.send_leg(stream, leg, moved, look, drawn)
    foot.log_foot(stream, points(run.record, "target"), look)
    foot.send_foot(stream, leg, moved, look, drawn)
    ground.send_ground(stream, leg, moved, look, drawn, room)

    send_plots(stream, series(run.scenario, run.record), look, time)


def send_plots(
    stream: rr.RecordingStream, plots: Iterable[Series], look: Look, time: Array
) -> None:
    """Send every row of plots, one after the other.

    Together they would take more memory than the record.

    Args:
        stream: Where they are sent.
        plots: The plots.
        look: How the run looks.
        time: Time of each row [s], (N,).
    """
    known: dict[int, list[rr.TimeColumn]] = {}
    for plot in plots:
        for steps, part in parts(plot):
            begin = int(steps[0])
            if begin not in known:
                known[begin] = times(time[begin - 1 : steps[-1]], steps)
            send_series(stream, part, look, known[begin])


def parts(plot: Series) -> Iterator[tuple[Rows, Series]]:
    """Yield the steps, from 1, and the values of a plot, `CHUNK` rows at a time."""
    sent = 0
    for begin in range(0, len(plot.shown), CHUNK):
        shown = plot.shown[begin : begin + CHUNK]
        values = plot.values[sent : sent + int(shown.sum())]
        sent += len(values)
        yield np.arange(begin, begin + len(shown)) + 1, plot._replace(values=values, shown=shown)


def times(time: Array, steps: Rows) -> list[rr.TimeColumn]:
    """Return both timelines at the times [s] of some steps, counted from 1."""
    import rerun as rr

    # Rounded here, since Rerun itself would truncate.
    stamps = np.round(time * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn("sim_time", duration=stamps), rr.TimeColumn("step", sequence=steps)]


def send_series(
    stream: rr.RecordingStream, plot: Series, look: Look, times: list[rr.TimeColumn]
) -> None:
    """Send all lines of a plot as one column; a row without values is empty, a gap in the line."""
    import pyarrow
    import rerun as rr

    style = rr.SeriesLines(
        names=[look.line(name) for name in plot.lines],
        colors=[look.colour(colour) for colour in plot.lines.values()],
    )
    stream.log(f"{look.root}{plot.path}", style, static=True)
    values = rr.components.ScalarBatch(pyarrow.array(plot.values.ravel()))
    counts = len(plot.lines) * plot.shown
    column = rr.ComponentColumn(rr.Scalars.descriptor_scalars(), values, lengths=counts)
    stream.send_columns(f"{look.root}{plot.path}", times, [column])
