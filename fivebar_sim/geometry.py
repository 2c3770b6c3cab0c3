r"""The five-bar leg as numbers: link lengths, modes, masses; and the shipped presets.

A ---- L5 ---- E      A, E driven; theta_A, theta_E anticlockwise from +x of the hip frame to +z
 \            /       B, D passive knees; C closes the loop
  L1        L4        L6: rigid extension of L2 beyond C, ending in the foot F (L6 = 0: F = C)
   B        D         the origin O of the hip frame is midway between A and E, x forward, z up
    L2    L3
      \  /
       C
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ConfigError, GeometryError, UnknownError, unknown
from fivebar_sim.files import presets, quantities
from fivebar_sim.links import Link, ball, capsule, combined, moved, rod

Mode = tuple[int, int]
Four = tuple[float, float, float, float]

MODES: tuple[Mode, ...] = ((-1, -1), (-1, 1), (1, -1), (1, 1))
"""The working modes (s_A, s_E), in the order of `kinematics.inverse_all`."""


CLOSING = 1e-12
"""Relative slack of the closing condition: the rounding of lengths given in decimals."""

LONGEST = 1e3
"""Largest length [m]."""

SHORT = 1e-3
LONG = 3.0
"""Least and greatest length of a link that is not doubted [m]."""

SCALES = ("leg", "any")
"""Whether lengths that no leg of a robot has are refused."""

HEAVIEST = 1e6
"""Largest mass [kg], inertia [kg m^2] and density [kg/m^3]."""


@dataclass(frozen=True, slots=True, repr=False)
class FiveBar:
    """A five-bar leg in m, kg and rad; the defaults are those of the classic leg.

    Without `mass`, a link is a capsule of `radius` and `density` between its joints, and L2 also
    carries the foot, a ball of `foot_radius`. With `mass`, the four numbers are the masses of the
    whole links (foot and extension included), `com` their centres of mass along the link from the
    inner joint, `com_across` how far beside the line, and `inertia` their inertias about those
    centres. By default links are slender rods, m L^2 / 12 about their middle; L2 with its extension
    is one rod bent at C, B-C-F, of the same mass per length all along.

    Attributes:
        L1: |AB| [m].
        L2: |BC| [m].
        L3: |DC| [m].
        L4: |ED| [m].
        L5: |AE| [m]; 0 is coaxial.
        L6: |CF|, extension of L2 beyond C [m].
        bend: Angle of CF from the direction of BC, anticlockwise [rad].
        tilt: Angle of AE from +x of the hip frame, anticlockwise [rad].
        mode: Working mode (s_A, s_E): theta = alpha + s beta on each side.
        assembly: +1 or -1, the sign of BDx BCz - BDz BCx.
        mass: Masses of L1..L4 [kg], or None for capsules.
        com: Centres of mass along L1..L4 [m], only with `mass`.
        com_across: Centres of mass across L1..L4 [m], along turned by +90 deg (towards growing
            theta), only with `com`; None: 0, on the lines.
        inertia: Inertias of L1..L4 about their centres [kg m^2], only with `mass`.
        radius: Radius of the capsules [m]; with `mass` only pictures and the guard `floor` need it.
        density: Density of capsules and foot [kg/m^3].
        foot_radius: Radius of the ball at F [m].
        armature: Rotor inertia of each motor, reflected to A and E [kg m^2].
        gravity: (x, z) in the hip frame [m/s^2].
        name: Name in tables and pictures.
        scale: "leg" refuses links outside `SHORT` to `LONG`, which mostly are lengths in another
            unit than metres; "any" takes any length.
    """

    L1: float = 0.040
    L2: float = 0.060
    L3: float = 0.060
    L4: float = 0.040
    L5: float = 0.030
    L6: float = 0.0
    bend: float = 0.0
    tilt: float = 0.0
    mode: Mode = (-1, 1)
    assembly: int = -1
    mass: Four | None = None
    com: Four | None = None
    inertia: Four | None = None
    com_across: Four | None = None
    radius: float = 0.004
    density: float = 1200.0
    foot_radius: float = 0.006
    armature: float = 1e-5
    gravity: tuple[float, float] = (0.0, -9.81)
    name: str = "custom"
    scale: str = "leg"

    def __post_init__(self) -> None:
        for key in ("L1", "L2", "L3", "L4", "radius", "foot_radius"):
            _check(key, getattr(self, key), low=0.0, high=LONGEST, strict=True)

        for key in ("L5", "L6"):
            _check(key, getattr(self, key), low=0.0, high=LONGEST)

        self._check_scale()
        for key in ("density", "armature"):
            _check(key, getattr(self, key), low=0.0, high=HEAVIEST, strict=key == "density")

        for key in ("bend", "tilt"):
            _check(key, getattr(self, key), low=-math.pi, high=math.pi)

        # With F on B side A is one link: no inverse kinematics can tell where L2 points.
        if not math.hypot(*self.foot_offset) > CLOSING * self.L2:
            raise GeometryError(f"L6: the foot lies on B; got L6 = L2 = {self.L6:g} m, bent back")

        self._check_modes()
        self._check_masses()
        # Frozen, so that a leg can be a key of a cache: fields are set past the dataclass.
        object.__setattr__(self, "gravity", _floats("gravity", self.gravity, 2))
        lengths = {key: getattr(self, key) for key in ("L1", "L2", "L3", "L4", "L5")}
        # A closed polygon needs its longest side no longer than the rest together.
        longest = max(lengths, key=lengths.__getitem__)
        others = sum(lengths.values()) - lengths[longest]
        if not lengths[longest] <= others * (1.0 + CLOSING):
            raise GeometryError(
                f"{longest}: the links can never close: the longest may be at most as long as "
                f"the other four together, {others:g} m, got {lengths[longest]:g} m"
            )

    def _check_scale(self) -> None:
        if self.scale not in SCALES:
            raise GeometryError(f"scale must be one of {SCALES}, got {self.scale!r}")
        if self.scale == "any":
            return
        for key in ("L1", "L2", "L3", "L4", "L5", "L6"):
            length = getattr(self, key)
            # A coaxial leg has L5 = 0 or next to it, and most legs have no L6.
            least = 0.0 if key in ("L5", "L6") else SHORT
            if least <= length <= LONG:
                continue
            meant = [m for m in (length / 1000.0, length * 1000.0) if SHORT <= m <= LONG]
            hint = f"; did you mean {meant[0]:g}?" if meant else ""
            raise GeometryError(
                f"{key} must be in [{least:g}, {LONG:g}] m, got {length:g}: lengths are in "
                f'metres{hint} (scale = "any" allows it)'
            )

    def _check_modes(self) -> None:
        mode = tuple(self.mode) if isinstance(self.mode, (tuple, list)) else ()
        # True == 1 in Python, so only the check of the type keeps it from passing as a sign.
        if mode not in MODES or not all(type(s) is int for s in mode):
            raise GeometryError(f"mode must be one of {MODES}, got {self.mode!r}")
        object.__setattr__(self, "mode", mode)
        if self.assembly not in (-1, 1) or type(self.assembly) is not int:
            raise GeometryError(f"assembly must be -1 or 1, got {self.assembly!r}")
        if not isinstance(self.name, str) or not self.name.isprintable():
            raise GeometryError(f"name must be a printable string, got {self.name!r}")

    def _check_masses(self) -> None:
        if self.mass is None:
            for key in ("com", "com_across", "inertia"):
                if getattr(self, key) is not None:
                    raise GeometryError(f"{key} needs mass beside it: four numbers [kg]")
            return

        if self.com is None and self.com_across is not None:
            raise GeometryError("com_across needs com beside it: four numbers [m]")

        for key in ("mass", "com", "com_across", "inertia"):
            if getattr(self, key) is not None:
                object.__setattr__(self, key, _floats(key, getattr(self, key), 4))
        for key in ("mass", "inertia"):
            for value in getattr(self, key) or ():
                _check(key, value, low=0.0, high=HEAVIEST, strict=True)

    @property
    def size(self) -> float:
        """Length of the longer side chain [m]; tolerances are relative to it."""
        return max(self.L1 + self.L2 + self.L6, self.L4 + self.L3)

    @property
    def links(self) -> tuple[Link, Link, Link, Link]:
        """The inertias of L1..L4; the foot and the extension belong to L2."""
        lengths = (self.L1, self.L2, self.L3, self.L4)
        if self.mass is not None:
            L1, L2, L3, L4 = (self._explicit(k, self._rod(k)) for k in range(4))
            return L1, L2, L3, L4

        L1, L2, L3, L4 = (capsule(L, self.radius, self.density) for L in lengths)
        # Foot and extension are fixed to L2, so they count as part of it.
        parts = [L2, moved(ball(self.foot_radius, self.density), self.foot_offset)]
        if self.L6 > 0.0:
            extension = capsule(self.L6, self.radius, self.density)
            parts.append(moved(extension, (self.L2, 0.0), self.bend))

        return L1, combined(*parts), L3, L4

    def _rod(self, k: int) -> Link:
        """Return link k = 0..3 as a slender rod with its own mass; L2 with its extension."""
        assert self.mass is not None
        mass = self.mass[k]
        length = (self.L1, self.L2, self.L3, self.L4)[k]
        if k != 1 or self.L6 == 0.0:
            return rod(mass, length)

        extension = rod(mass * self.L6 / (self.L2 + self.L6), self.L6)
        straight = rod(mass * self.L2 / (self.L2 + self.L6), self.L2)
        bent = combined(straight, moved(extension, (self.L2, 0.0), self.bend))
        # The two parts may miss the mass that was given by a rounding.
        return bent._replace(mass=mass)

    def _explicit(self, k: int, link: Link) -> Link:
        """Return link k = 0..3 with the centre and the inertia that were given, if any."""
        if self.com is not None:
            across = self.com_across or (0.0,) * 4
            link = link._replace(com=(self.com[k], across[k]))
        if self.inertia is not None:
            link = link._replace(inertia=self.inertia[k])
        return link

    @property
    def foot_offset(self) -> tuple[float, float]:
        """F in the frame of L2 (along, across) [m], from B."""
        return self.L2 + self.L6 * math.cos(self.bend), self.L6 * math.sin(self.bend)

    @classmethod
    def load(cls, source: str | Path) -> FiveBar:
        """Return the leg of a preset ("classic") or of a TOML file.

        Raises:
            ConfigError: Unknown preset, unreadable file, unknown key, or a value out of range.
        """
        return cls.from_table(read_table(source), str(source))

    def __repr__(self) -> str:
        """Return what differs from the classic leg; Python makes the same leg of it."""
        own = [
            f"{field.name}={getattr(self, field.name)!r}"
            for field in fields(self)
            if getattr(self, field.name) != field.default
        ]
        return f"FiveBar({', '.join(own)})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the leg over its workspace, its lengths and its mass."""
        # By name: what draws stands above this room.
        return importlib.import_module("fivebar_sim.report.notebook").leg(self)

    @classmethod
    def from_table(cls, table: Mapping[str, Any], where: str) -> FiveBar:
        """Return the leg of a TOML table; `where` names the table in messages.

        Numbers may be texts with a unit: "40 mm".

        Raises:
            ConfigError: An unknown key, or a value out of range.
        """
        known = [field.name for field in fields(cls)]
        for key in table:
            if key not in known:
                raise UnknownError(f"{where}: {unknown('key', key, known)}")

        try:
            values: dict[str, Any] = {
                # TOML has only lists; a frozen leg must be hashable.
                key: tuple(value) if isinstance(value, list) else value
                for key, value in quantities.in_si(table, cls, "", where).items()
            }
            return cls(**values)
        except GeometryError as error:
            raise ConfigError(f"{where}: {error}") from None


