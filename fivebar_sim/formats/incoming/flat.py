"""The plane of a five-bar: which way it lies in space, and where its points are in it.

The hip frame has x forward and z up: up is the world's z, or its y if the plane lies flat; forward
is the world's x, or its y in a plane across it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.formats.incoming.loop import CLOSING, Loop, hinge_name
from fivebar_sim.formats.incoming.source import Frame, Source

FLAT = 1e-4
"""Angle between two axes [rad], and gap across the plane in leg sizes, that still count as none."""

Matrix = Array


class Plane(NamedTuple):
    """A leg's plane, in the frame of its ground link.

    Attributes:
        x: Forward, (3,).
        z: Up, (3,).
        off: Greatest angle between two axes [rad].
    """

    x: Array
    z: Array
    off: float


class Posed:
    """A model in a pose, and its bodies' places in the leg's plane.

    Args:
        source: The model.
        loop: Its loop.
        pose: The pose, (nq,).
    """

    def __init__(self, source: Source, loop: Loop, pose: Array) -> None:
        self._source = source
        self._loop = loop
        self.data = mujoco.MjData(source.model)
        self.data.qpos[:] = pose
        mujoco.mj_kinematics(source.model, self.data)
        self._turn = np.eye(3)
        self._shift = np.zeros(3)
        if loop.welded:
            self._weld()

    def _weld(self) -> None:
        """Find the motion that brings the welded bodies to where the weld wants them."""
        one = self._loop.closure.one
        other = self._loop.closure.other
        self._turn = self._axes(one) @ self._axes(other).T
        self._shift = self.origin(one) - self._turn @ self.origin(other)

    def _axes(self, frame: Frame) -> Matrix:
        """Return the axes of a frame as columns, (3, 3)."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, np.ascontiguousarray(frame.quat))
        return self.data.xmat[frame.body].reshape(3, 3) @ matrix.reshape(3, 3)

    def origin(self, frame: Frame) -> Array:
        """Return the origin of a frame [m], (3,)."""
        turn = self.data.xmat[frame.body].reshape(3, 3)
        return self.data.xpos[frame.body] + turn @ frame.pos

    def turn(self, body: int) -> Matrix:
        """Return what turns a body's world directions into those of its link, (3, 3)."""
        return self._turn if body in self._loop.welded else np.eye(3)

    def point(self, body: int, at: Array) -> Array:
        """Return a point of the world that is fixed to a body, where its link has it [m], (3,)."""
        return self._turn @ at + self._shift if body in self._loop.welded else at

    def hinge(self, k: int, link: int) -> Array:
        """Return hinge k as one of its two links has it [m], (3,)."""
        joint = self._loop.hinges[k]
        bodies = self._loop.links[link]
        if joint == CLOSING:
            closure = self._loop.closure
            return self.origin(closure.one if closure.one.body in bodies else closure.other)
        child = int(self._source.model.jnt_bodyid[joint])
        parent = int(self._source.model.body_parentid[child])
        return self.point(child if child in bodies else parent, self.data.xanchor[joint])

    def bent(self, plane: Plane, k: int, inner: int) -> float:
        """Return by how much hinge k must turn for a weld that the pose does not keep [rad].

        Args:
            plane: The leg's plane.
            k: The hinge.
            inner: Its inner link.
        """
        joint = self._loop.hinges[k]
        if joint == CLOSING:
            return 0.0
        child = int(self._source.model.jnt_bodyid[joint])
        parent = int(self._source.model.body_parentid[child])
        moved = {child, parent} & set(self._loop.welded)
        if not moved:
            return 0.0
        x, z = self.flat(plane, self._turn @ (self.ground() @ plane.x))
        turned = math.atan2(z, x)
        return turned if moved <= set(self._loop.links[inner]) else -turned

    def axis(self, k: int) -> Array | None:
        """Return the axis of hinge k in the world, (3,); None of a closure."""
        joint = self._loop.hinges[k]
        return None if joint == CLOSING else self.data.xaxis[joint].copy()

    def across(self) -> tuple[Array, Array]:
        """Return the gap of the closure [m], (3,), and how a weld turns, (3, 3)."""
        closure = self._loop.closure
        return self.origin(closure.one) - self.origin(closure.other), self._turn

    def ground(self) -> Matrix:
        """Return the axes of the ground link, (3, 3)."""
        return self.data.xmat[self._loop.links[0][0]].reshape(3, 3)

    def flat(self, plane: Plane, point: Array) -> Array:
        """Return a point of the world in the plane, from the world's origin [m], (2,)."""
        ground = self.ground()
        return np.array([point @ (ground @ plane.x), point @ (ground @ plane.z)])


