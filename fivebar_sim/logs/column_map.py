"""The table `[log]`: which column of a file is what, in which unit, with which sign and offset."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import quantities, tables
from fivebar_sim.files.tables import Table
from fivebar_sim.logs import channels
from fivebar_sim.logs.channels import Channels

OWN_KEYS = ("file", "rate", "start", "end", "jumps")
"""Keys of a `[log]` table that are not channels."""


class Column(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A column of a file and what its numbers mean.

        channel = sign size number + offset

    with the size of the unit; kt turns a current into a torque.

    Attributes:
        column: Its name in the file's header; "1", "2", ... in a file without a header.
        unit: The unit that the file has, such as "deg" or "turn/4096"; "" for the SI unit.
        sign: 1, or -1 where the file counts the other way round.
        offset: What is added in the channel's SI unit, or a text with a unit, "90 deg".
        kt: Torque per current [N m/A]: the column is a current, the channel a torque.
        wrap: Number at which the column begins at 0 again, as a counter or a single turn does.
        plus: A second column that is added, as nanoseconds are to seconds.
    """

    column: str
    unit: str = ""
    sign: Literal[1, -1] = 1
    offset: float | str = 0.0
    kt: float | None = None
    wrap: float | None = None
    plus: dict[str, Any] | None = None


class Scaled(NamedTuple):
    """A column with its numbers' meaning worked out.

    Attributes:
        column: Its name in the file.
        scale: The channel's SI unit per number, sign included.
        offset: In the channel's SI unit.
        wrap: Number at which the column begins again at 0; None for never.
        plus: A column that is added to it before the offset.
    """

    column: str
    scale: float
    offset: float = 0.0
    wrap: float | None = None
    plus: Scaled | None = None


class ColumnMap(NamedTuple):
    """What a `[log]` table says.

    Attributes:
        channels: The column of each channel that the file has.
        where: The table, for messages.
        file: The file, resolved; None where the table names none.
        rate: Rows a second of a file without a time column [Hz].
        start: Rows before it are left out, counted from the first row [s].
        end: Rows after it are left out; None for none [s].
        jumps: What to do where the clock goes back or jumps: refuse the log, join the parts, each
            one usual interval after the last, or keep only the longest.
    """

    channels: dict[str, Scaled]
    where: str
    file: Path | None = None
    rate: float | None = None
    start: float = 0.0
    end: float | None = None
    jumps: str = "refuse"


def read_map(
    table: Table, where: str, folder: Path | None = None, known: Channels = channels.LEG
) -> ColumnMap:
    """Return what a table says.

    Args:
        table: Keys of `ColumnMap` but `channels`, and channels: a column's name for numbers in SI
            units, or a table with the keys of `Column`.
        where: The table, for messages: "bench.toml: log".
        folder: What `file` is relative to.
        known: The channels that there may be.

    Raises:
        ConfigError: An unknown key, or a value that is illegal; names it.
    """
    tables.check_keys(table, [*OWN_KEYS, *known], where)
    tables.check_finite(table, where)
    own = {key: table[key] for key in OWN_KEYS if key in table}
    file = own.get("file")
    if file is not None and (not isinstance(file, str) or not file or "\0" in file):
        raise ConfigError(f"{where}: file must be the name of a log, got {file!r}")

    rate = _number(own, "rate", "Hz", where)
    if "time" in table and rate is not None:
        raise ConfigError(f"{where}: rate is for logs without time: give one of both")
    start = _number(own, "start", "s", where) or 0.0
    end = _number(own, "end", "s", where)
    if end is not None and not end > start:
        raise ConfigError(f"{where}: end must be above start = {start:g} s, got {end:g} s")

    jumps = own.get("jumps", "refuse")
    if jumps not in ("refuse", "join", "longest"):
        raise ConfigError(f"{where}: jumps must be 'refuse', 'join' or 'longest', got {jumps!r}")
    given = {name: value for name, value in table.items() if name in known}
    scaled = {
        name: _scaled(value, known[name], f"{where}: {name}") for name, value in given.items()
    }
    place = None if file is None else (folder or Path()) / file
    return ColumnMap(scaled, where, place, rate, start, end, jumps)


def load(path: Path, known: Channels = channels.LEG) -> ColumnMap:
    """Return the table `[log]` of a TOML file; `file` in it is relative to its folder.

    Raises:
        ConfigError: No such file or table, or `read_map` refuses it.
    """
    table = tables.read(path, "log's table").get("log")
    if not isinstance(table, dict):
        raise ConfigError(f"{path}: no table [log]; `fivebar log FILE --map {path}` writes one")
    found = read_map(table, f"{path}: log", path.parent, known)
    if found.file is None:
        raise ConfigError(f"{path}: log.file is missing")
    return found


def _number(table: Table, key: str, unit: str, where: str) -> float | None:
    """Return a positive number of a table, or None where it is left out."""
    if key not in table:
        return None
    value = quantities.quantity(table[key], unit, f"{where}: {key}")
    low = 0.0
    strict = key != "start"
    check_number(f"{where}: {key}", value, unit, low=low, strict=strict, error=ConfigError)
    return float(value)


def _scaled(value: Any, unit: str, what: str) -> Scaled:
    """Return a channel's column."""
    if isinstance(value, str):
        value = {"column": value}
    key = what.rpartition(" ")[2]
    where = what.removesuffix(f": {key}")
    column = tables.convert(value, Column, key, where)
    if column.kt is not None and unit != "N m":
        raise ConfigError(f"{what}: kt is for torques, which are a current times it")
    if column.kt is not None:
        check_number(f"{what}.kt", column.kt, "N m/A", low=0.0, strict=True, error=ConfigError)
    if column.wrap is not None:
        check_number(f"{what}.wrap", column.wrap, "", low=0.0, strict=True, error=ConfigError)

    written = unit if column.kt is None else "A"
    scale = column.sign * channels.size(column.unit, written, what) * (column.kt or 1.0)
    offset = column.offset
    if isinstance(offset, str):
        offset = quantities.quantity(offset, unit, f"{what}.offset")
    if not isinstance(offset, int | float):
        raise ConfigError(f"{what}.offset must be a number or a text such as '90 deg'")
    plus = None if column.plus is None else _scaled(column.plus, unit, f"{what}.plus")
    return Scaled(column.column, scale, float(offset), column.wrap, plus)
