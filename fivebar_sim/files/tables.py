"""TOML tables: reading, changes by KEY=VALUE, and strict conversion; errors name the key."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

from fivebar_sim.errors import ConfigError, UnknownError, unknown
from fivebar_sim.files import input_file, quantities

T = TypeVar("T")
Table = dict[str, Any]


DEEPEST = 20
"""Deepest nesting of tables and arrays in an input; no legal key needs more than 4 levels."""


def read(path: Path, what: str) -> Table:
    """Return the table of a TOML file; `what` names the kind of file in messages.

    Raises:
        ConfigError: The file is missing, unreadable or not TOML.
    """
    try:
        input_file.check(path, input_file.TEXT)
        # "-sig" drops the byte order mark that Windows editors put in front; TOML allows none.
        return _loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ConfigError(f"cannot read {what} {path}: {error.strerror}") from None
    except ValueError as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None


def _loads(text: str) -> Table:
    """Return the table of a TOML text.

    Raises:
        ValueError: Not TOML, or an integer too long for Python to read.
    """
    try:
        table = tomllib.loads(text)
    # tomllib recurses into arrays; a file must not cause a traceback.
    except RecursionError:
        raise ValueError("nested too deep") from None
    if is_deep(table):
        raise ValueError(f"nested too deep: at most {DEEPEST} tables or arrays in each other")
    return table


def is_deep(value: Any) -> bool:
    """Return whether more than `DEEPEST` tables or arrays are nested in a value."""
    # Level by level, not recursively: the nesting may be deeper than Python's stack.
    level = [value]
    for _ in range(DEEPEST):
        nests = [each for each in level if isinstance(each, (list, Mapping))]
        if not nests:
            return False
        level = [
            inner
            for each in nests
            for inner in (each.values() if isinstance(each, Mapping) else each)
        ]
    return any(isinstance(each, (list, Mapping)) for each in level)


def parse_setting(setting: str) -> tuple[list[str], Any]:
    """Return key parts and value of "path.radii=[0.01, 0.02]"; if not TOML, it is a string.

    Raises:
        ConfigError: No "=", or an empty part in the key.
    """
    key, equals, text = setting.partition("=")
    parts = [part.strip().strip("\"'") for part in key.split(".")]
    if not equals or not all(parts) or not _is_utf8(setting) or len(parts) > DEEPEST:
        raise ConfigError(f"--set takes KEY=VALUE, got {setting!r}")
    try:
        table = _loads(f"value = {text}")
    except ValueError:
        return parts, text.strip()
    # A line break in the text could smuggle in further keys: then it is a string too.
    return parts, table["value"] if len(table) == 1 else text.strip()


def _is_utf8(text: str) -> bool:
    """Return whether an argument was UTF-8; Python turns other bytes into lone surrogates."""
    return not any("\ud800" <= c <= "\udfff" for c in text)


def put(table: Table, parts: list[str], value: Any, where: str) -> None:
    """Set the value at a dotted key; missing tables on the way are made.

    Raises:
        ConfigError: If a part on the way is a value, not a table.
    """
    for depth, part in enumerate(parts[:-1]):
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            key = ".".join(parts[: depth + 1])
            raise ConfigError(f"{where}: {key} is a value, so it has no {'.'.join(parts)}")
    table[parts[-1]] = value


def flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, value) of every value in nested tables."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def check_finite(table: Mapping[str, Any], where: str) -> None:
    """Raise if any number in the table is NaN, infinite, or an integer beyond 64 bits.

    Raises:
        ConfigError: Naming the key.
    """
    for key, value in flat(table):
        for number in _leaves(value):
            if isinstance(number, float) and not math.isfinite(number):
                raise ConfigError(f"{where}: {key} must be finite, got {value}")
            # TOML has 64 bits, and other readers of the stored scenario may have no more.
            if isinstance(number, int) and not -(2**63) <= number < 2**63:
                raise ConfigError(f"{where}: {key} must fit in 64 bits, has {number.bit_length()}")


def _leaves(value: Any) -> Iterator[Any]:
    """Yield the values at any depth of arrays and tables."""
    if isinstance(value, (list, Mapping)):
        for part in value.values() if isinstance(value, Mapping) else value:
            yield from _leaves(part)
    else:
        yield value


def check_keys(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    """Raise if the table has a key that is not known.

    Raises:
        ConfigError: Naming the key, the known ones and a guess.
    """
    known = list(known)
    for key in table:
        if key not in known:
            raise UnknownError(f"{where}: {unknown('key', key, known)}")


def bounds(
    table: Any, known: Iterable[str], name: str, where: str
) -> dict[str, tuple[float, float]]:
    """Return a table of limits as (low, high) by dotted key; one number is an upper bound.

    Args:
        table: What the file has under `name`, nested, dotted or quoted.
        known: The keys that may be limited.
        name: The table's key, for messages.
        where: The file, for messages.

    Raises:
        ConfigError: Not a table, an unknown key, a key set twice, or a bound that is neither a
            number nor [low, high].
    """
    if not isinstance(table, dict):
        raise ConfigError(f"{where}: {name} must be a table, got {table!r}")

    limits: dict[str, tuple[float, float]] = {}
    check_keys(dict(flat(table)), known, f"{where}: [{name}]")
    for key, bound in flat(table):
        if key in limits:
            raise ConfigError(f"{where}: {name}.{key} is set twice")
        # A single number is an upper bound: nothing is wanted from below.
        pair = bound if isinstance(bound, list) else [-math.inf, bound]
        # bool is a subclass of int, but true is not a bound.
        numbers = all(isinstance(b, (int, float)) and not isinstance(b, bool) for b in pair)
        if len(pair) != 2 or not numbers or not pair[0] <= pair[1]:
            raise ConfigError(
                f"{where}: {name}.{key} must be an upper bound or [low, high], got {bound!r}"
            )
        limits[key] = (float(pair[0]), float(pair[1]))

    return limits


def keys(kind: type) -> list[str]:
    """Return the keys that a Struct takes, including its tag's."""
    return list(_keys(kind))


