"""Where a sweep is kept: blocks of rows as they come, and one file when all are there.

However the program ends, what was written stays, and the same sweep goes on from there.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import input_file, parquet_file, tables, whole_file

if TYPE_CHECKING:
    import pyarrow as pa

RUNS = "runs.parquet"
"""The table of a whole sweep."""

STUDY = "sweep.json"
"""What the results depend on."""

BLOCKS = "blocks"
"""Folder of the blocks, until all are there."""

STAGED = ".fivebar-"
"""What the names of files begin with that are being written."""

WHAT = "the table of a sweep"
"""What `RUNS` is, for messages."""

GROUP = 10_000
"""Rows of the table that are read at once."""


class Store:
    """A sweep's directory.

    Args:
        place: The directory.
        depends: What the results depend on, as `study.fingerprint` gives it.
        count: Number of blocks.
        schema: The columns.

    Raises:
        ConfigError: Something else than this sweep is there, or it cannot be written.
    """

    def __init__(self, place: Path, depends: dict[str, Any], count: int, schema: pa.Schema) -> None:
        self.place = place
        self._count = count
        # What JSON makes of it, so that it equals what is read.
        self._depends = json.loads(json.dumps(depends))
        self._schema = schema.with_metadata({"sweep": json.dumps(depends, sort_keys=True)})
        self._check()

    @property
    def runs(self) -> Path:
        """The table of the whole sweep."""
        return self.place / RUNS

    @property
    def whole(self) -> bool:
        """Whether all rows are there."""
        return self.runs.is_file()

    def missing(self) -> Iterator[int]:
        """Yield the numbers of the blocks that are not there yet."""
        # Once, not once a block: the folder may be on a slow disk.
        found = {path.name for path in (self.place / BLOCKS).glob("*.parquet")}
        return (k for k in range(self._count) if self._name(k) not in found)

    @contextmanager
    def open(self) -> Iterator[None]:
        """Make the directory, and keep it for this program alone.

        Raises:
            ConfigError: It cannot be written, or another program sweeps there.
        """
        text = json.dumps(self._depends, indent=2) + "\n"
        if not (self.place / STUDY).is_file():
            whole_file.write(self.place / STUDY, text)
        with _alone(self.place):
            try:
                (self.place / BLOCKS).mkdir(exist_ok=True)
            except OSError as error:
                raise ConfigError(f"cannot write {self.place}: {error.strerror or error}") from None
            yield

    def add(self, number: int, rows: pa.Table) -> None:
        """Write a block, whole or not at all."""
        self._write(self.place / BLOCKS / self._name(number), [rows])

    def finish(self, sizes: Iterable[int]) -> None:
        """Write the table of all blocks, and delete them.

        Args:
            sizes: The rows of each block.

        Raises:
            ConfigError: A block is damaged.
        """
        blocks = (self._block(k, rows) for k, rows in enumerate(sizes))
        self._write(self.runs, _groups(blocks))
        self.tidy()

    def check_runs(self, count: int) -> None:
        """Raise unless the table of the whole sweep is there as it was written, by its columns.

        Args:
            count: Its rows.

        Raises:
            ConfigError: Says what is wrong with it.
        """
        with parquet_file.opened(self.runs, WHAT, ConfigError) as parquet:
            parquet_file.check_table(self.runs, parquet, self._schema, count, ConfigError)

    def _block(self, number: int, count: int) -> pa.Table:
        """Return the rows of a block."""
        path = self.place / BLOCKS / self._name(number)
        try:
            with parquet_file.opened(path, "a block of a sweep", ConfigError) as parquet:
                parquet_file.check_table(path, parquet, self._schema, count, ConfigError)
                return parquet.read()
        except ConfigError as error:
            raise ConfigError(
                f"{error}; delete that file, and the same command simulates its runs again"
            ) from None

    def tidy(self) -> None:
        """Delete what is only of use until all rows are there."""
        shutil.rmtree(self.place / BLOCKS, ignore_errors=True)
        # A program that was killed while it wrote leaves these.
        for left in self.place.glob(f"{STAGED}*"):
            left.unlink(missing_ok=True)

    def _name(self, number: int) -> str:
        return f"{number:08d}.parquet"

    def _write(self, path: Path, parts: Iterable[pa.Table]) -> None:
        import pyarrow.parquet as pq

        with (
            whole_file.stage(path) as place,
            pq.ParquetWriter(place, self._schema, write_page_checksum=True) as writer,
        ):
            for part in parts:
                writer.write_table(part, row_group_size=GROUP)

    def _check(self) -> None:
        """Raise unless the directory is free, or holds this sweep.

        Raises:
            ConfigError: Says what is there.
        """
        whole_file.check_parent(self.place, ConfigError)
        if not self.place.exists():
            return
        if not self.place.is_dir():
            raise ConfigError(f"cannot write {self.place}: something that is no directory is there")
        if not (self.place / STUDY).is_file():
            # A directory that the program made and could not write to before it was killed.
            if any(not path.name.startswith(STAGED) for path in self.place.iterdir()):
                raise ConfigError(f"{self.place} holds something else: choose another --out")
            return

        try:
            there = input_file.read_json(self.place / STUDY)
        except (OSError, ValueError):
            there = None
        if there != self._depends:
            raise ConfigError(
                f"{self.place} holds another sweep ({self._difference(there)}): choose another "
                "--out, or delete it"
            )

    def _difference(self, there: Any) -> str:
        """Return in what the sweep that is there differs."""
        if not isinstance(there, dict) or tables.is_deep(there):
            return f"its {STUDY} is damaged"
        names = {"vary": "its --vary", "sample": "its --sample", "seed": "its --seed"}

        for key, value in self._depends.items():
            if there.get(key) == value:
                continue
            if key == "scenario":
                return "of another scenario, or of its file before a change"
            if key in names:
                return f"{names[key]} was {_short(there.get(key))}"
            return f"of {key} {there.get(key)}, this is {value}"
        return "of another version"


@contextmanager
def _alone(place: Path) -> Iterator[None]:
    """Lock a directory; the system unlocks it however the program ends.

    Raises:
        ConfigError: Another program has locked it.
    """
    try:
        import fcntl
    # Windows has none; nobody warns of two sweeps in one place there.
    except ImportError:
        yield
        return

    handle = os.open(place, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        raise ConfigError(f"another program sweeps into {place} now: wait for it") from None
    finally:
        os.close(handle)


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else f"{text[:76]} ..."


def _groups(parts: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """Yield tables of `GROUP` rows, the last of fewer."""
    import pyarrow as pa

    kept: list[pa.Table] = []
    rows = 0
    for part in parts:
        kept.append(part)
        rows += part.num_rows
        while rows >= GROUP:
            joined = pa.concat_tables(kept).combine_chunks()
            yield joined.slice(0, GROUP)
            kept = [joined.slice(GROUP)]
            rows -= GROUP
    if rows:
        yield pa.concat_tables(kept).combine_chunks()
