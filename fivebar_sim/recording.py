"""The Rerun recording of a run, derived from its record: the moving leg, the series, the metrics.

Rerun is slow to import: only the functions that use it do.
"""

from __future__ import annotations

import importlib.util
import json
import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fivebar_sim import recording_scene as scene
from fivebar_sim.arrays import Array
from fivebar_sim.errors import FiveBarError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.recording_series import Series, points, series, summary, timestep

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

Rows = NDArray[np.intp]

APPLICATION = "fivebar"
SUMMARY = "summary"
LOCK = threading.Lock()
POSE_PERIOD = 0.01
"""Time between two drawn poses [s]: 100 Hz looks like every step, at a fraction of the size."""


class ViewerMissingError(FiveBarError, FileNotFoundError):
    """The installed Rerun has no viewer binary."""


class RerunDisabledError(FiveBarError, RuntimeError):
    """Rerun is switched off by the environment."""


def write(
    path: Path, leg: FiveBar, record: Mapping[str, Array], metrics: Mapping[str, Any], name: str
) -> None:
    """Write the recording of a run to a .rrd file, in one go.

    Timelines: `sim_time` (the record's time, to the nanosecond) and `step` (from 1: t = step h).
    Series have every row of the record, poses one row every `POSE_PERIOD` and the last one. The
    bytes are complete before the file is opened, so what fails on the disk is a plain OSError.

    Args:
        path: The file; an existing one is overwritten.
        leg: The leg that moved.
        record: Columns of a run (SI, hip frame), each (N,), N > 0.
        metrics: What was measured; tables may nest.
        name: Of the run, not empty; also the recording's id.

    Raises:
        OSError: The file cannot be written.
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    with _session():
        data = _encoded(leg, record, metrics, name)
    path.write_bytes(data)


@contextmanager
def _session() -> Iterator[None]:
    """Let mistakes in the use of Rerun raise (they are warnings otherwise), and tidy up after it.

    Rerun's strictness is global, so one recording is made at a time. A recording that nothing
    refers to any more still keeps its threads and megabytes until it is cleaned up explicitly.
    """
    import rerun as rr
    import rerun_bindings

    with LOCK:
        before = rr.strict_mode()
        rr.set_strict_mode(True)
        try:
            yield
        finally:
            rr.set_strict_mode(before)
            rerun_bindings.flush_and_cleanup_orphaned_recordings()


def _encoded(
    leg: FiveBar, record: Mapping[str, Array], metrics: Mapping[str, Any], name: str
) -> bytes:
    """Return the bytes of the recording."""
    import rerun as rr

    time = record["time"]
    every, drawn = np.arange(len(time)), drawn_rows(time)
    foot, target = points(record, "foot"), points(record, "target")
    q = np.stack([record[f"theta_{joint}"] for joint in "ABED"], axis=-1)
    motion = scene.Motion(q[drawn], foot[drawn], target[drawn])
    plots = list(series(record))
    text = rr.TextDocument(summary(metrics, name), media_type="text/markdown")

    stream = rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False)
    if not stream.is_enabled():
        raise RerunDisabledError(
            f"Rerun is switched off: RERUN must be unset or 'on', got {os.environ.get('RERUN')!r}"
        )
    output = stream.binary_stream()
    _send_properties(stream, leg, name)
    _send_blueprint(stream, _contents(leg, motion, plots))
    stream.log(SUMMARY, text, static=True)
    scene.log_leg(stream, leg)
    scene.log_path(stream, target)
    scene.send_motion(stream, leg, motion, _times(time, drawn))
    for plot in plots:
        _send_series(stream, plot, _times(time, every))
    data = output.read()
    assert data is not None
    return data


def drawn_rows(time: Array) -> Rows:
    """Return the rows whose poses are drawn: the first, one every `POSE_PERIOD`, and the last."""
    every = max(1, round(POSE_PERIOD / timestep(time)))
    return np.union1d(np.arange(0, len(time), every), len(time) - 1)


def _times(time: Array, rows: Rows) -> list[rr.TimeColumn]:
    """Return both timelines at some rows; row k is the state after k + 1 steps."""
    import rerun as rr

    stamps = np.round(time[rows] * 1e9).astype("timedelta64[ns]")  # Rerun itself would truncate
    return [rr.TimeColumn("sim_time", duration=stamps), rr.TimeColumn("step", sequence=rows + 1)]


def _send_properties(stream: rr.RecordingStream, leg: FiveBar, name: str) -> None:
    """Send the run's name, and the leg as JSON: a plain value keeps the type it first had."""
    import rerun as rr

    stream.send_recording_name(name)
    stream.send_property("leg", rr.AnyValues(json=json.dumps(asdict(leg))))


