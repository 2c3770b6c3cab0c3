"""Cells as numbers and as moments; what is missing is NaN, what is wrong is named."""

from __future__ import annotations

import re
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.logs.dialect import MISSING

if TYPE_CHECKING:
    import pyarrow as pa


class Cells(NamedTuple):
    """The cells of a column in some rows.

    Attributes:
        values: As the file has them.
        name: The column.
        first: The number of the first row.
        decimal: The sign before a fraction, "." or ",".
        where: The file, for messages.
    """

    values: pa.Array
    name: str
    first: int
    decimal: str
    where: str


def numbers(cells: Cells) -> Array:
    """Return cells as numbers, NaN where a sample is missing, (n,).

    Raises:
        ConfigError: A cell that is neither; names column and row, and says what would help.
    """
    import pyarrow

    values = cells.values
    if pyarrow.types.is_temporal(values.type):
        raise ConfigError(f"{cells.where}: column {cells.name!r} holds times, not numbers")
    if pyarrow.types.is_nested(values.type) or pyarrow.types.is_binary(values.type):
        raise ConfigError(
            f"{cells.where}: column {cells.name!r} holds {values.type}, not numbers: write its "
            "parts as columns of their own"
        )
    if not _is_text(values):
        return _as_floats(values)

    text = _trimmed(cells)
    try:
        return _as_floats(text.cast(pyarrow.float64()))
    except pyarrow.ArrowInvalid:
        return _one_by_one(text, cells)


def _is_text(values: pa.Array) -> bool:
    import pyarrow

    return pyarrow.types.is_string(values.type) or pyarrow.types.is_large_string(values.type)


def _as_floats(values: pa.Array) -> Array:
    import pyarrow

    floats = values.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
    found = np.array(floats, dtype=np.float64)
    # A sensor that is gone: some write what a division by zero gives.
    found[np.isinf(found)] = np.nan
    return found


def _trimmed(cells: Cells) -> Any:
    """Return texts without blanks around them, with points; null where a sample is missing."""
    import pyarrow

    compute = _compute()
    text = compute.utf8_trim_whitespace(cells.values)
    missing = compute.is_in(compute.utf8_lower(text), pyarrow.array(sorted(MISSING)))
    text = compute.if_else(missing, pyarrow.scalar(None, text.type), text)
    if cells.decimal == ",":
        # A point is no number then: 1.234 may be a thousand.
        text = compute.replace_substring(text, ".", "x")
        text = compute.replace_substring(text, ",", ".")
    return text


def _compute() -> Any:
    """Return pyarrow.compute; its functions are made on import, where no checker sees them."""
    return import_module("pyarrow.compute")


def _one_by_one(text: Any, cells: Cells) -> Array:
    """Return texts as Python reads them, which takes a plus in front too."""
    found = np.empty(len(text))
    for k, cell in enumerate(text.to_pylist()):
        try:
            # Python reads 1_000 as a number.
            found[k] = np.nan if cell is None else float(cell.replace("_", "x"))
        except ValueError:
            came = cells.values[k].as_py()
            raise ConfigError(
                f"{cells.where}: column {cells.name!r}, row {cells.first + k}: must be a number, "
                f"got {came!r:.40}: {_cure(came)}"
            ) from None

    found[np.isinf(found)] = np.nan
    return found


CURES = (
    (r"[+-]?\d+[.,]\d+", "the file has decimal commas and points: use one of them in all of it"),
    (r"[+-]?\d{1,3}([.' ]\d{3})+([.,]\d+)?", "write numbers without signs between thousands"),
    (r"0x[0-9a-fA-F]+", "write numbers in decimals"),
    (r"[+-]?[\d.]+(e[+-]?\d+)?\s*\D+", "write the unit in the header, not behind the numbers"),
)
"""What wrong numbers look like, and what would help."""


def _cure(cell: str) -> str:
    """Return what would help where a cell is no number."""
    for pattern, said in CURES:
        if re.fullmatch(pattern, cell.strip()):
            return said
    return "leave the cell empty where a sample is missing"


class Clock:
    """Turns a column of time into seconds since the first row, exact to the file's own digits.

    Attributes:
        what: How the file writes time: "numbers" or "moments".
        origin: The first time as the file has it: number, or nanoseconds since 1970; None so far.
    """

    def __init__(self) -> None:
        self.what = "numbers"
        self.origin: int | float | None = None

    def seconds(self, cells: Cells, scale: float) -> Array:
        """Return seconds since the first row, NaN where the time is missing, (n,).

        Args:
            cells: Of some rows.
            scale: Seconds per number; moments have their own.

        Raises:
            ConfigError: A cell that is neither number nor moment.
        """
        ticks, missing = self._ticks(cells)
        unit = 1e-9 if self.what == "moments" else scale
        if self.origin is None:
            good = np.flatnonzero(~missing)
            if not len(good):
                return np.full(len(ticks), np.nan)
            self.origin = ticks[good[0]].item()
        # Whole numbers are subtracted exactly: floats have 200 ns near today's Unix time.
        since = (ticks - self.origin) * unit
        return np.where(missing, np.nan, since)

    def _ticks(self, cells: Cells) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return whole numbers where a column has such, else floats; and which are missing."""
        import pyarrow

        values = cells.values
        if pyarrow.types.is_temporal(values.type):
            self.what = "moments"
            return _whole(values.cast(pyarrow.timestamp("ns"), safe=False))
        if pyarrow.types.is_integer(values.type):
            return _whole(values)
        if not _is_text(values):
            floats = _as_floats(values)
            return floats, np.isnan(floats)

        text = _trimmed(cells)
        if self.what == "numbers":
            for kind in (pyarrow.int64(), pyarrow.float64()):
                if isinstance(self.origin, float) and kind == pyarrow.int64():
                    continue
                try:
                    read = text.cast(kind)
                except pyarrow.ArrowInvalid:
                    continue
                if kind == pyarrow.int64():
                    return _whole(read)
                floats = _as_floats(read)
                return floats, np.isnan(floats)

        found = _moments(text)
        if found is None:
            floats = self._numbers(cells)
            return floats, np.isnan(floats)
        self.what = "moments"
        return _whole(found)

    def _numbers(self, cells: Cells) -> Array:
        """Return the cells as numbers, or raise with what helps for times."""
        try:
            return numbers(cells)
        except ConfigError as error:
            said = str(error).partition(": must be")[0]
            came = str(error).rpartition(", got ")[2].partition(": ")[0]
            raise ConfigError(
                f"{said}: must be a time, got {came}: write seconds, or 2026-01-31 12:00:00.250"
            ) from None


def _whole(values: Any) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return whole numbers, 0 where one is missing, and which are."""
    import pyarrow

    missing = _compute().is_null(values).to_numpy(zero_copy_only=False)
    filled = values.cast(pyarrow.int64(), safe=False).fill_null(0)
    return filled.to_numpy(zero_copy_only=False), missing


def _moments(text: Any) -> Any:
    """Return texts as moments, or None if they are not: with a date, or times of a day."""
    import pyarrow

    for kind in (pyarrow.timestamp("ns"), pyarrow.timestamp("ns", "UTC"), pyarrow.time64("ns")):
        try:
            return text.cast(kind)
        except (pyarrow.ArrowInvalid, pyarrow.ArrowNotImplementedError):
            continue
    return None
