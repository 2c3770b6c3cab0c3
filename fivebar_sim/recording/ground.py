"""The ground of a recording: the floor, the belt that runs on it, its force on the foot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.geometry import FiveBar
from fivebar_sim.recording.leg import in_space
from fivebar_sim.recording.look import GREY, LIGHT_GREY, Look, shade
from fivebar_sim.recording.poses import DrawnMotion, Room

if TYPE_CHECKING:
    import rerun as rr

FLOOR = "floor"
BELT = "belt"
FORCE = "ground_force"
MARGIN = 0.4
WIDTH = 0.6
"""How far the floor reaches beyond the leg, and how wide it is, in sizes of the leg."""
STRIPES = 8
"""Number of stripes across a belt."""


def log_floor(stream: rr.RecordingStream, stage: Room) -> None:
    """Log the floor under all legs; its surface is at z = 0."""
    import rerun as rr

    half = 0.5 * _length(stage)
    y = 0.5 * WIDTH * stage.size
    # The box's top is the floor, so its centre lies half its height below.
    thick = 0.01 * stage.size
    floor = rr.Boxes3D(
        centers=[[_start(stage) + half, 0.0, -thick]],
        half_sizes=[[half, y, thick]],
        colors=[GREY],
        fill_mode="solid",
    )
    stream.log(FLOOR, floor, static=True)


def _start(stage: Room) -> float:
    return float(stage.low[0]) - MARGIN * stage.size


def _length(stage: Room) -> float:
    return float(stage.high[0] - stage.low[0]) + 2.0 * MARGIN * stage.size


def send_ground(
    stream: rr.RecordingStream,
    leg: FiveBar,
    moved: DrawnMotion,
    look: Look,
    times: list[rr.TimeColumn],
    stage: Room,
) -> None:
    """Send the ground's force on the foot, and the belt, as columns, if there are any.

    The force is an arrow from the contact, hidden while the foot is in the air.
    """
    import rerun as rr

    if moved.force is not None:
        arrow = rr.Arrows3D.from_fields(
            radii=[0.3 * leg.radius], colors=[look.colour(shade("force"))]
        )
        stream.log(f"{look.root}{FORCE}", arrow, static=True)
        down = moved.force[:, 1] > 0.0
        contact = moved.world_foot - np.array([0.0, leg.foot_radius])
        arrows = rr.Arrows3D.columns(
            origins=in_space(contact[down]),
            vectors=in_space(stage.metre_per_newton * moved.force[down]),
        )
        # Rows in the air get an empty batch: without one the last arrow would stay in sight.
        stream.send_columns(f"{look.root}{FORCE}", times, arrows.partition(down.astype(np.intp)))

    if moved.belt is not None:
        gap = _length(stage) / STRIPES
        y = 0.5 * WIDTH * stage.size
        starts = _start(stage) + gap * np.arange(STRIPES)
        stripes = [[[x, -y, 0.0], [x, y, 0.0]] for x in starts]
        lines = rr.LineStrips3D(
            stripes, radii=[0.004 * stage.size], colors=[look.colour(LIGHT_GREY)]
        )
        stream.log(f"{look.root}{BELT}", lines, static=True)
        # The stripes jump back by one gap as they reach the next: it looks like an endless belt.
        shift = in_space(np.stack([np.mod(moved.belt, gap), np.zeros_like(moved.belt)], axis=-1))
        columns = rr.Transform3D.columns(translation=shift)
        stream.send_columns(f"{look.root}{BELT}", times, columns)
