"""Parquet as a log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fivebar_sim.errors import ConfigError
from fivebar_sim.logs.raw import Block, Raw, Source, stream

ROWS = 65_536
"""Rows that are read at once."""


def open_file(source: Source, where: str) -> Raw:
    """Return what is in a Parquet file.

    Raises:
        ConfigError: It is damaged.
    """
    import pyarrow
    from pyarrow import parquet

    def failed(error: Exception) -> ConfigError:
        return ConfigError(f"{where} is damaged: {' '.join(str(error).split()):.120}")

    try:
        with stream(source) as file:
            schema = parquet.ParquetFile(file).schema_arrow
    except (pyarrow.ArrowException, OSError) as error:
        raise failed(error) from None

    def blocks(wanted: Sequence[str]) -> Iterator[Block]:
        count = 0
        try:
            with stream(source) as file:
                batches = parquet.ParquetFile(file).iter_batches(ROWS, columns=list(wanted))
                for batch in batches:
                    cells = {name: batch.column(name) for name in wanted}
                    yield Block(count + 1, cells)
                    count += batch.num_rows
        except (pyarrow.ArrowException, OSError) as error:
            raise failed(error) from None

    return Raw("Parquet", where, tuple(schema.names), {}, ".", blocks, [])
