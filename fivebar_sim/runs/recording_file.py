"""The recording of runs as a file to open: rebuilt where the installed Rerun cannot read it."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fivebar_sim.errors import ConfigError
from fivebar_sim.recording import check, rrd
from fivebar_sim.runs import stored

RECORDING = "recording.rrd"


@contextmanager
def opened(paths: Sequence[Path]) -> Iterator[Path]:
    """Give the recording of a run directory, or of several over each other, while it is needed.

    That of one is its own recording.rrd: rebuilt from the record where it is missing, damaged, or
    of another Rerun, and kept if it can be. Every other is a temporary file that is removed.

    Args:
        paths: Run directories, at least one, all different.

    Raises:
        RunDirectoryError: One is no run directory, or cannot be read.
        ConfigError: One was given twice.
        OSError: No temporary file can be written.
    """
    labels = called(paths)
    runs = [stored.read(path) for path in paths]
    with tempfile.TemporaryDirectory(prefix="fivebar-") as folder:
        if len(runs) == 1:
            yield _own(runs[0], Path(folder))
            return
        file = Path(folder) / RECORDING
        rrd.write(file, runs, labels)
        yield file


def called(paths: Sequence[Path]) -> list[str]:
    """Return what runs are called beside each other: as their directories, or by their paths.

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
    """Return a recording of one run that can be read: its own, or one in the folder."""
    own = run.path / RECORDING
    if readable(own):
        return own

    try:
        handle, name = tempfile.mkstemp(prefix=f".{RECORDING}.", suffix=".partial", dir=run.path)
    except OSError:  # a directory that one may not write in
        file = folder / RECORDING
        rrd.write(file, [run])
        return file

    os.close(handle)
    beside = Path(name)
    try:
        rrd.write(beside, [run])
        beside.chmod(0o644)
        beside.replace(own)
    finally:
        beside.unlink(missing_ok=True)

    return own


def readable(path: Path) -> bool:
    """Return whether the installed Rerun reads a recording, to its end.

    One of a newer Rerun counts as unreadable: what it cannot read of that it skips with a warning.
    """
    return path.is_file() and not newer(path) and check.reads(path)


def newer(path: Path) -> bool:
    """Return whether a recording is of a newer Rerun than the installed one.

    Its first eight bytes are RRF2, then major, minor, patch, and what was before the release.
    """
    import rerun

    with path.open("rb") as file:
        head = file.read(8)
    here = [int(part) for part in re.findall(r"\d+", rerun.__version__)[:3]]
    return list(head[4:7]) > here
