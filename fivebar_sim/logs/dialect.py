"""How a text file is written: separator, decimal sign, header, units, told from its first lines."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars", ",": "commas", " ": "blanks"}
"""What may stand between cells, and its name; of two that fit the first counts."""

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
COMMA = re.compile(r"[+-]?(\d+,\d+|,\d+)([eE][+-]?\d+)?")
MOMENT = re.compile(r"(\d{4}-\d\d-\d\d[ T])?\d\d?:\d\d(:\d\d([.,]\d+)?)?(Z|[+-]\d\d:?\d\d)?")
LABEL = re.compile(r"\s*([A-Za-z_]\w*)\s*:\s*(\S+)\s*")
UNIT = re.compile(r"[\[(]?[A-Za-z°µ%^][A-Za-z0-9°µ/*^. ]{0,11}[\])]?|[\[(][\])]|-|")
PRINTED = re.compile(r"\d\d?:\d\d:\d\d\.\d+ -> ")
"""What the Arduino's serial monitor puts in front of a line."""

MISSING = frozenset({"", "nan", "null", "none", "na", "n/a", "-", "--", "#n/a", "inf", "-inf"})
"""Cells of samples that are missing, in small letters."""


class Dialect(NamedTuple):
    """How a text file is written.

    Attributes:
        separator: One of `SEPARATORS`.
        decimal: "." or ",".
        skip: Lines before the first row.
        names: The header's cells, or "1", "2", ... where there is none.
        units: The cells of a line of units below the header; () for none.
        labelled: Whether each cell is a label with a value: "theta_A:0.5".
    """

    separator: str
    decimal: str
    skip: int
    names: list[str]
    units: list[str]
    labelled: bool

    @property
    def words(self) -> str:
        """The dialect in words: "semicolons, decimal commas, no header"."""
        said = [SEPARATORS[self.separator]]
        if self.decimal == ",":
            said.append("decimal commas")
        if self.labelled:
            said.append("a label in each cell")
        elif self.names == [str(k + 1) for k in range(len(self.names))]:
            said.append("no header")
        return ", ".join(said)


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line; quotes may hold a separator."""
    if separator == " ":
        return line.split()
    return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])


def tell(lines: Sequence[str]) -> Dialect | None:
    """Return how a file is written, or None where its first lines hold no rows of numbers."""
    chosen = max(SEPARATORS, key=lambda separator: _score(lines, separator))
    if _score(lines, chosen) == 0.0:
        return None

    rows = [split(line, chosen) for line in lines]
    count = _usual(rows)
    first = next((k for k, row in enumerate(rows) if len(row) == count and _filled(row)), None)
    if first is None:
        return None
    body = [row for row in rows[first:] if len(row) == count]
    labelled = all(LABEL.fullmatch(cell) for cell in body[0])
    names, units = _header(rows[:first], count, chosen)
    if labelled:
        names = [match[1] for cell in body[0] if (match := LABEL.fullmatch(cell))]
        units = []
    commas = any(COMMA.fullmatch(cell.strip()) for row in body for cell in row)
    decimal = "," if commas and chosen != "," else "."
    return Dialect(chosen, decimal, first, names, units, labelled)


def _score(lines: Sequence[str], separator: str) -> float:
    """Return how well a separator fits: lines with the usual number of cells, by their numbers."""
    rows = [row for line in lines if (row := split(line, separator))]
    count = _usual(rows)
    parts = [sum(map(is_value, row)) / len(row) for row in rows if len(row) == count]
    # One cell a line fits any separator, and says nothing for one.
    return sum(parts) * (1.0 if count > 1 else 1e-3)


def _usual(rows: Sequence[Sequence[str]]) -> int:
    """Return the number of cells that most rows with numbers have."""
    counts = Counter(len(row) for row in rows if any(map(is_value, row)))
    return counts.most_common(1)[0][0] if counts else 0


def is_value(cell: str) -> bool:
    """Return whether a cell is a number, a time, or a label with a number."""
    text = cell.strip()
    label = LABEL.fullmatch(text)
    if label:
        text = label[2]
    return any(kind.fullmatch(text) for kind in (NUMBER, COMMA, MOMENT))


def _filled(row: Sequence[str]) -> bool:
    """Return whether a row holds numbers: at least a third of its cells that are not missing."""
    cells = [cell for cell in row if cell.strip().lower() not in MISSING]
    return 3 * sum(map(is_value, cells)) >= max(len(cells), 1)


def _header(above: list[list[str]], count: int, separator: str) -> tuple[list[str], list[str]]:
    """Return the names and units in the lines above the first row."""
    lines = [[cell.strip() for cell in _bare(row, separator)] for row in above]
    # A row that ends with a separator has one cell more than its header.
    lines = [line for line in lines if len(line) in (count, count - 1) and not _is_rule(line)]
    if not lines:
        return [str(k + 1) for k in range(count)], []
    units: list[str] = []
    if len(lines) > 1 and all(UNIT.fullmatch(cell) for cell in lines[-1]) and _are_units(lines[-1]):
        units = lines.pop()
    names = lines[-1]
    return [*names, *([""] * (count - len(names)))], units


def _is_rule(cells: Sequence[str]) -> bool:
    """Return whether a line is no more than a rule between header and rows, or blank."""
    return all(set(cell) <= {"-", ":", "=", "+"} for cell in cells)


KNOWN_UNITS = frozenset(
    {"s", "ms", "us", "ns", "deg", "rad", "°", "a", "ma", "v", "rpm", "nm", "n m"}
)


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether a cell of a line is certainly a unit."""
    return any(cell.strip("[]() ").lower() in KNOWN_UNITS for cell in cells)


def _bare(row: list[str], separator: str) -> list[str]:
    """Return a line without the sign of a comment in front."""
    if not row or row[0][:1] not in ("#", "%"):
        return row
    first = row[0].lstrip("#% ")
    return [first, *row[1:]] if first or separator != " " else row[1:]
