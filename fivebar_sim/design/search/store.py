"""The directory of a search: blocks of evaluated designs while it goes on, one table at its end.

DIR/task.toml          the task
DIR/state.json         what the directory belongs to, and whether the search is finished; then the
                       checksum of the front, too
DIR/blocks/K.parquet   the K-th block, written whole or not at all; gone at the end
DIR/designs.parquet    every evaluated design        DIR/front.parquet   the front
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from fivebar_sim.design.evaluation.evaluate import Evaluated, columns
from fivebar_sim.design.evaluation.measures import limits
from fivebar_sim.design.search.front import Front
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import ConfigError, RunDirectoryError
from fivebar_sim.files import input_file, parquet_file, whole_file

STATE = "state.json"
DESIGNS = "designs.parquet"
FRONT = "front.parquet"
TASK = "task.toml"
FEASIBLE = "feasible"
ROW = "row"
"""Column of front.parquet: which row of designs.parquet it is."""


class Store:
    """What is kept of a search.

    Args:
        task: The task.
        folder: The directory; made if it is missing.

    Raises:
        RunDirectoryError: Something else is there, or it cannot be written.
    """

    def __init__(self, task: Task, folder: Path) -> None:
        self.task = task
        self.folder = folder
        self.fingerprint = fingerprint(task)
        self.finished = False
        self._checksum = ""
        self._open()

    def _open(self) -> None:
        """Find what is there, or begin."""
        state = self.folder / STATE
        if state.is_file():
            known = _state(state)
            if known.get("fingerprint") != self.fingerprint:
                raise RunDirectoryError(
                    f"{self.folder} holds the search of another task, or of another version of "
                    "this one; name another directory with --out"
                )
            self.finished = bool(known.get("finished"))
            self._checksum = known.get("front", "")
            return

        if self.folder.exists() and (not self.folder.is_dir() or _others(self.folder)):
            raise RunDirectoryError(f"{self.folder} is there, and is no directory of a search")
        whole_file.check_parent(self.folder, RunDirectoryError)
        # First of all: a search that is killed before the next line must find itself again.
        self._write_state()
        whole_file.write(self.folder / TASK, Path(self.task.where).read_bytes())

    def _write_state(self) -> None:
        state: dict[str, Any] = {"fingerprint": self.fingerprint, "finished": self.finished}
        if self.finished:
            state["front"] = self._checksum
        whole_file.write(self.folder / STATE, json.dumps(state, indent=2) + "\n")

    def path(self, number: int) -> Path:
        """Return the file of a block."""
        return self.folder / "blocks" / f"{number:06d}.parquet"

    def read(self, number: int) -> Evaluated | None:
        """Return a block that was kept; None if it was not, or is unreadable."""
        path = self.path(number)
        if not path.is_file():
            return None
        try:
            with parquet_file.opened(path, "a block of designs", RunDirectoryError) as parquet:
                # As many rows as it has: whether they are those asked for is seen afterwards.
                rows = parquet.metadata.num_rows
                parquet_file.check_table(path, parquet, self._schema(), rows, RunDirectoryError)
                return self._evaluated(parquet.read())
        # A disk that lost a part of it: it is evaluated again.
        except RunDirectoryError:
            return None

    def write(self, number: int, block: Evaluated) -> None:
        """Keep a block."""
        import pyarrow.parquet as pq

        folder = self.path(number).parent
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise RunDirectoryError(f"cannot write {folder}: {error.strerror or error}") from None
        with whole_file.stage(self.path(number)) as place:
            pq.write_table(self._table(block), place, write_page_checksum=True)

    def stored(self, count: int) -> Iterator[Evaluated]:
        """Yield the first blocks."""
        for number in range(count):
            block = self.read(number)
            if block is None:
                raise RunDirectoryError(f"{self.path(number)} is missing or damaged")
            yield block

    def close(self, blocks: int, front: Front, *, finished: bool) -> None:
        """Write the tables of all designs and of the front; the blocks go if it is finished."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        with whole_file.stage(self.folder / DESIGNS) as place:
            with pq.ParquetWriter(place, self._schema()) as writer:
                for block in self.stored(blocks):
                    writer.write_table(self._table(block))

        table = self._table(front.designs).append_column(ROW, pa.array(front.rows, pa.int64()))
        with whole_file.stage(self.folder / FRONT) as place:
            pq.write_table(table, place)
        if finished:
            self.finished = True
            self._checksum = _checksum(self.folder / FRONT)
            self._write_state()
            shutil.rmtree(self.folder / "blocks", ignore_errors=True)

    def read_front(self) -> Front:
        """Return the front of a finished search.

        Raises:
            RunDirectoryError: It is not the one that the search wrote.
        """
        file = self.folder / FRONT
        if _checksum(file) != self._checksum:
            raise RunDirectoryError(
                f"{file} is damaged, or was changed after the search: delete {self.folder}, and "
                "the same command searches again"
            )
        with parquet_file.opened(file, "the front of a search", RunDirectoryError) as parquet:
            table = parquet.read()
        return Front(table.column(ROW).to_numpy(), self._evaluated(table))

    def _schema(self) -> Any:
        """Return the columns of all tables, as an Arrow schema."""
        import pyarrow as pa

        told = [each._asdict() for each in columns(self.task)]
        numbers = [(each["name"], pa.float64()) for each in told]
        schema = pa.schema([*numbers, (FEASIBLE, pa.bool_())])
        return schema.with_metadata({"fivebar.columns": json.dumps(told)})

    def _table(self, block: Evaluated) -> Any:
        """Return a block as an Arrow table."""
        import pyarrow as pa

        numbers = np.concatenate([block.values, block.objectives, block.measures], axis=1)
        arrays = [pa.array(np.ascontiguousarray(column)) for column in numbers.T]
        return pa.table([*arrays, pa.array(block.feasible)], schema=self._schema())

    def _evaluated(self, table: Any) -> Evaluated:
        """Return what an Arrow table holds."""
        names = [each.name for each in columns(self.task)]
        numbers = np.stack([table.column(name).to_numpy() for name in names], axis=1)
        d = len(self.task.names)
        m = d + len(self.task.objectives)
        bounds = limits(self.task, spare=self.task.search.spare)
        broken = [each.violation(numbers[:, m + k]) for k, each in enumerate(bounds)]
        violations = np.stack(broken, axis=1)
        return Evaluated(numbers[:, :d], numbers[:, d:m], numbers[:, m:], violations)


def _checksum(file: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal; "" if it cannot be read."""
    try:
        input_file.check(file, input_file.TABLE)
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError:
        return ""


def _others(folder: Path) -> bool:
    """Return whether a folder holds anything but what a killed program left half written."""
    return any(not path.name.startswith(".fivebar-") for path in folder.iterdir())


def fingerprint(task: Task) -> str:
    """Return a digest of all that a search depends on: the task, its files and the version."""
    digest = hashlib.sha256(json.dumps(task.table, sort_keys=True).encode())
    digest.update(version("fivebar-sim").encode())
    digest.update(repr((task.leg, task.servos)).encode())
    for motion in task.motions:
        for part in (motion.path, motion.force):
            digest.update(getattr(part, "content", b""))
    return digest.hexdigest()


def _state(path: Path) -> dict[str, Any]:
    try:
        state = input_file.read_json(path)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: not a state of a search: {error}") from None
    return state if isinstance(state, dict) else {}
