"""The leg of a recording in 3D: solid links that move, the target path, the foot's trail.

The hip frame's (x, z) is drawn at y = 0 of a right-handed frame with z up, where an angle that
turns +x to +z is a turn about -y. A link's own frame has its origin at the inner joint and x along
the link. The two side chains are drawn one link radius in front of the leg plane and one behind
it, as they are built, so that links may pass each other; every frame stays in the plane.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics import bases, chain_points

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

TRAIL_SECONDS = 0.5
"""How long the trail of the foot stays [s]."""
HIP = "hip"
TARGET, TARGET_PATH, TRAIL = f"{HIP}/target", f"{HIP}/target_path", f"{HIP}/foot_trail"

Colour = tuple[int, int, int]
ORANGE, LIGHT_ORANGE = (224, 123, 57), (240, 173, 120)  # side A: L1, L2
BLUE, LIGHT_BLUE = (52, 120, 190), (120, 175, 225)  # side E: L4, L3
GREEN, RED, GREY, LIGHT_GREY = (60, 170, 90), (214, 69, 80), (110, 110, 116), (190, 190, 196)
COLOURS: dict[str, Colour] = {"L1": ORANGE, "L2": LIGHT_ORANGE, "L3": LIGHT_BLUE, "L4": BLUE}

ACROSS = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""The turn (x, y, z, w) that lays a cylinder along y."""


class Motion(NamedTuple):
    """Where everything is in the rows that are drawn.

    Attributes:
        q: (theta_A, theta_B, theta_E, theta_D) [rad], (n, 4).
        foot: F [m], hip frame, (n, 2).
        target: Where F should be [m], (n, 2).
    """

    q: Array
    foot: Array
    target: Array


def in_space(points: ArrayLike) -> Array:
    """Return points (x, z) of the leg plane as (x, 0, z), shape (..., 2) to (..., 3)."""
    plane = np.asarray(points, dtype=np.float64)
    space = np.zeros((*plane.shape[:-1], 3))
    space[..., [0, 2]] = plane
    return space


def turn(angle: ArrayLike) -> Array:
    """Return the quaternion (x, y, z, w) that turns +x by angle [rad] to +z, (...) to (..., 4).

    A turn about -y:  (0, -sin(angle / 2), 0, cos(angle / 2)).
    """
    half = 0.5 * np.asarray(angle, dtype=np.float64)
    zero = np.zeros_like(half)
    return np.stack([zero, -np.sin(half), zero, np.cos(half)], axis=-1)


def link_frames(leg: FiveBar, q: Array) -> dict[str, tuple[Array, Array]]:
    """Return origin [m] (n, 2) and direction [rad] (n,) of each link, by its name."""
    p = chain_points(leg, q)
    A, E = (np.broadcast_to(base, p.B.shape) for base in bases(leg))
    return {
        "L1": (A, q[:, 0]),
        "L2": (p.B, q[:, 0] + q[:, 1]),
        "L3": (p.D, q[:, 2] + q[:, 3]),
        "L4": (E, q[:, 2]),
    }


def log_leg(stream: rr.RecordingStream, leg: FiveBar) -> None:
    """Log what does not change: the links, each in its own frame, the base and the motors."""
    import rerun as rr

    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    r = leg.radius
    for name, side in (("L1", -1), ("L2", -1), ("L3", 1), ("L4", 1)):
        bars = [(0.0, getattr(leg, name), 0.0)]
        if name == "L2" and leg.L6 > 0.0:
            bars.append((leg.L2, leg.L6, leg.bend))
        stream.log(f"{HIP}/{name}", _bars(bars, side * r, r, COLOURS[name]), static=True)

    for joint, link, length, y, width in (
        ("B", "L1", leg.L1, -r, 2.8 * r),
        ("C", "L2", leg.L2, 0.0, 4.8 * r),
        ("D", "L4", leg.L4, r, 2.8 * r),
    ):
        pin = _axle((length, y, 0.0), width, 0.6 * r, joint)
        stream.log(f"{HIP}/{link}/{joint}", pin, static=True)

    foot = rr.Ellipsoids3D(
        radii=[leg.foot_radius],
        centers=in_space([leg.foot_offset]),
        colors=[RED],
        fill_mode="solid",
    )
    stream.log(f"{HIP}/L2/foot", foot, static=True)
    _log_base(stream, leg)