def _send_series(stream: rr.RecordingStream, plot: Series, times: list[rr.TimeColumn]) -> None:
    """Send all lines of a plot as one column; a row without values is an empty one, a gap."""
    import rerun as rr

    look = rr.SeriesLines(names=list(plot.lines), colors=list(plot.lines.values()))
    stream.log(plot.path, look, static=True)
    values = rr.Scalars.columns(scalars=plot.values.ravel())
    stream.send_columns(plot.path, times, values.partition(len(plot.lines) * plot.shown))


def _contents(leg: FiveBar, motion: scene.Motion, plots: list[Series]) -> rrb.Container:
    """Return the views: leg and metrics on the left, the plots on the right."""
    import rerun.blueprint as rrb

    views = [_plot_view(plot) for plot in plots]
    text = rrb.TextDocumentView(origin=SUMMARY, name="Metrics")
    left = rrb.Vertical(scene.view(leg, motion), text, row_shares=[3, 2])
    right = rrb.Vertical(*views[:-2], rrb.Tabs(*views[-2:]))
    return rrb.Horizontal(left, right)


def _send_blueprint(stream: rr.RecordingStream, contents: rrb.Container) -> None:
    """Send the layout.

    Rerun logs it to a stream of its own, which would live (with threads and megabytes) until the
    process ends: it belongs to a sink that belongs to it. Disconnecting parts the two.
    """
    import rerun.blueprint as rrb

    streams: list[rr.RecordingStream] = []

    class Layout(rrb.Blueprint):
        def _log_to_stream(self, stream: rr.RecordingStream) -> None:
            streams.append(stream)
            super()._log_to_stream(stream)

    layout = Layout(
        contents,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", loop_mode="all"),
        auto_layout=False,
        auto_views=False,
    )
    stream.send_blueprint(layout)
    while streams:  # emptied, since a class lives until the next garbage collection
        streams.pop().disconnect()


def _plot_view(plot: Series) -> rrb.TimeSeriesView:
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin=plot.path,
        name=plot.title,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=rrb.ScalarAxis(range=plot.bounds) if plot.bounds else None,
    )


def viewer_command(path: Path) -> list[str]:
    """Return the command that opens a recording in a new native viewer, reachable from here only.

    Rerun's viewer also serves, by default to the whole network; it binds the loopback only when
    its command line says so. The `rerun` script on the PATH is a wrapper that outlives its viewer
    or dies without it, so this is the binary itself.

    Raises:
        ViewerMissingError: The installation lacks the binary.
    """
    spec = importlib.util.find_spec("rerun_cli")
    folders = [Path(folder) for folder in (spec and spec.submodule_search_locations) or []]
    for folder in folders:
        for binary in ("Rerun.app/Contents/MacOS/Rerun", "rerun", "rerun.exe"):
            if (folder / binary).is_file():
                loopback = ["--bind", "127.0.0.1", "--port", "auto"]
                return [str(folder / binary), *loopback, str(path.resolve())]
    raise ViewerMissingError(
        f"the viewer's binary is missing from rerun-sdk: no 'rerun' in {folders or 'rerun_cli'}"
    )