def read_table(source: str | Path) -> dict[str, Any]:
    """Return the TOML table of a preset or of a file.

    Raises:
        ConfigError: Unknown preset, or a file that is missing or not TOML.
    """
    return {"name": presets.find(source, "leg").stem, **presets.read(source, "leg")}


def _check(key: str, value: Any, **bounds: Any) -> None:
    """Raise unless a key's value is a finite number within its bounds."""
    check_number(key, value, UNITS.get(key, ""), **bounds, error=GeometryError)


def _floats(key: str, values: object, count: int) -> tuple[float, ...]:
    """Return values as a tuple of `count` finite floats."""
    if not isinstance(values, (tuple, list)) or len(values) != count:
        raise GeometryError(f"{key} must be {count} numbers [{UNITS[key]}], got {values!r}")
    for value in values:
        _check(key, value)
    return tuple(float(value) for value in values)


UNITS = {
    **dict.fromkeys(("L1", "L2", "L3", "L4", "L5", "L6", "radius", "foot_radius"), "m"),
    **dict.fromkeys(("com", "com_across"), "m"),
    **dict.fromkeys(("bend", "tilt"), "rad"),
    **dict.fromkeys(("inertia", "armature"), "kg m^2"),
    "mass": "kg",
    "density": "kg/m^3",
    "gravity": "m/s^2",
}
