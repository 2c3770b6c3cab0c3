"""Numbers with units in input files, "40 mm" or "90 deg", and the units of keys in written ones.

The unit of a key is written once, in its class's docstring, where "[m]" stands behind its name.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

import msgspec

from fivebar_sim.errors import ConfigError
from fivebar_sim.units import LADDERS

TURN = 2.0 * math.pi

SIZES: dict[str, dict[str, float]] = {
    **{next(name for name in ladder if ladder[name] == 1.0): dict(ladder) for ladder in LADDERS},
    "rad": {"mrad": 1e-3, "deg": TURN / 360.0, "rad": 1.0, "turn": TURN},
    "rad/s": {"mrad/s": 1e-3, "deg/s": TURN / 360.0, "rpm": TURN / 60.0, "rad/s": 1.0},
    "Hz": {"mHz": 1e-3, "Hz": 1.0, "kHz": 1e3},
    "kg": {"mg": 1e-6, "g": 1e-3, "kg": 1.0},
    "kg m^2": {"g mm^2": 1e-9, "g cm^2": 1e-7, "kg mm^2": 1e-6, "kg m^2": 1.0},
    "kg/m^3": {"kg/m^3": 1.0, "g/cm^3": 1e3},
    "m/s": {"mm/s": 1e-3, "cm/s": 1e-2, "m/s": 1.0},
    "m/s^2": {"m/s^2": 1.0},
    "N/m": {"N/m": 1.0, "N/mm": 1e3},
    "N s/m": {"N s/m": 1.0},
    "N m/rad": {"mN m/rad": 1e-3, "N m/rad": 1.0, "N m/deg": 360.0 / TURN},
    "N m s/rad": {"mN m s/rad": 1e-3, "N m s/rad": 1.0},
    "N m/A": {"mN m/A": 1e-3, "N m/A": 1.0},
    "1/(N m)": {"1/(N m)": 1.0},
    "ohm": {"mohm": 1e-3, "ohm": 1.0},
    "K/W": {"K/W": 1.0},
    "deg C": {"deg C": 1.0},
    "1/s": {"1/s": 1.0},
    "1/s^2": {"1/s^2": 1.0},
}
"""The units of each SI unit, with their sizes in it."""

SIZES["m"]["cm"] = 1e-2

NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(1/.*|[^\d\s.].*)")
"""A number, then a unit."""

ATTRIBUTE = re.compile(r"^\s*((?:\w+, )*\w+): (.*)$")


@cache
def units_of(kind: type[Any]) -> dict[str, str]:
    """Return the SI unit of each key of a class, as its docstring and its bases' name it."""
    found: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        found |= _named(inspect.cleandoc(each.__doc__ or ""))
    if not issubclass(kind, msgspec.Struct):
        return found
    fields = msgspec.structs.fields(kind)
    return {f.encode_name: found[f.name] for f in fields if f.name in found}


def _named(doc: str) -> dict[str, str]:
    """Return the units that stand in a docstring's section Attributes, by name."""
    found: dict[str, str] = {}
    names: list[str] = []
    _, _, section = doc.partition("\nAttributes:\n")
    for line in section.splitlines():
        begun = ATTRIBUTE.match(line) if re.match(r"    \w", line) else None
        names = begun[1].split(", ") if begun else names
        units = [unit for unit in re.findall(r"\[([^]]+)\]", line) if unit in SIZES]
        # What stands first is the attribute's own; others are those of its examples.
        for name in names if units else ():
            found.setdefault(name, units[0])
    return found


def in_si(table: Mapping[str, Any], kind: type[Any], name: str, where: str) -> dict[str, Any]:
    """Return a table with texts such as "40 mm" turned into numbers in the SI units of its keys.

    Args:
        table: What a file has under `name`.
        kind: The class whose docstring names the units.
        name: The table's key, for messages; "" for none.
        where: The file, for messages.

    Raises:
        ConfigError: A unit that is not one of its key's.
    """
    units = units_of(kind) if any(_has_text(value) for value in table.values()) else {}
    prefix = f"{name}." if name else ""
    return {
        key: quantity(value, units[key], f"{where}: {prefix}{key}") if key in units else value
        for key, value in table.items()
    }


def _has_text(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, list) and any(map(_has_text, value)))


def quantity(value: Any, unit: str, what: str) -> Any:
    """Return a text with a unit, or each of a list, as a number in an SI unit; else the value.

    Args:
        value: "40 mm", ["40 mm", 0.03], or anything else, which is returned as it is.
        unit: The SI unit.
        what: What it is, for messages.

    Raises:
        ConfigError: Another unit.
    """
    if isinstance(value, list):
        return [quantity(each, unit, what) for each in value]
    parts = NUMBER.fullmatch(value) if isinstance(value, str) else None
    if parts is None:
        return value
    given = " ".join(parts[2].replace("µ", "u").replace("°", "deg").split())
    if given not in SIZES[unit]:
        legal = ", ".join(SIZES[unit])
        raise ConfigError(f"{what} must have one of the units {legal}, got {value!r}")
    size = SIZES[unit][given]
    # A thousandth is no float, but to divide by a thousand is exact: "40 mm" is 0.04.
    whole = round(1.0 / size)
    return float(parts[1]) / whole if whole * size == 1.0 else float(parts[1]) * size


def annotated(text: str, kinds: Mapping[str, type[Any]], more: Mapping[str, str]) -> str:
    """Return a TOML text with the unit of each key behind it, as a comment.

    Args:
        text: As `tomli_w` writes it.
        kinds: The class of each table.
        more: Units of keys outside any table.
    """
    lines = []
    units = more
    for line in text.splitlines():
        if line.startswith("["):
            kind = kinds.get(line.strip("[]"))
            units = units_of(kind) if kind else {}
        key = re.match(r"(\w+) = ", line)
        unit = units.get(key[1]) if key else None
        lines.append(f"{line}  # [{unit}]" if unit else line)
    return "\n".join(lines) + "\n"
