"""Marks in a MuJoCo scene: bars, arrows, balls and pins.

Each mark is moved towards the eye along its line of sight: it appears at the same place, but in
front of the links.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array

Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""


class Pen:
    """Adds geoms to a scene.

    Args:
        scene: The scene.
        eye: Position of the camera [m], (3,).
        front: How far marks are moved towards the eye [m].
    """

    def __init__(self, scene: mujoco.MjvScene, eye: Array, front: float) -> None:
        self._scene = scene
        self._eye = eye
        self._front = front

    def before(self, points: Array, times: float = 1.0) -> Array:
        """Return points (x, z) of the leg plane moved in front of it, (..., 2) to (..., 3)."""
        space = np.stack([points[..., 0], np.zeros(points.shape[:-1]), points[..., 1]], axis=-1)
        ray = self._eye - space
        return space + times * self._front * ray / np.linalg.norm(ray, axis=-1, keepdims=True)

    def bar(self, start: ArrayLike, end: ArrayLike, radius: float, colour: Colour) -> None:
        """Add a capsule."""
        self._connect(mujoco.mjtGeom.mjGEOM_CAPSULE, start, end, radius, colour)

    def arrow(self, start: ArrayLike, end: ArrayLike, radius: float, colour: Colour) -> None:
        """Add an arrow."""
        self._connect(mujoco.mjtGeom.mjGEOM_ARROW, start, end, radius, colour)

    def ball(self, centre: Array, radius: float, colour: Colour) -> None:
        """Add a sphere."""
        geom = self._new(mujoco.mjtGeom.mjGEOM_SPHERE, colour)
        geom.size[:] = radius
        geom.pos[:] = centre

    def pin(self, centre: Array, radius: float, colour: Colour) -> None:
        """Add a disc that faces the camera, along y."""
        across = np.array([0.0, 0.1 * radius, 0.0])
        kind = mujoco.mjtGeom.mjGEOM_CYLINDER
        self._connect(kind, centre - across, centre + across, radius, colour)

    def _connect(
        self, kind: int, start: ArrayLike, end: ArrayLike, radius: float, colour: Colour
    ) -> None:
        mujoco.mjv_connector(self._new(kind, colour), kind, radius, _point(start), _point(end))

    def _new(self, kind: int, colour: Colour) -> mujoco.MjvGeom:
        """Return the scene's next geom."""
        geom = self._scene.geoms[self._scene.ngeom]
        rgba = np.array([*colour, 1.0], np.float32)
        # Size, position and orientation are placeholders: the caller sets them.
        mujoco.mjv_initGeom(geom, kind, np.ones(3), np.zeros(3), np.eye(3).ravel(), rgba)
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        geom.emission = 0.15
        geom.specular = 0.0
        self._scene.ngeom += 1
        return geom


def _point(point: ArrayLike) -> Array:
    return np.asarray(point, dtype=np.float64)
