"""Plane vectors (..., 2) in the leg's plane: direction, quarter turn, cross product, wrapping."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array

Scalar = Any
"""A float, or an array of shape (...)."""

Coordinates = Sequence[Scalar]
"""(x, z)."""


def split(pairs: Array) -> Coordinates:
    """Return the two coordinates of pairs (..., 2), each (...); of a single pair plain numbers.

    Controllers ask for one pose at a time: of plain numbers a formula takes a tenth of the time
    that it takes of small arrays, and their bits are the same.
    """
    if pairs.size == 2:
        return pairs.ravel().tolist()
    return pairs[..., 0], pairs[..., 1]


def joined(v: Coordinates, shape: tuple[int, ...]) -> Array:
    """Return two coordinates as pairs of a shape (..., 2)."""
    pairs = np.empty(shape)
    pairs[..., 0] = v[0]
    pairs[..., 1] = v[1]
    return pairs


def between(a: Coordinates, b: Coordinates) -> tuple[Scalar, Scalar]:
    """Return the vector from a to b."""
    return b[0] - a[0], b[1] - a[1]


def rotated(v: Coordinates, angle: float) -> tuple[Scalar, Scalar]:
    """Return v turned by angle [rad], anticlockwise."""
    cos = float(np.cos(angle))
    sin = float(np.sin(angle))
    return cos * v[0] - sin * v[1], cos * v[1] + sin * v[0]


def root(square: Scalar) -> Scalar:
    """Return the root of what only rounding brings below 0, where it is 0."""
    # NumPy's functions take twenty times as long for one number as those of math.
    if isinstance(square, float):
        return math.sqrt(max(square, 0.0))
    return np.sqrt(np.maximum(square, 0.0))


def unit(angle: ArrayLike) -> Array:
    """Return (cos, sin) of angles [rad], shape (...) to (..., 2)."""
    # Filled rather than stacked: of single poses that takes a quarter of the time.
    e = np.empty((*np.shape(angle), 2))
    e[..., 0] = np.cos(angle)
    e[..., 1] = np.sin(angle)
    return e


def perp(v: Array) -> Array:
    """Return v turned by +90 deg: (x, z) to (-z, x)."""
    turned = np.empty(v.shape)
    turned[..., 0] = -v[..., 1]
    turned[..., 1] = v[..., 0]
    return turned


def end_velocity(AB: Array, BF: Array, psi_1_dot: Array, psi_2_dot: Array) -> Array:
    """Return F_dot = perp(AB) psi_1_dot + perp(BF) psi_2_dot of two links, A fixed, (..., 2).

    Args:
        AB: First link, (..., 2).
        BF: Vector from the first link's end to F, fixed to the second link, (..., 2).
        psi_1_dot: Rate of the first link's direction [rad/s], (...).
        psi_2_dot: Rate of the second link's direction [rad/s], (...).
    """
    return perp(AB) * psi_1_dot[..., None] + perp(BF) * psi_2_dot[..., None]


def cross(a: Array, b: Array) -> Array:
    """Return a_x b_z - a_z b_x, shape (...)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def dot(a: Array, b: Array) -> Array:
    """Return a_x b_x + a_z b_z, shape (...)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


def angle_between(a: Array, b: Array) -> Array:
    """Return the angle from a to b, anticlockwise, in (-pi, pi] [rad], shape (...)."""
    return direction(cross(a, b), dot(a, b))


def direction(z: Scalar, x: Scalar) -> Any:
    """Return the direction of (x, z) in (-pi, pi] [rad], 0 where both are zero of either sign."""
    # Adding 0.0 turns -0.0 into 0.0: the sign of a zero must not decide the direction.
    angle = np.arctan2(z + 0.0, x + 0.0)
    # A tiny negative z is rounded to -pi, which is outside the range.
    if isinstance(angle, float):
        return -angle if angle == -np.pi else angle
    return np.where(angle == -np.pi, np.pi, angle)


def wrap(angle: Array) -> Array:
    """Return angles brought to [-pi, pi) by whole turns [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def turned(v: Array, angle: float) -> Array:
    """Return what `rotated` does of vectors (..., 2)."""
    return joined(rotated(split(v), angle), v.shape)
