"""The picture of a run: the leg, its target path, the foot's trail, the force of the ground.

The hip frame's (x, z) is (x, 0, z) from the hip in the world; the camera looks along +y. Lines and
marks are drawn in front of the links (see `Pen`).
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.render.palette import COLOURS, unit_rgb
from fivebar_sim.render.pen import Colour, Pen
from fivebar_sim.render.replay import Replay, Walked

FIELD = 20.0
DOWN = 9.0
"""The camera's vertical field of view, and how far it looks down [degrees]."""
MARGIN = 1.08
"""Size of the picture relative to that of the motion."""
TRAIL_SECONDS = 0.5
"""Duration of the foot's trail [s]; always less than a period, or it would hide the path."""
PATH_PARTS = 160
TRAIL_PARTS = 60
SLATS = 8
"""Number of marks on a belt to either side of the leg."""
GEOMS = 2000
"""Most geoms of a scene."""

TARGET = unit_rgb(COLOURS["target"].light)
FOOT = unit_rgb(COLOURS["foot"].light)
PALE = (0.93, 0.78, 0.80)
FORCE = unit_rgb(COLOURS["force"].light)
SLAT = (0.50, 0.53, 0.57)
PIN = (0.90, 0.91, 0.93)


class Camera(NamedTuple):
    """Position and field of view of the camera.

    Attributes:
        centre: Point that it looks at [m], (3,).
        distance: Distance from that point [m].
        field: Vertical field of view [degrees].
    """

    centre: Array
    distance: float
    field: float

    @property
    def forward(self) -> Array:
        """Unit vector along the line of sight, (3,)."""
        return np.array([0.0, np.cos(np.radians(DOWN)), -np.sin(np.radians(DOWN))])

    @property
    def eye(self) -> Array:
        """Position of the camera [m], (3,)."""
        return self.centre - self.distance * self.forward

    def scale(self, height: float) -> float:
        """Return how many pixels a metre in the leg plane has at the centre of a picture.

        Args:
            height: Height of the picture [pixels].
        """
        return float(0.5 * height / np.tan(np.radians(0.5 * self.field)) / self.distance)

    def pixel(self, point: Array, width: int, height: int) -> tuple[float, float]:
        """Return where a point of the leg plane is in a picture: x from the left, y from the top.

        Args:
            point: The point (x, z) [m], (2,).
            width: Width of the picture [pixels].
            height: Height of the picture [pixels].
        """
        ray = np.array([point[0], 0.0, point[1]]) - self.eye
        right = np.array([1.0, 0.0, 0.0])
        up = np.cross(right, self.forward)
        scale = self.scale(height) * self.distance / (ray @ self.forward)
        return float(0.5 * width + scale * (ray @ right)), float(0.5 * height - scale * (ray @ up))

    def aim(self, camera: mujoco.MjvCamera) -> None:
        """Set position and direction of MuJoCo's free camera; the model has the field of view."""
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.lookat[:] = self.centre
        camera.distance = self.distance
        camera.azimuth = 90.0
        camera.elevation = -DOWN


def fit(replay: Replay, aspect: float) -> Camera:
    """Return the camera that sees the whole motion.

    A point p (about the centre) is in the picture if |p . right| <= (d + p . forward) tan(h / 2),
    with h the horizontal field, and likewise vertically. d is the least distance at which all are.

    Args:
        replay: The run.
        aspect: Width over height of the picture.
    """
    leg = replay.scenario.leg
    seen = replay.points_to_fit()
    points = np.stack([seen[:, 0], np.zeros(len(seen)), seen[:, 1]], axis=-1)
    probe = Camera(np.zeros(3), 1.0, FIELD)
    right = np.array([1.0, 0.0, 0.0])
    up = np.cross(right, probe.forward)
    # The points are axes and centres; links and foot reach beyond them.
    pad = leg.foot_radius + 2.0 * leg.radius
    middle = [0.5 * float((points @ n).min() + (points @ n).max()) for n in (right, up)]
    centre = middle[0] * right + middle[1] * up
    depth = points @ probe.forward
    # A smaller tangent than the camera's leaves the margin.
    tangent = np.tan(np.radians(0.5 * FIELD)) / MARGIN
    needed = [
        (np.abs((points - centre) @ n) + pad) / t - depth
        for n, t in ((right, tangent * aspect), (up, tangent))
    ]

    return Camera(centre, float(np.max(needed)), FIELD)


def dress(replay: Replay, camera: Camera, pixels: int = 1024) -> None:
    """Adapt the model to the picture: field of view, clipping planes, floor, shadows.

    Args:
        replay: The run; its model is changed.
        camera: The camera.
        pixels: Length of the picture's longer side.
    """
    model = replay.model
    size = camera.distance * np.tan(np.radians(camera.field))
    model.vis.global_.fovy = camera.field
    model.stat.center[:] = camera.centre
    # MuJoCo measures the clipping planes below in units of the extent.
    model.stat.extent = size
    model.vis.map.znear = 0.1
    model.vis.map.zfar = 60.0
    model.vis.quality.shadowsize = 2 * pixels
    floor = model.geom("floor")
    # A plane of size 0 has no end.
    floor.size[:2] = 0.0
    material = model.mat(int(floor.matid[0]))
    # Repeats count per metre, not per geom: the floor has no size to divide.
    material.texuniform[:] = 1
    material.texrepeat[:] = 0.5 / _square(replay)
    material.reflectance[:] = 0.0

    # The shadow of a leg in the air would fall below the picture's lower edge.
    if not replay.ground.any():
        model.light_castshadow[:] = 0


