"""Where the foot of a model is: the site, geom or body of a name, or what is farthest out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.formats.incoming.flat import Plane, Posed
from fivebar_sim.formats.incoming.loop import Loop
from fivebar_sim.formats.incoming.source import Source, names
from fivebar_sim.formats.incoming.weigh import ends

LOWER = (2, 3)
"""The links that may carry the foot."""

AT_C = 1e-9
"""Distance from C, in lengths of its link, of a foot that is at C."""

LONG = (int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_CYLINDER))
"""Kinds of geoms with two ends."""


class Foot(NamedTuple):
    """A place that may be the foot.

    Attributes:
        name: What is there, for messages.
        link: The link that carries it, 2 or 3.
        at: Its place in the plane [m], (2,).
        radius: Radius of the ball there [m]; None where there is none.
        is_C: Whether it is at C, where it belongs to either link.
    """

    name: str
    link: int
    at: Array
    radius: float | None
    is_C: bool = False


def find(source: Source, loop: Loop, posed: Posed, plane: Plane, name: str | None) -> Foot:
    """Return the foot of a leg.

    Args:
        source: The model.
        loop: Its loop.
        posed: The model in any pose.
        plane: The leg's plane.
        name: Of a site, geom or body; None: one with "foot" in its name, or what is farthest from
            the knee.

    Raises:
        ConfigError: Nothing on L2 or L3 has the name.
    """
    places = list(_places(source, loop, posed, plane))
    if name is not None:
        chosen = [each for each in places if each.name.split(" ", 1)[1] == name]
        if not chosen:
            known = {each.name.split(" ", 1)[1] for each in places} - {"", "C"}
            raise ConfigError(f"{source.path}: {unknown('foot on L2 or L3', name, known)}")
    else:
        chosen = [each for each in places if "foot" in each.name.lower()] or places

    def beyond(foot: Foot) -> float:
        inner, outer = ends(posed, plane, foot.link)
        reach = float(np.hypot(*(foot.at - inner)) / np.hypot(*(outer - inner)))
        # Rounded: of equally far places the first is the foot.
        return round(reach, 9)

    found = max(chosen, key=beyond)
    # In an open pose the two links have C in two places.
    central = _at_C(posed, plane, found)
    balls = [
        each.radius
        for each in places
        if each.radius and (_at_C(posed, plane, each) if central else _near(each.at, found.at))
    ]
    return found._replace(radius=balls[0] if balls else None, is_C=central)


def _at_C(posed: Posed, plane: Plane, foot: Foot) -> bool:
    """Return whether a place is at C."""
    inner, outer = ends(posed, plane, foot.link)
    return float(np.hypot(*(foot.at - outer))) <= AT_C * float(np.hypot(*(outer - inner)))


def _near(one: Array, other: Array) -> bool:
    return float(np.hypot(*(one - other))) < 1e-9


def _places(source: Source, loop: Loop, posed: Posed, plane: Plane) -> Iterator[Foot]:
    """Yield what may be the foot: C first, then sites, geoms and bodies."""
    model = source.model
    data = posed.data
    yield Foot("joint C", 2, ends(posed, plane, 2)[1], None)
    for link in LOWER:
        for kind, owner, at in (
            ("site", model.site_bodyid, data.site_xpos),
            ("geom", model.geom_bodyid, data.geom_xpos),
            ("body", np.arange(model.nbody), data.xpos),
        ):
            found = names(model, kind)

            for k in np.flatnonzero(np.isin(owner, loop.links[link])):
                body = int(owner[k])
                name = f"{kind} {found[k]}"
                radius = None
                if kind == "geom":
                    if model.geom_type[k] in LONG:
                        yield from _tips(source, posed, plane, int(k), link, name)
                        continue
                    ball = model.geom_type[k] == mujoco.mjtGeom.mjGEOM_SPHERE
                    radius = float(model.geom_size[k, 0]) if ball else None
                yield Foot(name, link, posed.flat(plane, posed.point(body, at[k])), radius)


def _tips(
    source: Source, posed: Posed, plane: Plane, geom: int, link: int, name: str
) -> Iterator[Foot]:
    """Yield the two ends of a capsule or cylinder, the far one first."""
    model = source.model
    half = model.geom_size[geom, 1] * posed.data.geom_xmat[geom].reshape(3, 3)[:, 2]
    middle = posed.data.geom_xpos[geom]
    body = int(model.geom_bodyid[geom])
    inner, _ = ends(posed, plane, link)
    tips = [posed.flat(plane, posed.point(body, middle + s * half)) for s in (-1.0, 1.0)]
    for tip in sorted(tips, key=lambda at: -float(np.hypot(*(at - inner)))):
        yield Foot(name, link, tip, None)
