"""Run directories whose files were changed and that look as if they belonged together."""

from __future__ import annotations

from pathlib import Path

import pyarrow
import pyarrow.parquet

from fivebar_sim.metrics.columns import digest
from fivebar_sim.runs import checksums


def seal(place: Path) -> None:
    """Give the record of a run directory the checksums of what is there now.

    What stands behind the checksums is then reached. A record that is none stays as it is.
    """
    file = place / checksums.RECORD
    try:
        table = pyarrow.parquet.read_table(pyarrow.BufferReader(file.read_bytes()))
        columns = {name: table[name].to_numpy() for name in table.column_names}
        own = {checksums.RECORD: digest(columns)}
    except (OSError, ValueError, pyarrow.ArrowException):
        return

    names = [path.name for path in place.iterdir() if path.suffix in (".toml", ".json", ".csv")]
    sums = checksums.of_files(place, names) | own
    kept = table.schema.metadata or {}
    table = table.replace_schema_metadata({**kept, **checksums.written(sums)})
    pyarrow.parquet.write_table(table, file, write_page_checksum=True)