def _square(replay: Replay) -> float:
    """Return the side of the floor's squares [m]: 1, 2 or 5 times 10^n, at most a quarter leg."""
    wanted = 0.25 * replay.scenario.leg.size
    decade = 10.0 ** np.floor(np.log10(wanted))
    return float(decade * max(n for n in (1.0, 2.0, 5.0) if n * decade <= wanted))


def decorate(scene: mujoco.MjvScene, replay: Replay, row: int, eye: Array) -> None:
    """Add the target path, the trail, target, ground force and belt of a row to a scene.

    Args:
        scene: The scene, with room for more geoms.
        replay: The run.
        row: Row of the record.
        eye: Position of the camera [m], (3,).
    """
    leg = replay.scenario.leg
    if replay.walked is not None:
        _forces(Pen(scene, eye, 0.0), replay, replay.walked, row)
        return
    hip = np.array([0.0, replay.hip[row]])
    pen = Pen(scene, eye, 1.6 * leg.foot_radius + leg.radius)
    _pins(pen, replay, row, hip)
    # Bars of one depth overlap by width: the trail is thinner than the path at its end and thicker
    # at the foot, so that both are seen.
    path = pen.before(_path(replay) + hip)

    for start, end in pairwise(path):
        pen.bar(start, end, 0.15 * leg.foot_radius, TARGET)

    trail = pen.before(_trail(replay, row) + hip)
    for k, (start, end) in enumerate(pairwise(trail)):
        part = (k + 1) / TRAIL_PARTS
        width = (0.08 + 0.24 * part) * leg.foot_radius
        pen.bar(start, end, width, _mix(PALE, FOOT, part))

    pen.ball(pen.before(replay.target[row] + hip), 0.5 * leg.foot_radius, TARGET)
    _force(pen, replay, row, hip)
    if replay.belt is not None:
        _belt(pen, replay, row)


def _path(replay: Replay) -> Array:
    """Return the targets of one period, or of the whole run [m], (n, 2)."""
    start, length = replay.cycle
    times = start + length * np.linspace(0.0, 1.0, PATH_PARTS + 1)
    return replay.target[[replay.row(time) for time in times]]


def trail_seconds(replay: Replay) -> float:
    """Return the duration of the foot's trail in a run [s]."""
    return min(TRAIL_SECONDS, 0.8 * (replay.scenario.path.period or np.inf))


def _trail(replay: Replay, row: int) -> Array:
    """Return the foot's positions before a row, oldest first [m], (n, 2)."""
    back = (
        trail_seconds(replay)
        / replay.scenario.sim.timestep
        * np.linspace(1.0, 0.0, TRAIL_PARTS + 1)
    )
    return replay.foot[np.maximum(row - np.round(back).astype(int), 0)]


def _pins(pen: Pen, replay: Replay, row: int, hip: Array) -> None:
    """Draw the pins of the joints A, E, B and D."""
    leg = replay.scenario.leg
    points = kinematics.chain_points(leg, replay.qpos[row, -4:])
    for joint in (*kinematics.bases(leg), points.B, points.D):
        pen.pin(pen.before(joint + hip), 0.5 * leg.radius, PIN)


def _force(pen: Pen, replay: Replay, row: int, hip: Array) -> None:
    """Draw the ground's force on the foot; the run's largest is as long as the leg."""
    leg = replay.scenario.leg
    force = replay.ground[row]
    largest = float(np.hypot(*replay.ground.T).max())
    if np.hypot(*force) > 0.01 * largest:
        start = replay.foot[row] + hip - (0.0, leg.foot_radius)
        tip = start + leg.size * force / largest
        pen.arrow(pen.before(start, 2.0), pen.before(tip, 2.0), 0.45 * leg.foot_radius, FORCE)


def _forces(pen: Pen, replay: Replay, walked: Walked, row: int) -> None:
    """Draw the floor's force on each foot; the run's largest is as long as a leg."""
    leg = replay.scenario.leg
    largest = float(np.linalg.norm(walked.forces, axis=-1).max())
    for place, force in zip(walked.feet[:, row], walked.forces[:, row], strict=True):
        if np.linalg.norm(force) > 0.01 * largest:
            start = place - (0.0, 0.0, leg.foot_radius)
            pen.arrow(start, start + leg.size * force / largest, 0.45 * leg.foot_radius, FORCE)


def _belt(pen: Pen, replay: Replay, row: int) -> None:
    """Draw marks that move with the belt, a whole number of them per period."""
    assert replay.belt is not None
    size = replay.scenario.leg.size
    period = replay.scenario.path.period
    speed = abs(float(replay.belt[-1])) / replay.duration
    gap = 0.3 * size
    # Then the marks of a film that repeats do not jump.
    if period is not None and speed > 0.0:
        gap = speed * period / max(1, round(speed * period / gap))
    shift = float(np.mod(replay.belt[row], gap))
    for k in range(-SLATS, SLATS + 1):
        x = shift + k * gap
        pen.bar((x, -0.8 * size, 0.0), (x, 0.8 * size, 0.0), 0.004 * size, SLAT)


def _mix(first: Colour, second: Colour, part: float) -> Colour:
    """Return the colour that lies a part of the way from the first to the second."""
    r, g, b = ((1.0 - part) * a + part * z for a, z in zip(first, second, strict=True))
    return r, g, b
