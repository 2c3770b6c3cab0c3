"""The Rerun recording of a comparison: the simulated leg, and the logged one as a ghost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.overlay.compare import UNITS, Compared
from fivebar_sim.overlay.page import SCALES, shown
from fivebar_sim.recording import foot, ground, layout, rrd
from fivebar_sim.recording import leg as scene
from fivebar_sim.recording.look import LIGHT_GREY, Look, shade
from fivebar_sim.recording.plots import Series
from fivebar_sim.recording.poses import (
    POSE_PERIOD,
    DrawnMotion,
    Room,
    Rows,
    drawn_motion,
    drawn_rows,
    room_of,
)

if TYPE_CHECKING:
    import rerun as rr

RUN = Look("run/", "run")
LOG = Look("log/", "log", LIGHT_GREY)
"""The logged leg is grey, the simulated one has its colours."""

PLOTS = {"theta": "Angles", "torque": "Motor torques", "current": "Motor currents"}
"""What is plotted of both motors, where the log has it."""


class Moved(NamedTuple):
    """A leg's motion as it is drawn.

    Attributes:
        look: Whose it is.
        motion: Its poses.
        time: Of each pose, on the run's clock [s], (n,).
    """

    look: Look
    motion: DrawnMotion
    time: Array


def write(found: Compared, place: Path) -> None:
    """Write the recording of a comparison, on the run's clock: the log's delay is taken out.

    Args:
        found: The comparison.
        place: A .rrd file; an existing one is overwritten, and gone if this fails.

    Raises:
        ConfigError: The place does not end in .rrd.
        OSError: The file cannot be written.
        RerunDisabledError: The environment variable RERUN switches Rerun off.
    """
    if place.suffix.lower() != ".rrd":
        raise ConfigError(f"cannot write {place}: a recording must end in .rrd")
    legs = (_run(found), _log(found))
    plots = {look: list(_plots(found, look)) for look in (RUN, LOG)}
    room = room_of([found.scenario.leg] * 2, [each.motion for each in legs])

    with rrd.file_of(place, [found.scenario.name, Path(found.log.where).name]) as stream:
        views = layout.contents(room, [RUN, LOG], list(plots.values()))
        layout.send(stream, views)
        _send_words(stream, found)
        rrd.log_room(stream, room)
        for each in legs:
            _send_leg(stream, found, each, room)
        for look, series in plots.items():
            for plot in series:
                rrd.send_series(stream, plot, look, _times(found, found.run_time))


def _run(found: Compared) -> Moved:
    """Return the simulated leg's motion, whose foot has the logged one as its target."""
    time = found.record["time"]
    rows = drawn_rows(time)
    return Moved(RUN, drawn_motion(found.record, rows), time[rows])


def _log(found: Compared) -> Moved:
    """Return the logged leg's motion: the scenario's links at the log's angles."""
    time, theta = found.log.complete("theta_A", "theta_E")
    time = found.clock.of_run(time)
    rows = _thinned(time, float(found.record["time"][-1]))
    q = _pose(found.scenario.leg, theta[rows])
    feet = kinematics.forward(found.scenario.leg, theta[rows])
    # Only the run knows how high its hip is.
    hip = None
    if "hip_z" in found.record:
        hip = np.interp(time[rows], found.record["time"], found.record["hip_z"])
    return Moved(LOG, DrawnMotion(q, feet, feet, hip), time[rows])


def _thinned(time: Array, last: float) -> Rows:
    """Return the rows of a log that are drawn: within the run, one every `POSE_PERIOD`."""
    within = np.flatnonzero((time >= 0.0) & (time <= last))
    _, first = np.unique(np.floor(time[within] / POSE_PERIOD + 1e-6), return_index=True)
    return within[first]


def _pose(leg: FiveBar, theta: Array) -> Array:
    """Return all four joints' angles at those of the motors [rad], (n, 4)."""
    knees = kinematics.passive(leg, theta)
    return np.stack([theta[:, 0], knees[:, 0], theta[:, 1], knees[:, 1]], axis=-1)


def _times(found: Compared, time: Array) -> list[rr.TimeColumn]:
    """Return both timelines at moments of the run [s]: `step` is the nearest one."""
    return rrd.times(time, np.rint(time / found.scenario.sim.timestep).astype(np.intp))


def _send_leg(stream: rr.RecordingStream, found: Compared, each: Moved, room: Room) -> None:
    """Send one leg with its foot, and what the ground does to the run's."""
    leg = found.scenario.leg
    times = _times(found, each.time)
    scene.log_leg(stream, leg, each.look)
    scene.send_leg(stream, leg, each.motion, each.look, times)
    # Each foot's whole way stands as a line, where a run has its target's.
    foot.log_foot(stream, each.motion.foot, each.look)
    foot.send_foot(stream, leg, each.motion, each.look, times)
    ground.send_ground(stream, leg, each.motion, each.look, times, room)


def _plots(found: Compared, look: Look) -> Iterator[Series]:
    """Yield what run or log says of the motors; with the run's also log less run."""
    for kind, title in PLOTS.items():
        names = [f"{kind}_{motor}" for motor in "AE"]
        if not set(names) <= set(found.channels):
            continue

        scale, unit = SCALES[UNITS[names[0]]]
        channels = [found.channels[name] for name in names]
        lines = {motor: shade(motor) for motor in "AE"}
        values = [each.run if look is RUN else each.log for each in channels]
        yield _series(found, names, kind, f"{title} [{unit}]", lines, scale, values)
        if look is RUN:
            apart = [each.difference for each in channels]
            said = f"{title}, log - run [{unit}]"
            yield _series(found, names, f"apart_{kind}", said, lines, scale, apart)


def _series(
    found: Compared,
    names: list[str],
    path: str,
    title: str,
    lines: dict[str, tuple[int, int, int]],
    scale: float,
    values: list[Array],
) -> Series:
    """Return a plot at those of the compared rows in which the log has both motors' values."""
    rows = found.clock.rows(found.log.time, found.record)
    there = [np.isfinite(found.log.channels[name][rows]) for name in names]
    both = there[0] & there[1]
    columns = [each[both[own]] for each, own in zip(values, there, strict=True)]
    return Series(path, title, lines, scale * np.stack(columns, axis=-1), both)


def _send_words(stream: rr.RecordingStream, found: Compared) -> None:
    """Send the text: what lies over what, and how far apart."""
    import rerun as rr

    name = Path(found.log.where).name
    rows = [
        f"| {key} | {shown(channel.parts['rms'], UNITS[key])} |"
        for key, channel in found.channels.items()
    ]
    text = "\n".join(
        [
            f"# {name} over {found.scenario.name}",
            "",
            "The log's leg is grey, the run's has its colours; the lines are the ways of their "
            f"feet. The log is {shown(found.delay, 's')} later than the run, which is taken out.",
            "",
            "| log - run | RMS |",
            "| --- | --- |",
            *rows,
        ]
    )
    stream.log(layout.SUMMARY, rr.TextDocument(text, media_type="text/markdown"), static=True)
