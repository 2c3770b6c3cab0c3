"""Parquet files that anything may have happened to: whatever is wrong is raised in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fivebar_sim.errors import FiveBarError
from fivebar_sim.files import input_file

if TYPE_CHECKING:
    from pyarrow import Schema
    from pyarrow.parquet import ParquetFile

LARGEST = 10_000_000_000
"""Largest Parquet file [bytes]: a sweep of ten million runs."""


@contextmanager
def opened(path: Path, what: str, raised: type[FiveBarError]) -> Iterator[ParquetFile]:
    """Open a Parquet file; its pages are checked where they have checksums.

    Args:
        path: The file.
        what: What it should be, as "a record".
        raised: The class of the error.

    Raises:
        FiveBarError: It cannot be read, is no Parquet, or is damaged where it is read within.
    """
    import pyarrow
    import pyarrow.parquet

    try:
        input_file.check(path, LARGEST)
        # Given a name instead of a file, pyarrow would expand ~ and read it as a URI.
        with path.open("rb") as stream:
            yield pyarrow.parquet.ParquetFile(stream, page_checksum_verification=True)
    # Some of them are OSErrors too.
    except FiveBarError:
        raise
    except (OSError, pyarrow.ArrowException) as error:
        if isinstance(error, OSError) and error.strerror:
            raise raised(f"cannot read {path}: {error.strerror}") from None
        # pyarrow's messages may run over several lines.
        message = " ".join(str(error).split())
        raise raised(f"{path} is not {what}, or is damaged: {message}") from None


def check_table(
    path: Path, parquet: ParquetFile, schema: Schema, rows: int, raised: type[FiveBarError]
) -> None:
    """Raise unless a table has the columns and rows that it was written with.

    Before its rows are read: some megabytes can hold a thousand times as much.

    Args:
        path: The file, for the message.
        parquet: The table.
        schema: Its columns.
        rows: Its rows.
        raised: The class of the error.
    """
    there = parquet.schema_arrow
    for field in schema:
        if there.names.count(field.name) != 1 or there.field(field.name).type != field.type:
            raise raised(f"{path} was changed: the column {field.name} must be {field.type}, once")
    if len(there.names) > len(schema.names):
        more = next(name for name in there.names if name not in schema.names)
        raise raised(f"{path} was changed: it has the column {more!r}, which is none of its own")
    count = parquet.metadata.num_rows
    if count != rows:
        raise raised(f"{path} was changed: it must have {rows} rows, got {count}")
