"""JSON lines: an object a line, nested ones by dotted names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any

import msgspec

from fivebar_sim.errors import ConfigError
from fivebar_sim.logs.raw import Block, Raw, Source, stream

ROWS = 20_000
"""Rows that are read at once."""

FIRST = 100
"""Rows whose keys are the columns."""


def open_file(source: Source, where: str, head: bytes) -> Raw:
    """Return what is in a file of JSON lines.

    Raises:
        ConfigError: A line is not an object.
    """
    if head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"["):
        raise ConfigError(
            f"{where} is one JSON array: write an object a line, `jq -c '.[]' FILE > log.jsonl`"
        )
    names: dict[str, None] = {}
    with stream(source) as file:
        for number, line in enumerate(islice(file, FIRST), start=1):
            names |= dict.fromkeys(_row(line, where, number))

    def blocks(wanted: Sequence[str]) -> Iterator[Block]:
        import pyarrow

        with stream(source) as lines:
            count = 0
            while chunk := list(islice(lines, ROWS)):
                rows = [
                    _row(line, where, number) for number, line in enumerate(chunk, start=count + 1)
                ]
                # As texts, so that numbers and texts of numbers are read alike.
                cells = {
                    name: pyarrow.array([_text(row.get(name)) for row in rows], pyarrow.string())
                    for name in wanted
                }
                yield Block(count + 1, cells)
                count += len(chunk)

    return Raw("JSON lines", where, tuple(names), {}, ".", blocks, [])


def _row(line: bytes, where: str, number: int) -> dict[str, Any]:
    """Return the values of a line by their dotted names."""
    bare = line.removeprefix(b"\xef\xbb\xbf").strip()
    if not bare:
        return {}
    try:
        value = msgspec.json.decode(bare)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise ConfigError(f"{where}, line {number}: not JSON: {error}") from None
    if not isinstance(value, dict):
        raise ConfigError(f"{where}, line {number}: must be an object, got {bare[:40]!r}")
    return dict(flat(value))


def flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in objects and arrays by dotted names: "position.0"."""
    if isinstance(value, dict):
        parts = value.items()
    elif isinstance(value, list):
        parts = enumerate(value)
    else:
        yield name, value
        return
    for key, part in parts:
        yield from flat(part, f"{name}.{key}" if name else str(key))


def _text(value: Any) -> str | None:
    return None if value is None else str(value)
