"""The area that a foot reaches in its own working mode, of many legs at once.

The foot at the distance r from A makes the triangle A, B, F rigid, and so with it C: turned about
A, both sweep circles, and side E reaches C on arcs of its circle. With c = |AC| and the distances
E's chain spans, low to high, the half angles of these arcs about the line AE are

    a(x) = arccos((c^2 + L5^2 - x^2) / 2 c L5),   arcs from a(low) to a(high), on both sides

so that the area is the integral of 2 r (a(high) - a(low)) dr. It is taken by Gauss-Chebyshev nodes
of r, r = middle - half cos t, at which the square roots of the ends of a and r do no harm.
"""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.legs import Legs

NODES = 512
"""Nodes of the integral: it is good to 1e-4."""


def area(legs: Legs) -> Array:
    """Return the areas that feet reach, in the working mode of side A [m^2], (n,)."""
    along, across = legs.foot_offset
    rho = np.hypot(along, across)
    least = np.abs(legs.L1 - rho)
    half = 0.5 * (legs.L1 + rho - least)
    t = np.pi * (np.arange(NODES) + 0.5) / NODES
    r = least + half * (1.0 - np.cos(t))
    width = half * np.sin(t) * (np.pi / NODES)

    # The angle at B, from AB on to BF; C lies beside the line BF where the extension is bent.
    cosine = np.clip((r**2 - legs.L1**2 - rho**2) / (2.0 * legs.L1 * rho), -1.0, 1.0)
    turn = -legs.mode[0] * np.arccos(cosine) - np.arctan2(across, along)
    c2 = legs.L1**2 + legs.L2**2 + 2.0 * legs.L1 * legs.L2 * np.cos(turn)
    c = np.sqrt(np.maximum(c2, 0.0))
    near = _half_angle(c, legs.L5, np.abs(legs.L4 - legs.L3))
    far = _half_angle(c, legs.L5, legs.L4 + legs.L3)
    return (2.0 * r * (far - near) * width).sum(axis=1)


def _half_angle(c: Array, base: Array, x: Array) -> Array:
    """Return the angle up to which a circle of radius c about A is within x of E, in [0, pi]."""
    double = 2.0 * c * base
    # Coaxial motors, or C on A: all of the circle is within x, or none of it is.
    flat = np.where(c <= x, np.pi, 0.0)
    cosine = (c**2 + base**2 - x**2) / np.where(double > 0.0, double, 1.0)
    return np.where(double > 0.0, np.arccos(np.clip(cosine, -1.0, 1.0)), flat)