def find(source: Source, loop: Loop) -> Plane:
    """Return the plane of a leg.

    Raises:
        ConfigError: It is not planar; says by how much.
    """
    posed = Posed(source, loop, source.poses[0])
    normal = posed.axis(0)
    assert normal is not None
    off = _check_parallel(source, loop, posed, normal)
    _check_gap(source, loop, posed, normal)

    z = _up(normal)
    x = np.cross(z, normal)
    # Forward: of the two ways to look at the plane, the one with the world's x, or y, to the right.
    forward = x[0] if abs(x[0]) > 1e-6 else x[1]
    x = math.copysign(1.0, forward) * x
    ground = posed.ground()
    return Plane(ground.T @ x, ground.T @ z, off)


def _check_parallel(source: Source, loop: Loop, posed: Posed, normal: Array) -> float:
    """Raise unless all axes are parallel; return the greatest angle between two [rad]."""
    _, turn = posed.across()
    axes = {hinge_name(source, loop, k): posed.axis(k) for k in range(len(loop.hinges))}
    axes[loop.closure.name] = turn @ normal
    off = 0.0

    for name, axis in axes.items():
        if axis is None:
            continue
        angle = float(np.arctan2(np.linalg.norm(np.cross(normal, axis)), abs(normal @ axis)))
        off = max(off, angle)
        if angle > FLAT:
            raise ConfigError(
                f"{source.path} is not planar: the axis of {name} is {np.degrees(angle):.3g} deg "
                f"off that of {hinge_name(source, loop, 0)}, at most {np.degrees(FLAT):.2g} deg is "
                "taken as rounding"
            )
    return off


def _check_gap(source: Source, loop: Loop, posed: Posed, normal: Array) -> None:
    """Raise unless the closure is in the plane, and others of the same links on its axis."""
    gap, _ = posed.across()
    # Of the side chain A-B-C.
    size = sum(float(np.linalg.norm(posed.hinge(k - 1, k) - posed.hinge(k, k))) for k in (1, 2))
    most = FLAT * size
    wide = abs(float(gap @ normal))
    if wide > most:
        raise ConfigError(
            f"{source.path} is not planar: what {loop.closure.name} joins is {1e3 * wide:.3g} mm "
            f"apart across the plane, at most {1e3 * most:.2g} mm is taken as rounding"
        )

    same = {loop.closure.one.body, loop.closure.other.body}
    for each in source.closures:
        if {each.one.body, each.other.body} != same:
            continue
        beside = posed.origin(each.one) - posed.origin(
            loop.closure.one if each.one.body == loop.closure.one.body else loop.closure.other
        )
        aside = float(np.linalg.norm(np.cross(normal, beside)))
        if aside > most:
            raise ConfigError(
                f"{source.path}: {each.name} joins the links of {loop.closure.name} "
                f"{1e3 * aside:.3g} mm beside it: they cannot turn"
            )


def _up(normal: Array) -> Array:
    """Return the direction in the plane that points up, (3,)."""
    z = np.array([0.0, 0.0, 1.0])
    # Flat: the plane is nearer to level than to upright.
    up = z if abs(normal @ z) < np.sqrt(0.5) else np.array([0.0, 1.0, 0.0])
    within = up - normal * (normal @ up)
    return within / np.linalg.norm(within)
