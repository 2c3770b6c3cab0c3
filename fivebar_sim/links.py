"""The inertia of single rigid links: capsules, balls, and several bodies as one."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.arrays import total

Scalar = Any
"""A float, or an array with one value for each of many links."""


class Link(NamedTuple):
    """The inertia of one rigid link, in its own frame.

    Attributes:
        mass: [kg].
        com: Centre of mass (along, across) [m] from the inner joint; along points to the outer
            joint, across is along turned by +90 deg (towards growing theta).
        inertia: About the centre of mass, about the axis normal to the leg plane [kg m^2].
    """

    mass: Scalar
    com: tuple[Scalar, Scalar]
    inertia: Scalar


def capsule(length: Scalar, radius: Scalar, density: Scalar) -> Link:
    """Return the inertia of a capsule whose caps are centred on the link's two joints.

    Cylinder m_c = rho pi r^2 L and two half balls, together m_s = rho 4/3 pi r^3:

        I = m_c (L^2 / 12 + r^2 / 4) + m_s (2 r^2 / 5 + L^2 / 4 + 3 L r / 8)
    """
    L = length
    r = radius
    m_c = density * math.pi * r**2 * L
    m_s = density * 4.0 / 3.0 * math.pi * r**3
    inertia = m_c * (L**2 / 12 + r**2 / 4) + m_s * (2 * r**2 / 5 + L**2 / 4 + 3 * L * r / 8)
    return Link(m_c + m_s, (L / 2, 0.0), inertia)


def ball(radius: Scalar, density: Scalar) -> Link:
    """Return the inertia of a ball about its centre: m = rho 4/3 pi r^3, I = 2/5 m r^2."""
    mass = density * 4.0 / 3.0 * math.pi * radius**3
    return Link(mass, (0.0, 0.0), 0.4 * mass * radius**2)


def rod(mass: Scalar, length: Scalar) -> Link:
    """Return the inertia of a slender rod between its two joints: I = m L^2 / 12."""
    return Link(mass, (0.5 * length, 0.0), mass * length**2 / 12)


def moved(body: Link, at: tuple[Scalar, Scalar], angle: Scalar = 0.0) -> Link:
    """Return a body turned by angle [rad] about its frame's origin, then shifted by `at` [m]."""
    x, y = body.com
    maths: Any = math if isinstance(angle, float) else np
    c = maths.cos(angle)
    s = maths.sin(angle)
    return Link(body.mass, (at[0] + c * x - s * y, at[1] + s * x + c * y), body.inertia)


def combined(*bodies: Link) -> Link:
    """Return several bodies in one frame as one body, by the parallel axis theorem."""
    mass = total(b.mass for b in bodies)
    # Without mass there is no centre of mass: any of the bodies is the answer.
    if np.ndim(mass) == 0 and mass == 0.0:
        return bodies[0]
    x = total(b.mass * b.com[0] for b in bodies) / mass
    y = total(b.mass * b.com[1] for b in bodies) / mass
    inertia = total(
        b.inertia + b.mass * ((b.com[0] - x) ** 2 + (b.com[1] - y) ** 2) for b in bodies
    )
    return Link(mass, (x, y), inertia)
