"""The recording of runs as a file to open: rebuilt where the installed Rerun cannot read it."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from fivebar_sim.errors import ConfigError
from fivebar_sim.recording import check
from fivebar_sim.runs import recorded, stored
from fivebar_sim.simulation.provenance import identity

RECORDING = "recording.rrd"


@contextmanager
def opened(paths: Sequence[Path]) -> Iterator[Path]:
    """Yield the recording of a run directory, or of several drawn over each other.

    For one run it is the directory's own recording.rrd: rebuilt from the record if it is missing,
    damaged, another run's, or written by another Rerun, and saved there if possible. For several it
    is a temporary file, removed afterwards.

    Args:
        paths: Run directories, at least one, all different.

    Raises:
        RunDirectoryError: One is not a run directory, or cannot be read.
        ConfigError: One was given twice.
        OSError: No temporary file can be written.
    """
    labels = labels_of(paths)
    runs = [stored.read(path) for path in paths]
    with tempfile.TemporaryDirectory(prefix="fivebar-") as folder:
        if len(runs) == 1:
            yield _own(runs[0], Path(folder))
            return
        file = Path(folder) / RECORDING
        recorded.write(file, runs, labels)
        yield file


def labels_of(paths: Sequence[Path]) -> list[str]:
    """Return a label for each run: its directory's name, or its path if two names are the same.

    Raises:
        ConfigError: One was given twice.
    """
    places = [path.resolve() for path in paths]
    for place, path in zip(places, paths, strict=True):
        if places.count(place) > 1:
            raise ConfigError(f"run directories must be different, got {path} twice")
    names = [place.name for place in places]
    return names if len(set(names)) == len(names) else [str(place) for place in places]


def _own(run: stored.StoredRun, folder: Path) -> Path:
    """Return a readable recording of one run: its own, or a new one in the folder."""
    own = run.path / RECORDING
    whose = identity(run)
    if is_readable(own, whose):
        return own

    try:
        handle, name = tempfile.mkstemp(prefix=f".{RECORDING}.", suffix=".partial", dir=run.path)
    except OSError:
        # The run lies where the user may not write: the recording then lasts as long as its viewer.
        file = folder / RECORDING
        recorded.write(file, [run], identities=[whose])
        return file

    # Written beside and renamed, so that an interrupt never leaves half a recording.
    os.close(handle)
    beside = Path(name)
    try:
        recorded.write(beside, [run], identities=[whose])
        beside.chmod(0o644)
        beside.replace(own)
    finally:
        beside.unlink(missing_ok=True)

    return own


def is_readable(path: Path, run: str | None = None) -> bool:
    """Return whether the installed Rerun can read a recording to its end.

    A recording of a newer Rerun counts as unreadable: Rerun skips what it does not know there, with
    a warning.

    Args:
        path: The recording.
        run: What identifies the run whose recording it must be, see `identity`; None for any.
    """
    return path.is_file() and may_be_read(path) and check.reads(path, run)


def may_be_read(path: Path) -> bool:
    """Return whether a header is that of a recording of the installed Rerun or an older one.

    Starting another process to read anything else takes most of a second.
    """
    with path.open("rb") as file:
        head = file.read(8)
    # The header is b"RRF2", then major, minor and patch as one byte each, and one of pre-releases.
    if head[:4] != b"RRF2":
        return False
    here = [int(part) for part in re.findall(r"\d+", version("rerun-sdk"))[:3]]
    return list(head[4:7]) <= here