def _log_base(stream: rr.RecordingStream, leg: FiveBar) -> None:
    """Log the bar A-E and the two motors, each on the outer side of its link."""
    import rerun as rr

    r = leg.radius
    for joint, base, y in zip("AE", bases(leg), (-3.5 * r, 3.5 * r), strict=True):
        motor = _axle((base[0], y, base[1]), 3.0 * r, 2.0 * r, joint)
        stream.log(f"{HIP}/{joint}", motor, static=True)
    if leg.L5 > 0.0:
        bar = rr.Capsules3D(
            lengths=[leg.L5],
            radii=[0.8 * r],
            translations=in_space(bases(leg)[:1]),
            quaternions=[turn(leg.tilt - 0.5 * math.pi)],
            colors=[GREY],
            fill_mode="solid",
        )
        stream.log(f"{HIP}/L5", bar, static=True)


def _bars(
    bars: list[tuple[float, float, float]], y: float, radius: float, colour: Colour
) -> rr.Capsules3D:
    """Return capsules of a link's frame, each (start along x [m], length [m], direction [rad])."""
    import rerun as rr

    start, length, angle = np.array(bars).T
    return rr.Capsules3D(
        lengths=length,
        radii=[radius],
        translations=np.stack([start, np.full_like(start, y), np.zeros_like(start)], axis=-1),
        quaternions=turn(angle - 0.5 * math.pi),  # Rerun's capsules lie along z
        colors=[colour],
        fill_mode="solid",
    )


def _axle(
    centre: tuple[float, float, float], width: float, radius: float, label: str
) -> rr.Cylinders3D:
    """Return a labelled cylinder along y, about its centre."""
    import rerun as rr

    return rr.Cylinders3D(
        lengths=[width],
        radii=[radius],
        centers=[centre],
        quaternions=[ACROSS],
        colors=[LIGHT_GREY],
        labels=[label],
        fill_mode="solid",
    )


def log_path(stream: rr.RecordingStream, target: Array) -> None:
    """Log the whole target path (n, 2) [m] as one line, and how target and trail look."""
    import rerun as rr

    path = rr.LineStrips3D([in_space(target)], radii=rr.Radius.ui_points(2.5), colors=[GREEN])
    stream.log(TARGET_PATH, path, static=True)
    for entity, colour, points in ((TARGET, GREEN, 2.0), (TRAIL, RED, 1.0)):
        look = rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(points), colors=[colour])
        stream.log(entity, look, static=True)


def send_motion(
    stream: rr.RecordingStream, leg: FiveBar, motion: Motion, times: list[rr.TimeColumn]
) -> None:
    """Send the poses of the links, the target and the trail, as columns.

    The target is a needle across the leg plane, to be seen on both sides of the foot; a row of
    the trail is the line from the row before.
    """
    import rerun as rr

    for name, (origin, angle) in link_frames(leg, motion.q).items():
        poses = rr.Transform3D.columns(translation=in_space(origin), quaternion=turn(angle))
        stream.send_columns(f"{HIP}/{name}", times, poses)

    tip = np.array([0.0, 2.5 * leg.foot_radius, 0.0])
    target = in_space(motion.target)
    needle = np.stack([target - tip, target + tip], axis=1)
    foot = in_space(motion.foot)
    steps = np.stack([np.concatenate([foot[:1], foot[:-1]]), foot], axis=1)
    for entity, strips in ((TARGET, needle), (TRAIL, steps)):
        columns = rr.LineStrips3D.columns(strips=strips.astype(np.float32))
        stream.send_columns(entity, times, columns)


def view(leg: FiveBar, motion: Motion) -> rrb.Spatial3DView:
    """Return the 3D view: from the front, slightly above, all of the motion in sight."""
    import rerun.blueprint as rrb

    p = chain_points(leg, motion.q)
    everything = np.concatenate([*bases(leg), *(point.reshape(-1) for point in p)]).reshape(-1, 2)
    low, high = everything.min(axis=0), everything.max(axis=0)
    centre = in_space(0.5 * (low + high))
    distance = 1.4 * float(np.max(high - low)) + 2.0 * leg.foot_radius
    trail = rrb.VisibleTimeRanges(
        timeline="sim_time",
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL_SECONDS),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial3DView(
        origin="/",
        name="Leg",
        eye_controls=rrb.EyeControls3D(
            position=centre + distance * np.array([0.25, -1.0, 0.25]), look_target=centre
        ),
        line_grid=False,
        overrides={TRAIL: trail},
    )
