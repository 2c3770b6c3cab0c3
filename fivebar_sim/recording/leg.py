"""The leg of a recording in 3D: solid links that move.

The hip frame's (x, z) is drawn at y = 0 of a right-handed frame with z up, where an angle that
turns +x to +z is a turn about -y. A link's own frame has its origin at the inner joint and x along
the link. The two side chains are drawn one link radius in front of the leg plane and one behind
it, as they are built, so that links may pass each other; every frame stays in the plane.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics import bases, chain_points
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.recording.look import GREY, PIN, Colour, Look, shade
from fivebar_sim.recording.poses import DrawnMotion, in_height

if TYPE_CHECKING:
    import rerun as rr

HIP = "hip"
COLOURS: dict[str, Colour] = {
    "L1": shade("A"),
    "L2": shade("B"),
    "L3": shade("D"),
    "L4": shade("E"),
}

ACROSS = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""The turn (x, y, z, w) that lays a cylinder along y."""


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


def log_leg(stream: rr.RecordingStream, leg: FiveBar, look: Look) -> None:
    """Log the parts that do not change: each link in its own frame, the base and the motors."""
    import rerun as rr

    hip = f"{look.root}{HIP}"
    r = leg.radius
    # Shapes are static: a row of the recording moves their frames alone.
    for name, side in (("L1", -1), ("L2", -1), ("L3", 1), ("L4", 1)):
        bars = [(0.0, getattr(leg, name), 0.0)]
        if name == "L2" and leg.L6 > 0.0:
            bars.append((leg.L2, leg.L6, leg.bend))
        stream.log(
            f"{hip}/{name}", _bars(bars, side * r, r, look.colour(COLOURS[name])), static=True
        )

    # Each pin sticks out of the links that it joins; C goes through both chains.
    for joint, link, length, y, width in (
        ("B", "L1", leg.L1, -r, 2.8 * r),
        ("C", "L2", leg.L2, 0.0, 4.8 * r),
        ("D", "L4", leg.L4, r, 2.8 * r),
    ):
        pin = _axle((length, y, 0.0), width, 0.6 * r, joint, PIN, look)
        stream.log(f"{hip}/{link}/{joint}", pin, static=True)

    foot = rr.Ellipsoids3D(
        radii=[leg.foot_radius],
        centers=in_space([leg.foot_offset]),
        colors=[look.colour(shade("foot"))],
        labels=[look.label] if look.label else None,
        fill_mode="solid",
    )
    stream.log(f"{hip}/L2/foot", foot, static=True)
    _log_base(stream, leg, look)


def _log_base(stream: rr.RecordingStream, leg: FiveBar, look: Look) -> None:
    """Log the bar A-E and the two motors, each on the outer side of its link."""
    import rerun as rr

    r = leg.radius
    for joint, base, side in zip(MOTORS, bases(leg), (-1.0, 1.0), strict=True):
        centre = (base[0], 3.5 * side * r, base[1])
        motor = _axle(centre, 3.0 * r, 2.0 * r, None, shade(joint), look)
        stream.log(f"{look.root}{HIP}/{joint}", motor, static=True)
        # Apart from the motors, since those of a coaxial leg are at one place.
        if not look.label:
            letter = rr.Points3D(
                in_space([base + np.array([5.0 * side * r, 5.0 * r])]),
                radii=[0.1 * r],
                colors=[PIN],
                labels=[joint],
                show_labels=True,
            )
            stream.log(f"{HIP}/letter_{joint}", letter, static=True)

    if leg.L5 > 0.0:
        bar = rr.Capsules3D(
            lengths=[leg.L5],
            radii=[0.8 * r],
            translations=in_space(bases(leg)[:1]),
            quaternions=[turn(leg.tilt - 0.5 * math.pi)],
            colors=[look.colour(GREY)],
            fill_mode="solid",
        )
        stream.log(f"{look.root}{HIP}/L5", bar, static=True)


def _bars(
    bars: list[tuple[float, float, float]], y: float, radius: float, colour: Colour
) -> rr.Capsules3D:
    """Return capsules in a link's frame, each (start along x [m], length [m], direction [rad])."""
    import rerun as rr

    start, length, angle = np.array(bars).T
    # Rerun's capsules lie along z, a link along x: hence the quarter turn back.
    return rr.Capsules3D(
        lengths=length,
        radii=[radius],
        translations=np.stack([start, np.full_like(start, y), np.zeros_like(start)], axis=-1),
        quaternions=turn(angle - 0.5 * math.pi),
        colors=[colour],
        fill_mode="solid",
    )


def _axle(
    centre: tuple[float, float, float],
    width: float,
    radius: float,
    joint: str | None,
    colour: Colour,
    look: Look,
) -> rr.Cylinders3D:
    """Return a cylinder along y, about its centre."""
    import rerun as rr

    # Beside other legs a leg has one label, its run's at the foot.
    return rr.Cylinders3D(
        lengths=[width],
        radii=[radius],
        centers=[centre],
        quaternions=[ACROSS],
        colors=[look.colour(colour)],
        labels=None if look.label or joint is None else [joint],
        fill_mode="solid",
    )


def send_leg(
    stream: rr.RecordingStream,
    leg: FiveBar,
    moved: DrawnMotion,
    look: Look,
    times: list[rr.TimeColumn],
) -> None:
    """Send the poses of the links as columns, and that of the hip where it moves."""
    import rerun as rr

    for name, (origin, angle) in link_frames(leg, moved.q).items():
        poses = rr.Transform3D.columns(translation=in_space(origin), quaternion=turn(angle))
        stream.send_columns(f"{look.root}{HIP}/{name}", times, poses)
    if moved.hip is not None:
        heights = rr.Transform3D.columns(translation=in_space(in_height(moved.hip)))
        stream.send_columns(f"{look.root}{HIP}", times, heights)
