"""What each link weighs: all bodies of a link as one, in the leg's plane."""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.formats.incoming.flat import Plane, Posed
from fivebar_sim.formats.incoming.loop import Loop, hinge_name
from fivebar_sim.formats.incoming.source import Source
from fivebar_sim.links import Link, combined

JOINTS = {1: (0, 1), 2: (1, 2), 3: (3, 2), 4: (4, 3)}
"""Inner and outer hinge of each link: A-B, B-C, D-C, E-D."""

NOTHING = 1e-14
"""Part of a link's length that is rounding."""


def ends(posed: Posed, plane: Plane, link: int) -> tuple[Array, Array]:
    """Return a link's inner and outer joint in the plane, as the link has them [m], (2,) each.

    Args:
        posed: The model in any pose.
        plane: The leg's plane.
        link: 1 to 4.
    """
    inner, outer = JOINTS[link]
    return (
        posed.flat(plane, posed.hinge(inner, link)),
        posed.flat(plane, posed.hinge(outer, link)),
    )


def check_lengths(source: Source, loop: Loop, posed: Posed, plane: Plane) -> None:
    """Raise unless every link has two joints apart.

    Raises:
        ConfigError: The joints of a link are at one place.
    """
    for k, (one, other) in JOINTS.items():
        inner, outer = ends(posed, plane, k)
        length = float(np.hypot(*(outer - inner)))
        if not length > 0.0:
            between = " and ".join(hinge_name(source, loop, hinge) for hinge in (one, other))
            raise ConfigError(
                f"{source.path}: the link between {between} must be longer than 0 m, got "
                f"{length:g} m"
            )


def in_link(at: Array, inner: Array, outer: Array) -> tuple[float, float]:
    """Return a point of the plane along and across a link [m]."""
    along = (outer - inner) / np.hypot(*(outer - inner))
    arm = at - inner
    return float(along @ arm), float(along[0] * arm[1] - along[1] * arm[0])


def link(source: Source, loop: Loop, posed: Posed, plane: Plane, k: int) -> Link:
    """Return link k = 1..4: its mass, centre of mass and inertia.

    Raises:
        ConfigError: It has no mass, or no inertia.
    """
    model = source.model
    ground = posed.ground()
    normal = np.cross(ground @ plane.x, ground @ plane.z)
    inner, outer = ends(posed, plane, k)
    parts = []
    for body in loop.links[k]:
        mass = float(model.body_mass[body])
        if mass == 0.0:
            continue
        at = posed.flat(plane, posed.point(body, posed.data.xipos[body]))
        axes = posed.turn(body) @ posed.data.ximat[body].reshape(3, 3)
        about = axes.T @ normal
        inertia = float(about @ (model.body_inertia[body] * about))
        parts.append(Link(mass, _clean(in_link(at, inner, outer), outer - inner), inertia))

    found = combined(*parts) if parts else Link(0.0, (0.0, 0.0), 0.0)
    if not (found.mass > 0.0 and found.inertia > 0.0):
        names = ", ".join(repr(model.body(body).name) for body in loop.links[k])
        raise ConfigError(
            f"{source.path}: L{k} must have a mass and an inertia, got {found.mass:g} kg and "
            f"{found.inertia:g} kg m^2 of {names}"
        )
    # One body's own numbers stay as they are, to the last bit.
    return parts[0] if len(parts) == 1 else found


def _clean(com: tuple[float, float], length: Array) -> tuple[float, float]:
    """Return a place without what rounding left of zeros."""
    least = NOTHING * float(np.hypot(*length))
    along, across = (0.0 if abs(each) <= least else each for each in com)
    return along, across
