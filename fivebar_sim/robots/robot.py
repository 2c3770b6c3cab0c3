"""A quadruped of four equal five-bar legs, in numbers.

FL -- FR
|  ^x  |     x forward, y left, z up, from wherever the file measures; each leg moves in a plane
RL -- RR     parallel to x-z.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from itertools import combinations
from pathlib import Path
from typing import Any

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.files import presets, tables
from fivebar_sim.files.tables import Table
from fivebar_sim.geometry import HEAVIEST, LONGEST, FiveBar
from fivebar_sim.robots.hips.hip import Hip
from fivebar_sim.robots.hips.motors import MOTORS, HipMotor, Vector
from fivebar_sim.scenario import reading

LEGS = ("FL", "FR", "RL", "RR")
"""The legs, in the order of a robot's joints and motors: front left, front right, rear left, rear
right."""

SERVO_ONLY = ("servo", "limit", "speed", "friction", "rate", "delay", "resolution")
"""What the servos at A and E may have, and the motors of hips do not."""

KEYS = ("name", "leg", "servo", "mass", "trunk", "hips")


class Trunk(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The body between the legs, with everything that moves with it.

    Attributes:
        size: Length, width and height of its box [m].
        center: Middle of the box in the trunk's frame [m]; also the centre of mass.
        inertia: About the centre of mass, along x, y and z [kg m^2]; None: that of a box of even
            density.
    """

    size: Vector
    center: Vector = (0.0, 0.0, 0.0)
    inertia: Vector | None = None

    def __post_init__(self) -> None:
        for value in self.size:
            check_number("size", value, "m", low=0.0, high=LONGEST, strict=True)
        for value in self.center:
            check_number("center", value, "m", low=-LONGEST, high=LONGEST)

        if self.inertia is None:
            return

        for value in self.inertia:
            check_number("inertia", value, "kg m^2", low=0.0, high=HEAVIEST, strict=True)
        if 2.0 * max(self.inertia) > sum(self.inertia):
            raise ArgumentError(
                "inertia: no body has a moment of inertia greater than the sum of the other two, "
                f"got {list(self.inertia)} kg m^2"
            )

    def inertia_of(self, mass: float) -> Vector:
        """Return the moments of inertia of a trunk of a mass [kg], along x, y, z [kg m^2].

        Ix = m (w^2 + h^2) / 12,   Iy = m (l^2 + h^2) / 12,   Iz = m (l^2 + w^2) / 12

        Args:
            mass: m [kg].
        """
        if self.inertia is not None:
            return self.inertia
        length, width, height = (side**2 for side in self.size)
        part = mass / 12.0
        return part * (width + height), part * (length + height), part * (length + width)


