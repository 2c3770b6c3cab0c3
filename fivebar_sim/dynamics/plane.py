"""Vectors of the leg plane as two coordinates, each a plain number or an array.

Separate coordinates are quick for one leg and for many: the integrator of one leg calls what is
here a hundred thousand times.
"""

from __future__ import annotations

from typing import Any

from fivebar_sim.arrays import Array

Scalar = Any
"""A float, or an array of shape (...)."""

Vector = tuple[Scalar, Scalar]
"""(x, z), or (along, across) in a link's own frame."""

Four = tuple[Scalar, Scalar, Scalar, Scalar]
"""One value for each of the links L1..L4."""


def cross(a: Vector, b: Vector) -> Scalar:
    """Return a_x b_z - a_z b_x."""
    return a[0] * b[1] - a[1] * b[0]


def dot(a: Vector, b: Vector) -> Scalar:
    """Return a_x b_x + a_z b_z."""
    return a[0] * b[0] + a[1] * b[1]


def weigh(r: Vector, gravity: Vector) -> Scalar:
    """Return r . gravity, in a third of the time where gravity points down."""
    gx, gz = gravity
    if isinstance(gx, float) and gx == 0.0:
        return r[1] * gz
    return dot(r, gravity)


def placed(e: Vector, r: Vector) -> Vector:
    """Return a vector r = (along, across) of a link in the hip frame; e is the link's direction."""
    along, across = r
    # Straight links, as most are, are placed in a third of the time.
    if isinstance(across, float) and across == 0.0:
        return along * e[0], along * e[1]
    return along * e[0] - across * e[1], along * e[1] + across * e[0]


def split(pairs: Array) -> Vector:
    """Return the two coordinates of pairs (..., 2), each (...); of a single pair plain numbers."""
    # Arithmetic on NumPy's own numbers takes three times as long.
    if pairs.ndim == 1:
        x, z = pairs.tolist()
        return x, z
    return pairs[..., 0], pairs[..., 1]
