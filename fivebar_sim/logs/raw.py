"""A file of columns as it is, read block by block, so that its length costs no memory."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

if TYPE_CHECKING:
    import pyarrow as pa

Source = Path | bytes
"""A file, or all of one that was read before."""


class Block(NamedTuple):
    """Some rows that follow each other.

    Attributes:
        first: Number of the first one, counted from 1.
        cells: The cells of each column: texts, or numbers and times where the format has types.
    """

    first: int
    cells: dict[str, pa.Array]


class Raw(NamedTuple):
    """What is in a file.

    Attributes:
        what: The format in words: "CSV, semicolons, decimal commas".
        where: The file's name, for messages.
        names: The names of its columns, each once.
        units: The units that the file itself names, by column.
        decimal: The sign before the fraction of its texts' numbers: "." or ",".
        blocks: Yields some columns, block by block, in the file's order.
        remarks: What is odd; grows while blocks are read.
    """

    what: str
    where: str
    names: tuple[str, ...]
    units: dict[str, str]
    decimal: str
    blocks: Callable[[Sequence[str]], Iterator[Block]]
    remarks: list[str]


def stream(source: Source) -> BinaryIO:
    """Return a file, opened."""
    return io.BytesIO(source) if isinstance(source, bytes) else source.open("rb")


def unique(names: Sequence[str], remarks: list[str]) -> tuple[str, ...]:
    """Return names of which each is there once: the second "pos" becomes "pos (2)"."""
    found: list[str] = []
    for k, given in enumerate(names):
        # A table's index has no name, nor has what stands behind a last separator.
        name = given or ("index" if k == 0 else f"column {k + 1}")
        again = name
        count = 1
        while again in found:
            count += 1
            again = f"{name} ({count})"

        if count > 1:
            remarks.append(f"the name {name!r} is there twice: column {k + 1} is {again!r} here")
        found.append(again)
    return tuple(found)
