"""Understands a model of another program as a five-bar leg, and says what it could not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, GeometryError
from fivebar_sim.formats.incoming import flat, foot, loop, posture, remarks, source, weigh
from fivebar_sim.formats.incoming.flat import Plane, Posed
from fivebar_sim.formats.incoming.foot import Foot
from fivebar_sim.formats.incoming.loop import Loop
from fivebar_sim.formats.incoming.source import Source
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.planar import wrap
from fivebar_sim.links import Link

NOTHING = 1e-12
"""Length, in leg sizes, and angle [rad] that rounding left of a zero."""

OUTER = {0: 1, 1: 2, 3: 3, 4: 4}
"""The link that each hinge turns, towards C."""

ANGLE = {0: 0, 1: 1, 3: 3, 4: 2}
"""Place of each hinge in (theta_A, theta_B, theta_E, theta_D)."""


@dataclass(frozen=True)
class Understood:
    """A leg as it was understood.

    Attributes:
        leg: The leg.
        source: The model.
        loop: Its loop, from motor A on.
        plane: Its plane.
        foot: Its foot.
        notes: What could not be taken over, a line each.
    """

    leg: FiveBar
    source: Source
    loop: Loop
    plane: Plane
    foot: Foot
    notes: tuple[str, ...]

    def angles(self, pose: Array) -> Array:
        """Return (theta_A, theta_B, theta_E, theta_D) of a pose (nq,) of the source [rad], (4,)."""
        return posture.angles(self.source, self.loop, self.plane, pose)

    def reading(self, k: int) -> tuple[int, float]:
        """Return sign and offset [rad] of theta = sign q + offset at a hinge that is a joint.

        Args:
            k: 0 for A, 1 for B, 3 for D, 4 for E.
        """
        model = self.source.model
        posed, angles = self._first
        joint = self.loop.hinges[k]
        ground = posed.ground()

        normal = np.cross(ground @ self.plane.x, ground @ self.plane.z)
        sign = 1 if float(normal @ posed.data.xaxis[joint]) > 0.0 else -1
        # A joint of the inner link's own body turns the inner link against the outer one.
        if int(model.jnt_bodyid[joint]) not in self.loop.links[OUTER[k]]:
            sign = -sign
        theta = float(angles[ANGLE[k]])
        q = float(posed.data.qpos[model.jnt_qposadr[joint]])
        offset = float(wrap(np.array(theta - sign * q)))
        return sign, offset if abs(offset) > NOTHING else 0.0

    @cached_property
    def _first(self) -> tuple[Posed, Array]:
        """The source in its first pose, and the leg's angles there [rad], (4,)."""
        pose = self.source.poses[0]
        return Posed(self.source, self.loop, pose), self.angles(pose)

    @property
    def ground(self) -> int:
        """The body that motor A turns against."""
        model = self.source.model
        child = int(model.jnt_bodyid[self.loop.hinges[0]])
        return child if child in self.loop.links[0] else int(model.body_parentid[child])


def understand(
    path: Path,
    *,
    closures: Path | None = None,
    motors: tuple[str, str] | None = None,
    foot_name: str | None = None,
    loop_name: str | None = None,
) -> Understood:
    """Understand a file as a five-bar leg.

    Args:
        path: An MJCF or a URDF.
        closures: The YAML of a URDF's closed loops; None: the one beside it.
        motors: Names of the joints, or actuators, A and E; None: those with motors, A left of E.
        foot_name: The site, geom or body that is the foot; None: one called foot, or what is
            farthest from the knee.
        loop_name: Which of several loops.

    Raises:
        ConfigError: It is not one planar five-bar leg; says why.
    """
    read = source.read(path, closures)
    around = loop.find(read, motors, loop_name)
    plane = flat.find(read, around)
    posed = Posed(read, around, read.poses[0])
    weigh.check_lengths(read, around, posed, plane)
    at = foot.find(read, around, posed, plane, foot_name)

    # At C the foot is on either link: then the motors' places decide.
    choice = motors is None and at.is_C
    if choice and _is_right(posed, plane):
        around = loop.reversed_loop(around)
    elif at.link == 3 and not at.is_C:
        around = _with_foot_on_A(read, around, at, named=motors is not None)

    leg, doubt = _leg(read, around, plane, at)
    # Only a pose that closes tells on which side coaxial motors have their knees.
    if choice and leg.L5 == 0.0 and _is_crossed(leg):
        around = loop.reversed_loop(around)
        leg, doubt = _leg(read, around, plane, at)

    notes = [*read.notes, *remarks.remarks(read, around, plane, at)]
    return Understood(leg, read, around, plane, at, (*notes, *([doubt] if doubt else ())))


