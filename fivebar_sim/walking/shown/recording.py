"""The Rerun recording of robots' runs: trunk and legs that move, plots, limits.

Rerun is slow to import: only the functions that use it do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.metrics.columns import Record
from fivebar_sim.recording import foot, layout, rrd
from fivebar_sim.recording import leg as legs
from fivebar_sim.recording.look import GREY, Colour, Look, looks, shade
from fivebar_sim.recording.plots import Series
from fivebar_sim.recording.poses import Room, Rows, drawn_motion, drawn_rows, points
from fivebar_sim.recording.summary import summary
from fivebar_sim.render import palette
from fivebar_sim.robots import LEGS, Floor, Robot, places
from fivebar_sim.robots.columns import of_leg, trunk
from fivebar_sim.robots.hips import turned
from fivebar_sim.robots.hips.motors import MOTORS, column
from fivebar_sim.robots.measure import Trunk, heading, lean
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario.run import Run
from fivebar_sim.simulation.provenance import identity
from fivebar_sim.walking.shown import ground as shown_ground

if TYPE_CHECKING:
    import rerun as rr

TRUNK = "trunk"

COLOURS: dict[str, Colour] = {
    leg: palette.on_any_paper(palette.RUNS[k]) for k, leg in enumerate(LEGS)
}
"""Colours of the legs in plots."""

TURNED = (0.0, 0.0, 1.0, 0.0)
"""Half a turn about z, as a quaternion (x, y, z, w)."""


class Drawn(NamedTuple):
    """The rows of a record that are drawn.

    Attributes:
        rows: Those rows.
        times: Their times.
    """

    rows: Rows
    times: list[rr.TimeColumn]


def write(
    path: Path, runs: Sequence[Run], labels: Sequence[str] = (), identities: Sequence[str] = ()
) -> None:
    """Write the recording of one or more robots' runs to a .rrd file; see `rrd.write`."""
    names = list(labels) or [run.scenario.name for run in runs]
    with rrd.file_of(path, names) as stream:
        send(stream, runs, names, identities)


def send(
    stream: rr.RecordingStream,
    runs: Sequence[Run],
    names: list[str],
    identities: Sequence[str] = (),
) -> None:
    """Send the layout, the text, the floor and all runs, each with its name; see `rrd.write`."""
    import rerun as rr

    shown = looks(names)
    plots = [list(series(run.record)) for run in runs]
    room = _room(runs)
    text = summary(
        names,
        [run.measured for run in runs],
        [run.scenario.limits for run in runs],
        [f"{_robot(run).name}: legs {_robot(run).leg.name}" for run in runs],
    )
    layout.send(stream, layout.contents(room, shown, plots))
    stream.log(layout.SUMMARY, rr.TextDocument(text, media_type="text/markdown"), static=True)
    grounds = [run.scenario.scene for run in runs]
    uneven = [isinstance(scene, Floor) and not scene.ground.level for scene in grounds]
    # A floor that no run is on would hide the ground of those that there are.
    rrd.log_room(stream, room._replace(floor=room.floor and not all(uneven)))
    known = identities or [identity(run) for run in runs]
    for run, own, look, lines in zip(runs, known, shown, plots, strict=True):
        rrd.log_origin(stream, _robot(run).leg, own, look)
        _send_run(stream, run, look, room)
        rrd.send_plots(stream, lines, look, run.record["time"])


def _robot(run: Run) -> Robot:
    assert isinstance(run.scenario, RobotScenario)
    return run.scenario.robot


def _send_run(stream: rr.RecordingStream, run: Run, look: Look, room: Room) -> None:
    """Send one run: what stands still, and what moves."""
    robot = _robot(run)
    rows = drawn_rows(run.record["time"])
    targets = {leg: points(of_leg(run.record, leg), "target")[rows] for leg in LEGS}
    scene = run.scenario.scene
    if isinstance(scene, Floor) and not scene.ground.level:
        shown_ground.log(stream, room, scene.ground, look.root)
    log_still(stream, robot, targets, look, on_floor=isinstance(scene, Floor))
    drawn = Drawn(rows, rrd.times(run.record["time"][rows], rows + 1))
    send_moving(stream, robot, run.record, drawn, look, room)


