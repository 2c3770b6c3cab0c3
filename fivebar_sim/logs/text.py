"""CSV and its kin: any separator, decimal commas, labels, comments, lines above the header."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any

from fivebar_sim.errors import ConfigError
from fivebar_sim.logs import dialect
from fivebar_sim.logs.dialect import LABEL, PRINTED, Dialect
from fivebar_sim.logs.raw import Block, Raw, Source, stream, unique

if TYPE_CHECKING:
    pass

LINES = 200
"""Lines by which the dialect is told."""

BLOCK = 1 << 20
"""Bytes that are read at once."""

ROWS = 20_000
"""Rows that are read at once where Python splits them."""

MOST_BAD = 0.01
"""Part of the rows that may have another number of cells: a serial line loses some."""

FEW = 3
"""Rows of which that may be so in any log: its first and its last are cut off now and then."""


def open_file(source: Source, where: str, head: bytes) -> Raw:
    """Return what is in a text file.

    Raises:
        ConfigError: No rows of numbers; says what stands there instead.
    """
    encoding, sample = _decoded(head)
    lines = sample.splitlines()
    whole = len(lines) == 1 or len(head) < 1 << 16
    lines = (lines if whole else lines[:-1])[:LINES]
    if not any(line.strip() for line in lines):
        raise ConfigError(f"{where} is empty: a log needs a header and rows")
    if sum(PRINTED.match(line) is not None for line in lines) > len(lines) // 2:
        raise ConfigError(
            f"{where}: each line begins with the serial monitor's clock and '-> ': switch "
            "\"Show timestamp\" off, or cut it off with sed 's/.*-> //'"
        )
    told = dialect.tell(lines)
    if told is None:
        raise ConfigError(
            f"{where}: no rows of numbers: a log needs a header and then rows, got {lines[0]!r:.60}"
        )

    remarks: list[str] = []
    names = unique(told.names, remarks)
    units = {name: unit for name, unit in zip(names, told.units, strict=False) if unit}
    mark = ", with a byte order mark" if head.startswith(b"\xef\xbb\xbf") else ""
    written = "" if encoding.startswith("utf-8") else f", {encoding}"
    first = f"; the first row is line {told.skip + 1}" if told.skip > 1 else ""
    kind = f"text: {told.words}{written}{mark}{first}"

    def blocks(wanted: Sequence[str]) -> Iterator[Block]:
        if told.labelled or told.separator == " ":
            yield from _by_line(source, told, encoding, names, wanted, remarks)
        else:
            yield from _by_arrow(source, where, told, encoding, names, wanted, remarks)

    return Raw(kind, where, names, units, told.decimal, blocks, remarks)


def _decoded(head: bytes) -> tuple[str, str]:
    """Return the encoding of a text file, and its beginning."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16", head.decode("utf-16", errors="ignore")
    try:
        # A letter may be cut at the end of the sample.
        whole = head if len(head) < 1 << 16 else head[: head.rindex(b"\n")]
        return "utf-8-sig", whole.decode("utf-8-sig")
    except ValueError:
        # What Windows writes in the west: a degree sign is no UTF-8.
        return "cp1252", head.decode("cp1252", errors="replace")


def _by_arrow(
    source: Source,
    where: str,
    told: Dialect,
    encoding: str,
    names: Sequence[str],
    wanted: Sequence[str],
    remarks: list[str],
) -> Iterator[Block]:
    """Yield columns of a file whose cells Arrow can tell apart."""
    import pyarrow
    from pyarrow import csv

    bad: list[tuple[int, int]] = []
    count = 0

    def handle(row: Any) -> str:
        # Blank lines are no rows.
        if row.text.strip():
            bad.append((row.actual_columns, row.number or 0))
        return "skip"

    with stream(source) as file:
        # Arrow drops the mark of UTF-8 by itself.
        plain = "utf8" if encoding == "utf-8-sig" else encoding
        try:
            reader = csv.open_csv(
                file,
                csv.ReadOptions(
                    use_threads=False,
                    block_size=BLOCK,
                    skip_rows=told.skip,
                    column_names=list(names),
                    encoding=plain,
                ),
                csv.ParseOptions(delimiter=told.separator, invalid_row_handler=handle),
                csv.ConvertOptions(
                    include_columns=list(wanted),
                    column_types={name: pyarrow.string() for name in wanted},
                    check_utf8=False,
                ),
            )
            for batch in reader:
                cells = dict(zip(wanted, batch.columns, strict=True))
                if batch.num_rows:
                    yield Block(count + 1, cells)
                count += batch.num_rows
        except pyarrow.ArrowInvalid as error:
            message = " ".join(str(error).split())
            raise ConfigError(f"{where} cannot be read as {told.words}: {message:.120}") from None
        except UnicodeDecodeError as error:
            raise ConfigError(
                f"{where} is no text: byte 0x{error.object[error.start]:02x} is neither UTF-8 nor "
                f"{encoding}"
            ) from None
    _say_bad(where, len(names), [came for came, _ in bad], count, remarks)


def _by_line(
    source: Source,
    told: Dialect,
    encoding: str,
    names: Sequence[str],
    wanted: Sequence[str],
    remarks: list[str],
) -> Iterator[Block]:
    """Yield columns of a file whose lines are split here."""
    import pyarrow

    places = [names.index(name) for name in wanted]
    bad: list[int] = []
    count = 0
    with io.TextIOWrapper(stream(source), encoding=encoding, errors="replace") as lines:
        for _ in islice(lines, told.skip):
            pass
        while chunk := list(islice(lines, ROWS)):
            rows = [_cells(line, told) for line in chunk]
            good = [row for row in rows if len(row) == len(names)]
            bad += [len(row) for row in rows if row and len(row) != len(names)]
            cells = {
                name: pyarrow.array([row[place] for row in good], pyarrow.string())
                for name, place in zip(wanted, places, strict=True)
            }
            if good:
                yield Block(count + 1, cells)
            count += len(good)
    _say_bad("", len(names), bad, count, remarks)


def _cells(line: str, told: Dialect) -> list[str]:
    """Return the cells of a line without their labels; none of a comment's."""
    if line.startswith(("#", "%")) or not line.strip():
        return []
    cells = dialect.split(line.rstrip("\r\n"), told.separator)
    if not told.labelled:
        return cells
    return [match[2] for cell in cells if (match := LABEL.fullmatch(cell))]


def _say_bad(where: str, due: int, bad: list[int], good: int, remarks: list[str]) -> None:
    """Remark on rows with another number of cells; refuse a file of which many are such."""
    if not bad:
        return
    said = f"{len(bad)} of {good + len(bad)} rows have another number of cells than {due}"
    if len(bad) > FEW and len(bad) > MOST_BAD * good:
        raise ConfigError(
            f"{where}: {said}, the first {bad[0]}: is a separator within a cell? put such in quotes"
        )
    remarks.append(f"{said} and are left out; the first has {bad[0]}")
