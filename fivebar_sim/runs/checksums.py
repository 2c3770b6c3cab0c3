"""Checksums that tie the files of a run together: its record has those of all others, and its own.

They stand in the metadata of rollout.parquet, SHA-256 in hexadecimal by file name, so that a file
that was changed after the run, or is another run's, is noticed by whoever reads the run.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec

from fivebar_sim.arrays import Array
from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.files import input_file
from fivebar_sim.metrics.columns import digest

RECORD = "rollout.parquet"

KEY = b"fivebar_sim.sha256"
"""Where the metadata has them."""

Sums = Mapping[str, str]


def of_files(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the checksums of some files in a folder.

    Raises:
        OSError: A file is missing, cannot be read, or is too large for any file of a run.
    """
    return {name: _of_file(folder / name) for name in names}


def _of_file(file: Path) -> str:
    input_file.check(file, input_file.TABLE)
    return hashlib.sha256(file.read_bytes()).hexdigest()


def written(sums: Sums) -> dict[bytes, bytes]:
    """Return checksums as the metadata of Parquet."""
    return {KEY: json.dumps(sums).encode()}


def read(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Return the checksums that the metadata of Parquet has; none where it has no legal ones."""
    try:
        return msgspec.json.decode((metadata or {}).get(KEY, b"{}"), type=dict[str, str])
    except msgspec.DecodeError:
        return {}


def copies(folder: Path) -> set[str]:
    """Return the names of the CSVs that a run wrote into its directory, as its record has them."""
    import pyarrow
    import pyarrow.parquet

    try:
        with (folder / RECORD).open("rb") as file:
            sums = read(pyarrow.parquet.read_schema(file).metadata)
    except (OSError, pyarrow.ArrowException):
        return set()

    # They are going to be deleted: a record that somebody made must not name anything else.
    return {name for name in sums if name.endswith(".csv") and name == Path(name).name}


def check_files(folder: Path, sums: Sums) -> None:
    """Raise unless all files but the record are those that the run wrote.

    Args:
        folder: The run directory.
        sums: What the record says.

    Raises:
        RunDirectoryError: Names the file that does not belong to the run.
    """
    others = [name for name in sums if name != RECORD]
    wrong = [name for name in others if not _is(folder / name, sums[name])]
    if not wrong:
        return

    # One wrong file is more likely than two: then it is the record.
    if {"scenario.toml", "metrics.json"} <= set(wrong):
        raise RunDirectoryError(
            f"{folder / RECORD} is of another run than scenario.toml and metrics.json beside it: "
            "run scenario.toml again"
        )
    raise RunDirectoryError(_changed(folder / wrong[0]))


def check_record(file: Path, record: Mapping[str, Array], sums: Sums) -> None:
    """Raise unless a record is the one that the run wrote.

    Args:
        file: Its file.
        record: What it holds.
        sums: What it says of itself and of the other files.

    Raises:
        RunDirectoryError: It was changed, or says nothing.
    """
    if RECORD not in sums:
        raise RunDirectoryError(
            f"{file} has no checksums, so nobody can tell whether it belongs to this run: an older "
            "version wrote it, or it was changed; run scenario.toml again"
        )
    if digest(record) != sums[RECORD]:
        raise RunDirectoryError(_changed(file))


def _is(file: Path, wanted: str) -> bool:
    """Return whether a file is there and has a checksum.

    Raises:
        RunDirectoryError: It is there and cannot be read.
    """
    try:
        return _of_file(file) == wanted
    except FileNotFoundError:
        return False
    except OSError as error:
        raise RunDirectoryError(f"cannot read {file}: {error.strerror or error}") from None


def _changed(file: Path) -> str:
    if not file.exists():
        return f"{file} is missing: the run was made with it"
    return (
        f"{file} is not the run's: it was changed after the run, or is another run's; run "
        "scenario.toml again"
    )