class Robot(msgspec.Struct, frozen=True, kw_only=True):
    """A robot with four legs, in m and kg.

    Attributes:
        name: Name in tables and pictures.
        leg: Each of its legs; with the servo's rotor inertia, where the servo has one.
        servo: Each of its eight servos.
        mass: The whole robot, legs included [kg].
        trunk: The body between the legs.
        hips: Where each of the legs `LEGS` is.
    """

    name: str
    leg: FiveBar
    servo: Servo
    mass: float
    trunk: Trunk
    hips: dict[str, Hip]

    def __post_init__(self) -> None:
        check_number("mass", self.mass, "kg", low=0.0, high=HEAVIEST, strict=True)
        legs = self.mass - self.trunk_mass

        if not self.trunk_mass > 0.0:
            raise ArgumentError(
                f"mass must be in ({legs:g}, {HEAVIEST:g}] kg, more than that of the four legs, "
                f"got {self.mass!r}"
            )
        for leg in LEGS:
            if self.hips[leg].motors != self.hip_motors:
                raise ArgumentError(f"hips.{leg} must have the same motors as hips.{LEGS[0]}")
        self._check_apart()

    def _check_apart(self) -> None:
        """Raise if two legs are in the same place."""
        # Links are as thick as they are wide; the motors' axes take L5 between them.
        thick = 2.0 * max(self.leg.radius, self.leg.foot_radius)
        wide = self.leg.L5 + thick
        for one, other in combinations(LEGS, 2):
            pairs = zip(self.hips[one].pos, self.hips[other].pos, strict=True)
            x, y, z = (abs(a - b) for a, b in pairs)
            if y < thick and math.hypot(x, z) < wide:
                raise ArgumentError(
                    f"hips.{other} is inside hips.{one}: they must be {thick:g} m apart along y, "
                    f"or {wide:g} m in the leg's plane, got {y:g} m and {math.hypot(x, z):g} m"
                )

    @property
    def trunk_mass(self) -> float:
        """The mass of the trunk: what the legs leave [kg]."""
        own = sum(motor.mass for motor in self.hip_motors)
        return self.mass - 4.0 * (sum(link.mass for link in self.leg.links) + own)

    @property
    def hip_motors(self) -> tuple[HipMotor, ...]:
        """The motors of every hip that there are, from the trunk to the leg: T, S, both or none."""
        return self.hips[LEGS[0]].motors

    @property
    def joints(self) -> int:
        """How many joints a leg has: those of its hip, then A, B, E and D."""
        return 4 + len(self.hip_motors)

    @property
    def length(self) -> float:
        """Length of the trunk's box [m]: what speeds in body lengths are measured by."""
        return self.trunk.size[0]

    @classmethod
    def load(cls, source: str | Path) -> Robot:
        """Return the robot of a preset ("q8bot") or of a TOML file.

        Leg and servo are presets by name, TOML files beside the robot's, or tables with changes, as
        in a scenario.

        Raises:
            ConfigError: Unknown preset, unreadable file, unknown key, or a value out of range.
        """
        path = presets.find(source, "robot")
        table = {"name": path.stem, **presets.read(source, "robot")}
        return cls.from_table(table, str(source), path.parent)

    @classmethod
    def from_table(cls, table: Table, where: str, folder: Path) -> Robot:
        """Return the robot of a TOML table; `where` names it in messages, files are in `folder`.

        Raises:
            ConfigError: An unknown or missing key, or a value out of range; names the key.
        """
        tables.check_keys(table, KEYS, where)
        tables.check_finite(table, where)
        for key in KEYS:
            if key not in table:
                raise ConfigError(f"{where}: {key} is missing")

        servo = reading.servo(table["servo"], where, folder)
        try:
            # Numbers are checked here, by name, and not by msgspec: the Struct's own table would
            # be the leg spelt out.
            return cls(
                name=_printable(table["name"], where),
                leg=reading.leg(table["leg"], where, folder, servo.armature),
                servo=servo,
                mass=table["mass"],
                trunk=tables.convert(table["trunk"], Trunk, "trunk", where),
                hips=_hips(table["hips"], where),
            )
        except ArgumentError as error:
            raise ConfigError(f"{where}: {error}") from None

    def table(self) -> Table:
        """Return the robot as a TOML table, leg and servo spelt out."""
        trunk = msgspec.to_builtins(self.trunk)
        hips = {name: msgspec.to_builtins(hip) for name, hip in self.hips.items()}
        for motor in MOTORS:
            own = [hips[leg].pop(motor.key) for leg in LEGS]
            # All legs have the same.
            if own[0] is not None:
                hips[motor.key] = _present(own[0])
        return {
            "name": self.name,
            "leg": _present(asdict(self.leg)),
            "servo": _present(msgspec.to_builtins(self.servo)),
            "mass": self.mass,
            "trunk": _present(trunk),
            "hips": hips,
        }


def _present(table: Table) -> Table:
    """Return the keys that have a value: TOML has no null."""
    return {key: value for key, value in table.items() if value is not None}


def _printable(name: Any, where: str) -> str:
    if not isinstance(name, str) or not name.isprintable() or not name:
        raise ConfigError(f"{where}: name must be a printable string, got {name!r}")
    return name


def _hips(table: Any, where: str) -> dict[str, Hip]:
    """Return the four hips of a table [hips], all with the same motors if they have any."""
    if not isinstance(table, dict):
        raise ConfigError(f"{where}: hips must be a table, got {table!r}")
    keys = [motor.key for motor in MOTORS]
    tables.check_keys(table, (*LEGS, *keys), f"{where}: [hips]")
    motors = {
        motor.key: _hip_motor(table[motor.key], motor, where)
        for motor in MOTORS
        if motor.key in table
    }
    for leg in LEGS:
        if leg not in table:
            raise ConfigError(f"{where}: hips.{leg} is missing")

    hips: dict[str, Hip] = {}
    for leg in LEGS:
        for key in keys:
            if isinstance(table[leg], dict) and key in table[leg]:
                raise ConfigError(f"{where}: hips.{key} is that of all legs, not hips.{leg}'s own")
        hip = tables.convert(table[leg], Hip, f"hips.{leg}", where)
        hips[leg] = msgspec.structs.replace(hip, **motors)
    return hips


def _hip_motor(table: Any, kind: type[HipMotor], where: str) -> HipMotor:
    """Return the motor of all hips of a table."""
    name = f"hips.{kind.key}"
    for key in SERVO_ONLY:
        if isinstance(table, dict) and key in table:
            raise ConfigError(
                f"{where}: {name}.{key} is not known: {kind.letter} is an ideal position servo "
                "with kp and kd, without limit, delay or friction"
            )
    return tables.convert(table, kind, name, where)
