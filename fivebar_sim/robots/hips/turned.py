"""How the motors of a hip turn its leg's frame in the trunk's.

From the trunk inwards each motor turns all that follows, about its axis through its own place:

    p_trunk = axis + R_1 (o_1 + R_2 (o_2 + p))   with o_k what motor k carries, from its axis
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.robots.hips.hip import Hip
from fivebar_sim.robots.hips.motors import HipMotor, column


def angles(hip: Hip, record: Mapping[str, Array], quantity: str = "theta") -> Array:
    """Return the columns of a hip's motors, from the trunk to the leg, (N, m).

    Args:
        hip: The hip.
        record: The leg's columns, without its name in front.
        quantity: "theta" or "theta_dot".
    """
    if not hip.motors:
        return np.empty((len(next(iter(record.values()))), 0))
    return np.stack([record[column(quantity, motor)] for motor in hip.motors], axis=-1)


def turn(motor: HipMotor, vectors: Array, angle: Array) -> Array:
    """Return vectors (..., 3) turned about a motor's axis by angles [rad], (...)."""
    # An axis along x, y or z: what turns are the two others, in the order of their sense.
    own = int(np.argmax(motor.axis))
    first = (own + 1) % 3
    second = (own + 2) % 3
    cos = np.cos(angle)
    sin = np.sin(angle)

    shape = np.broadcast_shapes(vectors.shape, (*np.shape(angle), 3))
    found = np.broadcast_to(vectors, shape).copy()
    found[..., first] = vectors[..., first] * cos - vectors[..., second] * sin
    found[..., second] = vectors[..., first] * sin + vectors[..., second] * cos
    return found


def in_trunk(hip: Hip, points: Array, turns: ArrayLike | None = None) -> Array:
    """Return points (x, z) of a leg's hip frame in the trunk's frame [m], (..., 2) to (..., 3).

    Args:
        hip: Where the leg is.
        points: The points [m].
        turns: Angles of the hip's motors, from the trunk to the leg [rad], (..., m); None: all 0.
    """
    sign = -1.0 if hip.mirrored else 1.0
    x = sign * points[..., 0]
    place = np.stack([x, np.zeros_like(x), points[..., 1]], axis=-1)
    if turns is None or not hip.motors:
        return np.array(hip.pos) + place

    angle = np.asarray(turns, dtype=np.float64)
    for k, motor in reversed([*enumerate(hip.motors)]):
        place = turn(motor, np.array(hip.offset(motor)) + place, angle[..., k])
    return np.array(hip.axis) + place


def plane_normal(hip: Hip, turns: Array) -> Array:
    """Return the normal of a leg's plane in the trunk's frame, (..., 3): y where nothing is turned.

    Args:
        hip: The hip.
        turns: Angles of its motors [rad], (..., m).
    """
    found = np.broadcast_to([0.0, 1.0, 0.0], (*turns.shape[:-1], 3))
    for k, motor in reversed([*enumerate(hip.motors)]):
        found = turn(motor, found, turns[..., k])
    return found


def turning(hip: Hip, turns: Array, rates: Array) -> Array:
    """Return how fast the hip's motors turn a leg's frame, in the trunk's frame [rad/s], (..., 3).

    Args:
        hip: The hip.
        turns: Angles of its motors [rad], (..., m).
        rates: Their rates [rad/s], (..., m).
    """
    found = np.zeros((*turns.shape[:-1], 3))
    for k, motor in reversed([*enumerate(hip.motors)]):
        # What is further in turns with this one; its own axis stays.
        found = turn(motor, found, turns[..., k]) + rates[..., k, None] * np.array(motor.axis)
    return found


def quaternion(hip: Hip, turns: Array) -> Array:
    """Return how a leg's hip frame is turned in the trunk's, (w, x, y, z), (..., 4).

    Args:
        hip: The hip.
        turns: Angles of its motors [rad], (..., m).
    """
    found = np.zeros((*turns.shape[:-1], 4))
    found[..., 3 if hip.mirrored else 0] = 1.0
    for k, motor in reversed([*enumerate(hip.motors)]):
        half = 0.5 * turns[..., k]
        axis = np.sin(half)[..., None] * np.array(motor.axis)

        # The product of this turn and those further in.
        real = found[..., :1]
        rest = found[..., 1:]
        cos = np.cos(half)[..., None]
        scalar = cos * real - np.sum(axis * rest, axis=-1, keepdims=True)
        vector = cos * rest + real * axis + np.cross(axis, rest)
        found = np.concatenate([scalar, vector], axis=-1)
    return found
