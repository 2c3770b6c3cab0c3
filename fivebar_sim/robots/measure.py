"""What a robot did: how fast, how straight, how level, and whether it fell."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np

from fivebar_sim.arrays import Array

FALLEN = np.deg2rad(60.0)
"""A trunk that leans farther than this has fallen [rad]."""


class Trunk(NamedTuple):
    """The trunk after each step.

    Attributes:
        time: [s], (N,).
        position: Of its origin, world [m], (N, 3).
        quaternion: (w, x, y, z), (N, 4).
        turning: Its rates about its own axes [rad/s], (N, 3).
    """

    time: Array
    position: Array
    quaternion: Array
    turning: Array


class Fall(NamedTuple):
    """When a robot fell, and why."""

    time: float
    why: str


class Gone(msgspec.Struct, frozen=True):
    """How a robot moved; the table `robot` of metrics.

    Attributes:
        speed: Mean speed along the trunk's own heading [m/s].
        body_lengths_per_second: The same, in lengths of the trunk.
        drift: Mean speed to the left of its heading [m/s].
        turn_rate: Mean rate about the vertical, to the left [rad/s].
        lean: Largest angle between the trunk's z axis and the floor's [rad].
        bob: Range of the height of its origin [m].
        falls: How many times it fell.
    """

    speed: float
    body_lengths_per_second: float
    drift: float
    turn_rate: float
    lean: float
    bob: float
    falls: int


def measure(trunk: Trunk, window: slice, length: float, falls: int) -> Gone:
    """Return how a robot moved over some steps.

    Speed and drift are integrals over the path, not the straight line between its ends: with the
    heading psi and the mean over the steps of the window,

        speed = mean(x' cos psi + y' sin psi),   drift = mean(y' cos psi - x' sin psi)

    Args:
        trunk: The trunk after every step.
        window: The steps.
        length: The robot's length [m].
        falls: How many times it fell in the whole run.
    """
    time = trunk.time[window]
    place = trunk.position[window]
    turned = heading(trunk.quaternion[window])
    seconds = float(time[-1] - time[0])

    # Between two rows the heading is that of the middle: exact to second order.
    middle = 0.5 * (turned[1:] + turned[:-1])
    x, y = np.diff(place[:, :2], axis=0).T
    along = float(np.sum(x * np.cos(middle) + y * np.sin(middle)))
    left = float(np.sum(y * np.cos(middle) - x * np.sin(middle)))
    return Gone(
        speed=along / seconds,
        body_lengths_per_second=along / seconds / length,
        drift=left / seconds,
        turn_rate=float(turned[-1] - turned[0]) / seconds,
        lean=float(lean(trunk.quaternion[window]).max()),
        bob=float(np.ptp(place[:, 2])),
        falls=falls,
    )


def heading(quaternion: Array) -> Array:
    """Return the direction of the trunk's x axis seen from above, continuous [rad], (N,)."""
    w, x, y, z = quaternion.T
    forward = 1.0 - 2.0 * (y * y + z * z)
    left = 2.0 * (x * y + w * z)
    return np.unwrap(np.arctan2(left, forward))


def lean(quaternion: Array) -> Array:
    """Return the angle between the trunk's z axis and the vertical [rad], (N,)."""
    w, x, y, z = quaternion.T
    across = np.hypot(2.0 * (x * z + w * y), 2.0 * (y * z - w * x))
    return np.arctan2(across, 1.0 - 2.0 * (x * x + y * y))


def falls(
    trunk: Trunk,
    size: tuple[float, float, float],
    center: Array,
    depth: Array | None = None,
) -> list[Fall]:
    """Return every fall: a trunk that leans too far, or whose box touches the floor.

    One that lies falls no further: the next fall needs the trunk up again.

    Args:
        trunk: The trunk after every step.
        size: Length, width and height of its box [m].
        center: The box's middle in the trunk's frame [m], (3,).
        depth: How deep the box is in uneven ground after each step [m], (N,); None: the floor is
            flat, and its lowest corner says so.
    """
    leaning = lean(trunk.quaternion)
    touching = lowest(trunk, size, center) <= 0.0 if depth is None else depth > 0.0
    down = touching | (leaning > FALLEN)
    begins = np.flatnonzero(down & ~np.concatenate([[False], down[:-1]]))
    return [Fall(float(trunk.time[k]), _why(float(leaning[k]), bool(touching[k]))) for k in begins]


def _why(leaning: float, touching: bool) -> str:
    if touching:
        return f"the trunk touches the floor, leaning {np.rad2deg(leaning):.0f} deg"
    return f"the trunk leans {np.rad2deg(leaning):.0f} deg, more than {np.rad2deg(FALLEN):.0f}"


def lowest(trunk: Trunk, size: tuple[float, float, float], center: Array) -> Array:
    """Return the height of the lowest corner of the trunk's box above the floor [m], (N,)."""
    w, x, y, z = trunk.quaternion.T
    # The last row of the rotation matrix: what each axis of the trunk adds to the height.
    up = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])
    middle = trunk.position[:, 2] + center @ up
    return middle - 0.5 * np.array(size) @ np.abs(up)
