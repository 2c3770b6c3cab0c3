"""How the runs of a sweep ended."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import parquet_file
from fivebar_sim.sweep.store import WHAT


class Summary(NamedTuple):
    """How the runs ended.

    Attributes:
        verdicts: How many runs have each verdict.
        refused: How many points could not be run.
        error: Why the first of these could not; None if all could.
    """

    verdicts: dict[str, int]
    refused: int
    error: str | None

    def __str__(self) -> str:
        """Return "40 pass, 12 fail, 10 could not be run (the first: ...)"."""
        parts = [f"{count} {verdict}" for verdict, count in self.verdicts.items()]
        if self.refused:
            parts.append(f"{self.refused} could not be run (the first: {self.error})")
        return ", ".join(parts)


def summary(runs: Path) -> Summary:
    """Return how the runs in a sweep's table ended.

    Raises:
        ConfigError: The table is damaged.
    """
    counts: Counter[str | None] = Counter()
    error: str | None = None
    # Block by block: a large sweep does not fit in memory.
    with parquet_file.opened(runs, WHAT, ConfigError) as parquet:
        for batch in parquet.iter_batches(columns=["verdict", "error"]):
            counts.update(batch.column("verdict").to_pylist())
            if error is None:
                error = next((e for e in batch.column("error").to_pylist() if e is not None), None)
    refused = counts.pop(None, 0)
    verdicts = {str(verdict): counts[verdict] for verdict in sorted(counts, key=str)}
    return Summary(verdicts, refused, error)
