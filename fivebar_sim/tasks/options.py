"""Options of environments: objects, or names and tables as scenarios have them, from YAML or JSON.

What cannot be read is an ArgumentError that says what is legal; one in a table or a file is a
ConfigError as well.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from fivebar_sim.checks import is_finite
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError, OptionError
from fivebar_sim.files import resources, tables
from fivebar_sim.geometry import FiveBar
from fivebar_sim.paths import FootPath, kinds
from fivebar_sim.scenario import reading

HERE = Path()
"""Where the files that a table names are looked up."""


class Kind(NamedTuple):
    """What an option may be.

    Attributes:
        made: The class of the object itself.
        read: Returns the object of a table.
        legal: What is legal, for messages.
    """

    made: type[Any]
    read: Callable[[dict[str, Any]], Any]
    legal: Callable[[], str]


def _struct(kind: type[Any], name: str) -> Kind:
    """Return the kind of an option that is a msgspec Struct."""
    keys = ", ".join(tables.keys(kind))
    return Kind(
        kind,
        lambda table: tables.convert(table, kind, name, "options"),
        lambda: f"a {kind.__name__} or a table of its keys ({keys})",
    )


def _preset_or_table(kind: str, made: str) -> str:
    names = ", ".join(resources.shipped(f"models/{kind}s"))
    return f"a {made}, the name of a preset ({names}), a TOML file or a table"


KINDS: dict[str, Kind] = {
    "leg": Kind(
        FiveBar,
        lambda table: reading.leg(table, "options", HERE),
        lambda: _preset_or_table("leg", "FiveBar"),
    ),
    "servo": Kind(
        Servo,
        lambda table: reading.servo(table, "options", HERE),
        lambda: _preset_or_table("servo", "Servo"),
    ),
    "path": Kind(
        FootPath,
        lambda table: reading.path(table, "options", HERE),
        lambda: f"a FootPath, None, or a table with a kind ({', '.join(sorted(kinds()))})",
    ),
    "sensors": _struct(Sensors, "sensors"),
}
"""The options of tasks that are not numbers."""


def read(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a task with names and tables turned into the objects they mean.

    The rotor comes with the servo, as in scenarios: a leg that is given by name or as a table, or
    left out, has the servo's armature where it names none of its own.

    Raises:
        ArgumentError: Something else; says what is legal.
    """
    found = {name: as_object(name, value) for name, value in options.items()}
    servo = found.get("servo")
    leg = options.get("leg", "classic")
    if isinstance(servo, Servo) and servo.armature is not None and not isinstance(leg, FiveBar):
        table = leg if isinstance(leg, Mapping) else {"preset": str(leg)}
        found["leg"] = reading.leg(dict(table), "options", HERE, servo.armature)
    return found


def as_object(name: str, value: Any) -> Any:
    """Return the object that the value of an option means.

    Raises:
        ArgumentError: It means none; says what is legal.
    """
    kind = KINDS.get(name)
    if kind is None or isinstance(value, kind.made) or (name == "path" and value is None):
        return value
    try:
        if isinstance(value, Mapping):
            table = dict(value)
            tables.check_finite(table, "options")
            return kind.read(table)
        # So that gymnasium.make("fivebar/Track-v0", leg="q8bot") needs no import of ours.
        if isinstance(value, (str, Path)) and hasattr(kind.made, "load"):
            return kind.made.load(value)
    except ConfigError as error:
        raise OptionError(str(error)) from None
    raise ArgumentError(f"{name} must be {kind.legal()}, got {reprlib.repr(value)}")


def as_struct(name: str, value: Any, kind: type[Any]) -> Any:
    """Return a Struct, or the one that a table means.

    Raises:
        ArgumentError: Neither.
    """
    described = _struct(kind, name)
    if isinstance(value, kind):
        return value
    if not isinstance(value, Mapping):
        raise ArgumentError(f"{name} must be {described.legal()}, got {reprlib.repr(value)}")
    try:
        return described.read(dict(value))
    except ConfigError as error:
        raise OptionError(str(error)) from None


def check_kind(name: str, value: Any) -> None:
    """Raise unless an option is the object that a task holds.

    Raises:
        ArgumentError: It is not; says what is legal.
    """
    kind = KINDS[name]
    if not isinstance(value, kind.made) and not (name == "path" and value is None):
        raise ArgumentError(f"{name} must be {kind.legal()}, got {reprlib.repr(value)}")


def check_whole(name: str, value: Any, low: int) -> int:
    """Return a whole number.

    Raises:
        ArgumentError: It is not one, or below `low`.
    """
    if not (is_finite(value) and value >= low and value == int(value)):
        raise ArgumentError(
            f"{name} must be a whole number in [{low}, inf), got {reprlib.repr(value)}"
        )
    return int(value)


def check_bool(name: str, value: Any) -> None:
    """Raise unless an option is True or False.

    Raises:
        ArgumentError: It is neither.
    """
    if not isinstance(value, bool):
        raise ArgumentError(f"{name} must be True or False, got {reprlib.repr(value)}")


def plain(value: Any) -> Any:
    """Return an option as what JSON and YAML can hold; `read` makes the same option of it."""
    if isinstance(value, FiveBar):
        value = asdict(value)
    elif isinstance(value, msgspec.Struct):
        fields = {name: getattr(value, name) for name in value.__struct_fields__}
        tag = value.__struct_config__.tag
        value = fields if tag is None else {value.__struct_config__.tag_field: tag, **fields}

    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items() if each is not None}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return str(value) if isinstance(value, Path) else value