def log_still(
    stream: rr.RecordingStream,
    robot: Robot,
    targets: Mapping[str, Array],
    look: Look,
    *,
    on_floor: bool,
) -> None:
    """Log what does not move: the trunk and the legs in their own frames.

    Args:
        stream: The recording.
        robot: The robot.
        targets: Where each leg's foot should be at one time or another, hip frame [m], (n, 2).
        look: How the run looks.
        on_floor: Whether its feet may touch a floor.
    """
    import rerun as rr

    box = rr.Boxes3D(
        centers=[robot.trunk.center],
        half_sizes=[[0.5 * side for side in robot.trunk.size]],
        colors=[look.colour(GREY)],
        labels=[look.label] if look.label else None,
        fill_mode="majorwireframe",
    )
    stream.log(f"{look.root}{TRUNK}", box, static=True)

    for name in LEGS:
        hip = robot.hips[name]
        root = f"{look.root}{TRUNK}/{name}"
        if not hip.motors:
            facing = rr.Quaternion(xyzw=TURNED if hip.mirrored else (0.0, 0.0, 0.0, 1.0))
            fixed = rr.Transform3D(translation=hip.pos, quaternion=facing)
            stream.log(root, fixed, static=True)
        legs.log_leg(stream, robot.leg, _of_leg(look, name))
        path = rr.LineStrips3D(
            [legs.in_space(targets[name])],
            radii=rr.Radius.ui_points(1.0),
            colors=[look.colour(shade("target"))],
        )
        stream.log(f"{root}/{foot.TARGET_PATH}", path, static=True)
        if on_floor:
            arrow = rr.Arrows3D.from_fields(
                radii=[0.3 * robot.leg.radius], colors=[look.colour(shade("force"))]
            )
            stream.log(_force(look, name), arrow, static=True)


def _of_leg(look: Look, name: str) -> Look:
    """Return how one leg of a run looks."""
    return look._replace(root=f"{look.root}{TRUNK}/{name}/", label=look.label and name)


def _force(look: Look, name: str) -> str:
    """Return the entity of the floor's force on a leg's foot."""
    return f"{look.root}ground_force/{name}"


def send_moving(
    stream: rr.RecordingStream, robot: Robot, record: Record, drawn: Drawn, look: Look, room: Room
) -> None:
    """Send what moves, in some rows of a record: trunk, legs, the floor's forces."""
    import rerun as rr

    rows = drawn.rows
    body = trunk(record)
    if body is not None:
        facing = body.quaternion[rows][:, [1, 2, 3, 0]]
        poses = rr.Transform3D.columns(translation=body.position[rows], quaternion=facing)
        stream.send_columns(f"{look.root}{TRUNK}", drawn.times, poses)
    for name in LEGS:
        own = of_leg(record, name)
        _send_leg(stream, robot, name, own, drawn, look)
        if body is not None:
            seen = Trunk(*(each[rows] for each in body))
            shown = {key: column[rows] for key, column in own.items()}
            arrows = _forces(robot, name, seen, shown, room)
            stream.send_columns(_force(look, name), drawn.times, arrows)


def _send_leg(
    stream: rr.RecordingStream, robot: Robot, name: str, record: Record, drawn: Drawn, look: Look
) -> None:
    """Send one leg, in the trunk's frame."""
    import rerun as rr

    hip = robot.hips[name]
    own = _of_leg(look, name)
    if hip.motors:
        turns = turned.angles(hip, record)[drawn.rows]
        origin = turned.in_trunk(hip, np.zeros((len(turns), 2)), turns)
        frames = rr.Transform3D.columns(
            translation=origin, quaternion=turned.quaternion(hip, turns)[:, [1, 2, 3, 0]]
        )
        stream.send_columns(own.root.removesuffix("/"), drawn.times, frames)
    # Without the ground: the hip hangs on the trunk, not on a rail.
    moved = drawn_motion(_in_air(record), drawn.rows)
    legs.send_leg(stream, robot.leg, moved, own, drawn.times)


