"""Tables of two numbers over time in a CSV file, such as a path's points or a force's rows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.files import input_file

if TYPE_CHECKING:
    from fivebar_sim.logs.channels import Channels

Headers = Mapping[tuple[str, str, str], float]

SAME_POINT = 1e-9
"""Two points this close are one: the last point repeats the first [m]."""

LARGEST = 1e6
"""Upper end of numbers in a CSV: a kilometre in mm, eleven days in s, a meganewton in N."""

SHORTEST = 1e-9
"""Lower end of the time between two rows [s]: rates over shorter ones overflow."""


class TimedPairs(NamedTuple):
    """The rows of a CSV file.

    Attributes:
        time: Strictly growing from 0 [s], shape (n,).
        pair: (x, z) in the hip frame, SI, shape (n, 2).
    """

    time: Array
    pair: Array

    @property
    def span(self) -> float:
        """Last time minus first [s]."""
        return float(self.time[-1])

    @property
    def closed(self) -> bool:
        """Whether the last point repeats the first."""
        return bool(np.max(np.abs(self.pair[-1] - self.pair[0])) <= SAME_POINT)


def read_bytes(file: Path, what: str) -> bytes:
    """Return all of a CSV file.

    Args:
        file: The CSV.
        what: Kind of content, for messages: "foot path".

    Raises:
        ConfigError: The file cannot be read.
    """
    try:
        input_file.check(file, input_file.TABLE)
        return file.read_bytes()
    except OSError as error:
        raise ConfigError(f"cannot read {what} {file}: {error.strerror}") from None


def read_track(raw: bytes, headers: Headers, what: str, file: Path) -> TimedPairs:
    """Return the rows of a CSV file, in SI units and from t = 0.

    Args:
        raw: All of the file.
        headers: The legal headers (time, x, z), each with its unit of x and z in SI.
        what: Kind of content, for messages: "foot path".
        file: The CSV, for messages.

    Raises:
        ConfigError: It is not UTF-8, has another header, a row with the wrong number of cells, a
            cell that is not a finite number, times that do not grow by at least `SHORTEST`, or one
            row.
    """
    lines = _lines(raw, file)
    if not lines:
        raise ConfigError(f"{file}: no header; {_legal(headers)}")

    (number, header), *rows = lines
    order, scale = _columns(header, headers, f"{file}, line {number}")
    table = np.empty((len(rows), 3))
    for k, (number, cells) in enumerate(rows):
        where = f"{file}, line {number}"
        if len(cells) != len(header):
            raise ConfigError(
                f"{where}: a row must have {len(header)} cells ({','.join(header)}), got "
                f"{len(cells)}"
            )
        table[k] = [_number(cells[i], header[i], where) for i in order]
        if k > 0 and not table[k, 0] > table[k - 1, 0]:
            word = "repeated" if table[k, 0] == table[k - 1, 0] else "not sorted"
            raise ConfigError(
                f"{where}: times are {word}: time_s must be > {float(table[k - 1, 0])!r} s of line "
                f"{rows[k - 1][0]}, got {float(table[k, 0])!r} s"
            )
        if k > 0 and not table[k, 0] - table[k - 1, 0] >= SHORTEST:
            raise ConfigError(
                f"{where}: times are too close: time_s must be at least {SHORTEST:g} s after that "
                f"of line {rows[k - 1][0]}, got {float(table[k, 0])!r} s"
            )

    if len(rows) < 2:
        raise ConfigError(f"{file}: a {what} needs at least 2 rows, got {len(rows)}")
    return TimedPairs(table[:, 0] - table[0, 0], scale * table[:, 1:])


def read_mapped(raw: bytes, table: Mapping[str, Any], known: Channels, where: str) -> TimedPairs:
    """Return the rows of a log of any kind, by a table of its columns, SI units, from t = 0.

    Args:
        raw: All of the file.
        table: Which column is which of the channels, as in a table [log].
        known: The channels: time, x, z.
        where: The file, for messages.

    Raises:
        ConfigError: What `logs.read` raises.
    """
    # As in `angles`.
    from fivebar_sim import logs

    told = logs.read_map(dict(table), f"{where}: columns", known=known)
    log = logs.read(raw, told, known, ("x", "z"), where)
    time, pair = log.complete("x", "z")
    return TimedPairs(time - time[0], pair)


def _lines(raw: bytes, file: Path) -> list[tuple[int, list[str]]]:
    """Return the lines that are neither blank nor comments, as (line number, stripped cells)."""
    try:
        # -sig: some spreadsheets put a byte order mark in front.
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        number = raw.count(b"\n", 0, error.start) + 1
        byte = raw[error.start]
        raise ConfigError(f"{file}, line {number}: must be UTF-8, got byte 0x{byte:02x}") from None

    stripped = ((k, line.strip()) for k, line in enumerate(text.split("\n"), start=1))
    return [
        (k, [cell.strip() for cell in line.split(",")])
        for k, line in stripped
        if line and not line.startswith("#")
    ]


def _columns(header: list[str], headers: Headers, where: str) -> tuple[list[int], float]:
    """Return the columns of time, x and z in a header, and its unit in SI."""
    for legal, scale in headers.items():
        if sorted(header) == sorted(legal):
            return [header.index(name) for name in legal], scale

    known = {name for legal in headers for name in legal}
    # The legal header that shares most columns is the one that was meant.
    nearest = max(headers, key=lambda legal: len(set(legal) & set(header)))
    strange = [name for name in header if name not in known]
    missing = [name for name in nearest if name not in header]

    if strange:
        problem = unknown("column", strange[0], known)
    elif missing:
        problem = f"no column {missing[0]!r}"
    else:
        problem = "too many columns"

    raise ConfigError(f"{where}: {problem}; {_legal(headers)}, got {','.join(header)!r}")


def _legal(headers: Headers) -> str:
    names = " or ".join(",".join(legal) for legal in headers)
    return f"the header must be {names}, in any order"


def _number(cell: str, column: str, where: str) -> float:
    """Return a cell as a finite number."""
    try:
        # Python reads 1_000 as a number; spreadsheets do not.
        value = math.nan if "_" in cell else float(cell)
    except ValueError:
        value = math.nan
    # Refuses NaN as well.
    if not abs(value) <= LARGEST:
        legal = f"[{-LARGEST:g}, {LARGEST:g}]"
        raise ConfigError(f"{where}: {column} must be a number in {legal}, got {cell!r}")
    return value