@cache  # msgspec compiles the annotations of a class anew each time
def _keys(kind: type) -> tuple[str, ...]:
    """Return what `keys` does."""
    tag = kind.__struct_config__.tag_field
    return (*([tag] if tag else []), *(f.encode_name for f in msgspec.structs.fields(kind)))


WORDS = {
    "array": "an array",
    "bool": "true or false",
    "float": "a number",
    "int": "an integer",
    "object": "a table",
    "str": "a string",
}
"""Names of msgspec's types in messages."""


def convert(table: Any, kind: type[T], name: str, where: str) -> T:
    """Return a table as a Struct of the given kind; numbers may be texts with a unit, "40 mm".

    Args:
        table: What the file has under `name`.
        kind: A Struct whose fields are not Structs.
        name: The table's key, for messages.
        where: The file, for messages.

    Raises:
        ConfigError: Not a table, an unknown or missing key, a wrong type, a value out of range.
    """
    if not isinstance(table, dict):
        raise ConfigError(f"{where}: {name} must be a table, got {table!r}")
    check_keys(table, keys(kind), f"{where}: [{name}]")
    table = quantities.in_si(table, kind, name, where)
    try:
        return msgspec.convert(table, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{where}: {_explain(str(error), table, kind, name)}") from None


def _explain(message: str, table: Table, kind: type, name: str) -> str:
    """Return msgspec's message with the key in front and the value that came at the end."""
    text, _, at = message.partition(" - at `$")
    at = at.rstrip("`").lstrip(".")
    missing = re.fullmatch(r"Object missing required field `(.+)`", text)
    if missing:
        return f"{name}.{missing[1]} is missing"
    # Without a place it is a Struct's own check, whose text begins with the key.
    if not at:
        return f"{name}.{text}"

    # The place may go on into an array: the value to show is the whole key's.
    key = re.split(r"[.\[]", at)[0]
    value = table.get(key)
    legal = get_args(get_type_hints(kind).get(key))
    if text.startswith("Invalid enum value") and legal:
        return f"{name}.{key} must be one of {', '.join(map(repr, legal))}, got {value!r}"

    expected = re.fullmatch(r"Expected `(\w+)[^`]*`(.*?)(, got .*)?", text)
    if expected:
        word = WORDS.get(expected[1], expected[1])
        return f"{name}.{at} must be {word}{expected[2]}, got {value!r}"

    return f"{name}.{at}: {text}"