def _in_air(record: Record) -> Record:
    return {name: column for name, column in record.items() if not name.startswith("ground")}


def _forces(
    robot: Robot, name: str, body: Trunk, record: Record, room: Room
) -> rr.ComponentColumnList:
    """Return the floor's forces on a foot as arrows, hidden while the foot is in the air."""
    import rerun as rr

    force = np.stack([record[f"ground_{axis}"] for axis in "xyz"], axis=-1)
    place = places.feet(body, robot.hips[name], record)
    down = force[:, 2] > 0.0
    arrows = rr.Arrows3D.columns(
        origins=place[down] - np.array([0.0, 0.0, robot.leg.foot_radius]),
        vectors=room.metre_per_newton * force[down],
    )
    # Rows in the air get an empty batch: without one the last arrow would stay in sight.
    return arrows.partition(down.astype(np.intp))


def series(record: Record) -> Iterator[Series]:
    """Yield the plots of a robot's run, in the order in which they are shown."""
    every = np.ones(len(record["time"]), dtype=bool)
    body = trunk(record)
    hips = [motor.letter for motor in MOTORS if f"{LEGS[0]}_{column('torque', motor)}" in record]
    for motor in ("A", "E", *hips):
        columns = {leg: record[f"{leg}_torque_{motor}"] for leg in LEGS}
        yield _of_legs(f"torque_{motor}", f"Torques of {motor} [mN m]", columns, 1e3)
    errors = {
        leg: np.hypot(
            record[f"{leg}_foot_x"] - record[f"{leg}_target_x"],
            record[f"{leg}_foot_z"] - record[f"{leg}_target_z"],
        )
        for leg in LEGS
    }
    yield _of_legs("tracking_error", "Tracking errors [mm]", errors, 1e3)
    if body is None:
        return

    forces = {leg: record[f"{leg}_ground_z"] for leg in LEGS}
    yield _of_legs("ground_force", "Vertical forces on the feet [N]", forces, 1.0)
    height = 1e3 * body.position[:, 2:]
    yield Series("height", "Height of the trunk [mm]", {"trunk": shade("ink")}, height, every)
    angles = np.degrees(np.stack([lean(body.quaternion), heading(body.quaternion)], axis=-1))
    colours = {"lean": shade("foot"), "heading": shade("A")}
    yield Series("attitude", "Lean and heading of the trunk [deg]", colours, angles, every)


def _of_legs(path: str, title: str, columns: dict[str, Array], scale: float) -> Series:
    """Return a plot with a line for each leg."""
    values = scale * np.stack([columns[leg] for leg in LEGS], axis=-1)
    return Series(path, title, dict(COLOURS), values, np.ones(len(values), dtype=bool))


def _room(runs: Sequence[Run]) -> Room:
    """Return the room that all runs need."""
    bodies = [trunk(run.record) for run in runs]
    seen = [body.position[:, [0, 2]] for body in bodies if body is not None]
    size = max(max(_robot(run).length, _robot(run).leg.size) for run in runs)
    places_seen = np.concatenate([np.zeros((1, 2)), *seen])
    margin = np.array([size, 0.0])

    forces = [
        float(np.abs(run.record[f"{leg}_ground_z"]).max())
        for run, body in zip(runs, bodies, strict=True)
        for leg in LEGS
        if body is not None
    ]
    largest = max(forces, default=0.0)

    return Room(
        low=places_seen.min(axis=0) - margin,
        high=places_seen.max(axis=0) + margin,
        size=size,
        metre_per_newton=0.5 * size / largest if largest > 0.0 else 0.0,
        floor=bool(seen),
    )
