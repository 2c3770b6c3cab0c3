"""Where the parts of a robot's legs are in the world, and how far its feet slide over the floor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.metrics.columns import JOINT_COLUMNS, side_by_side
from fivebar_sim.robots.ground import Ground
from fivebar_sim.robots.hips.hip import Hip
from fivebar_sim.robots.hips.turned import angles, in_trunk, plane_normal, turning
from fivebar_sim.robots.measure import Trunk
from fivebar_sim.robots.robot import Robot


def rotation(quaternion: Array) -> Array:
    """Return the rotation matrices of quaternions (w, x, y, z), (N, 3, 3).

    Their columns are the trunk's axes in the world.
    """
    w, x, y, z = quaternion.T
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def in_world(trunk: Trunk, hip: Hip, points: Array, turns: Array) -> Array:
    """Return points (x, z) of a leg's hip frame in the world after each step [m], (N, 3).

    Arguments besides the trunk are those of `in_trunk`.
    """
    inside = in_trunk(hip, points, turns)
    turned = np.einsum("nij,nj->ni", rotation(trunk.quaternion), inside)
    return trunk.position + turned


def feet(trunk: Trunk, hip: Hip, record: Mapping[str, Array]) -> Array:
    """Return the middle of a leg's foot in the world after each step [m], (N, 3).

    Args:
        trunk: The trunk after each step.
        hip: Where the leg is.
        record: The leg's columns, without its name in front.
    """
    foot = side_by_side(record, ("foot_x", "foot_z"))
    return in_world(trunk, hip, foot, angles(hip, record))


def slid(
    robot: Robot,
    trunk: Trunk,
    hip: Hip,
    record: Mapping[str, Array],
    ground: Ground | None = None,
) -> Array:
    """Return how far a foot slid over the floor in each step, in the air too [m], (N,).

    The foot is a ball of radius r on L2, which turns by w in the world; its lowest point moves by

        v + w x (0, 0, -r)

    On uneven ground the point is at -r n, with the ground's normal n under the foot, and only what
    is across n counts.

    Args:
        robot: The robot.
        trunk: The trunk after each step.
        hip: Where the leg is.
        record: The leg's columns, without its name in front.
        ground: What lies on the floor; None: nothing.
    """
    h = float(trunk.time[0])
    axes = rotation(trunk.quaternion)
    # An angle that turns +x of the hip frame to +z is a turn about -y of the frame.
    sign = 1.0 if hip.mirrored else -1.0
    rate = sign * (record["theta_dot_A"] + record["theta_dot_B"])[:, None]
    turns = np.einsum("nij,nj->ni", axes, trunk.turning)
    if not hip.motors:
        turns = turns + rate * axes[:, :, 1]
    else:
        own = angles(hip, record)
        inside = rate * plane_normal(hip, own) + turning(hip, own, angles(hip, record, "theta_dot"))
        turns = turns + np.einsum("nij,nj->ni", axes, inside)
    r = robot.leg.foot_radius
    if ground is not None and not ground.level:
        place = feet(trunk, hip, record)
        normal = ground.normals(place[:, 0], place[:, 1])
        way = np.diff(place, axis=0, prepend=place[:1]) - h * r * np.cross(turns, normal)
        way[0] = 0.0
        across = way - np.sum(way * normal, axis=1, keepdims=True) * normal
        return np.linalg.norm(across, axis=1)

    moved = np.diff(feet(trunk, hip, record)[:, :2], axis=0, prepend=np.nan)
    moved[0] = 0.0
    rolled = h * r * np.stack([-turns[:, 1], turns[:, 0]], axis=-1)
    rolled[0] = 0.0
    return np.hypot(*(moved + rolled).T)


def depths(robot: Robot, trunk: Trunk, hip: Hip, record: Mapping[str, Array]) -> dict[str, Array]:
    """Return how deep the joints of a leg, which do not collide, are in the floor [m], each (N,).

    The lowest point of a link is on the ball that its capsule ends with, so the joints stand for
    the links. C is left out where the foot's ball contains it.
    """
    leg = robot.leg
    points = kinematics.chain_points(leg, side_by_side(record, JOINT_COLUMNS))
    A, E = (np.broadcast_to(base, points.B.shape) for base in kinematics.bases(leg))
    joints = {"A": A, "B": points.B, "D": points.D, "E": E}
    if leg.L6 > max(leg.foot_radius - leg.radius, 0.0):
        joints["C"] = points.C_left
    own = angles(hip, record)
    heights = {name: in_world(trunk, hip, place, own)[:, 2] for name, place in joints.items()}
    return {
        f"joint {name}": np.maximum(leg.radius - height, 0.0) for name, height in heights.items()
    }