def _with_foot_on_A(read: Source, around: Loop, at: Foot, *, named: bool) -> Loop:
    """Return the loop with the foot's link as L2."""
    if named:
        raise ConfigError(
            f"{read.path}: the foot, {at.name}, is on the link of the second motor: name the "
            "motors the other way around"
        )
    return loop.reversed_loop(around)


def _is_right(posed: Posed, plane: Plane) -> bool:
    """Return whether A is right of E."""
    A = posed.flat(plane, posed.hinge(0, 0))
    E = posed.flat(plane, posed.hinge(4, 0))
    size = float(np.hypot(*(posed.flat(plane, posed.hinge(1, 1)) - A)))
    return bool(A[0] - E[0] > NOTHING * size)


def _is_crossed(leg: FiveBar) -> bool:
    """Return whether the knee of A is right of that of E at rest."""
    rest = kinematics.chain_points(leg, kinematics.home(leg))
    return bool(rest.B[0] > rest.D[0])


def _leg(read: Source, around: Loop, plane: Plane, at: Foot) -> tuple[FiveBar, str | None]:
    """Return the leg, and what to doubt of its modes."""
    posed = Posed(read, around, read.poses[0])
    # In an open pose L2 has C in another place than L3.
    place = weigh.ends(posed, plane, 2)[1] if at.is_C else at.at
    try:
        numbers: dict[str, Any] = _rest(read, around, posed, plane, at)
        numbers.update(_lengths(posed, plane, place))
        return posture.settle(read, around, plane, FiveBar(**numbers))
    except GeometryError as error:
        raise ConfigError(f"{read.path}: {error}") from None


def _lengths(posed: Posed, plane: Plane, at: Array) -> dict[str, float]:
    """Return L1 to L6, bend and tilt of a leg whose foot is at a place of the plane."""
    lengths = {}
    for k in (1, 2, 3, 4):
        inner, outer = weigh.ends(posed, plane, k)
        lengths[f"L{k}"] = float(np.hypot(*(outer - inner)))
    size = lengths["L1"] + lengths["L2"]
    AE = posed.flat(plane, posed.hinge(4, 0)) - posed.flat(plane, posed.hinge(0, 0))
    along, across = weigh.in_link(at, *weigh.ends(posed, plane, 2))
    beyond = np.array([along - lengths["L2"], across])

    for length, angle, way in (("L5", "tilt", AE), ("L6", "bend", beyond)):
        far = float(np.hypot(*way))
        turned = float(np.arctan2(way[1], way[0]))
        lengths[length] = far if far > NOTHING * size else 0.0
        lengths[angle] = turned if abs(turned) * far > NOTHING * size < far else 0.0
    return {key: _rounded(value) for key, value in lengths.items()}


def _rounded(value: float) -> float:
    """Return a number without the last of its digits, which differences of places left."""
    return float(f"{value:.14g}")


def _rest(read: Source, around: Loop, posed: Posed, plane: Plane, at: Foot) -> dict[str, Any]:
    """Return a leg's masses, inertias, gravity and what it looks like."""
    links: list[Link] = [weigh.link(read, around, posed, plane, k) for k in (1, 2, 3, 4)]
    ground = posed.ground()
    gravity = [float(read.model.opt.gravity @ (ground @ way)) for way in (plane.x, plane.z)]
    across = tuple(_rounded(each.com[1]) for each in links)
    radii = list(_radii(read, around))
    looks = {"radius": radii[0]} if radii else {}

    if at.radius is not None:
        looks["foot_radius"] = at.radius
    return {
        "name": read.path.stem,
        "mass": tuple(each.mass for each in links),
        "com": tuple(_rounded(each.com[0]) for each in links),
        "com_across": across if any(across) else None,
        "inertia": tuple(each.inertia for each in links),
        "armature": remarks.armature(read, around, 0),
        "gravity": tuple(0.0 if abs(each) < NOTHING * 10.0 else each for each in gravity),
        **looks,
    }


def _radii(read: Source, around: Loop) -> Iterator[float]:
    """Yield the radii of the capsules and cylinders that the links are drawn as [m]."""
    model = read.model
    for link in around.links[1:]:
        for geom in np.flatnonzero(np.isin(model.geom_bodyid, link)):
            if model.geom_type[geom] in foot.LONG:
                yield float(model.geom_size[geom, 0])
