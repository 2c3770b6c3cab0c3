"""Uneven ground in a recording: as much of it as lies around the runs.

Rerun is slow to import: only the functions that use it do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.recording.ground import FLOOR
from fivebar_sim.recording.look import GREY
from fivebar_sim.recording.poses import Room
from fivebar_sim.robots.ground import Ground, Rough, Steps

if TYPE_CHECKING:
    import rerun as rr

AROUND = 1.0
"""How far it is drawn beyond the trunks' ways, in sizes of the robot."""


def log(stream: rr.RecordingStream, room: Room, ground: Ground, entity: str) -> None:
    """Log the surface of uneven ground.

    Args:
        stream: The recording.
        room: What the runs need.
        ground: The ground.
        entity: The run's place in the recording: "" or "name/".
    """
    import rerun as rr

    corners = triangles(ground, *lines(ground, room))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = rr.Mesh3D(
        vertex_positions=corners.reshape(-1, 3),
        # One each, so that every triangle is seen as one.
        vertex_normals=np.repeat(normals, 3, axis=0),
        albedo_factor=[*GREY, 255],
    )
    stream.log(f"{entity}{FLOOR}", mesh, static=True)


def lines(ground: Ground, room: Room) -> tuple[Array, Array]:
    """Return x and y between which the ground around the runs is a plane, or two [m]."""
    reach = AROUND * room.size
    x = _bends(ground, float(room.low[0]) - reach, float(room.high[0]) + reach)
    # Steps run across.
    y = _bends(ground if isinstance(ground, Rough) else None, -reach, reach)
    return x, y


def triangles(ground: Ground, x: Array, y: Array) -> Array:
    """Return the triangles between lines along y at x and lines along x at y, (n, 3, 3) [m].

    Each rectangle is halved from its corner of least x and y, as the ground's own cells are.
    """
    across, along = np.meshgrid(y, x, indexing="ij")
    points = np.stack([along, across, ground.heights(along, across)], axis=-1)
    near = points[:-1, :-1]
    right = points[:-1, 1:]
    left = points[1:, :-1]
    far = points[1:, 1:]
    halves = [np.stack([near, right, far], axis=-2), np.stack([near, far, left], axis=-2)]
    return np.concatenate([half.reshape(-1, 3, 3) for half in halves])


def _bends(ground: Ground | None, low: float, high: float) -> Array:
    """Return where the ground bends between two ends, and the ends [m]."""
    bends = np.empty(0)
    if isinstance(ground, Steps):
        # Both sides of each wall.
        bends = np.concatenate([ground.edges, np.nextafter(ground.edges, -np.inf)])
    if isinstance(ground, Rough):
        bends = ground.cell * np.arange(len(ground.points)) - 0.5 * ground.side
    return np.unique(np.concatenate([[low, high], bends[(bends > low) & (bends < high)]]))
