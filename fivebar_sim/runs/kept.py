"""What a user has put into a run directory: it outlives the run, and goes into the next one's."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Collection
from pathlib import Path

from fivebar_sim.runs import checksums

FILES = ("scenario.toml", "metrics.json", "rollout.parquet", "recording.rrd")
"""What a complete run directory holds."""

REPORT = "report.html"
"""The report of a run: of the old one it would be wrong beside the new one."""

DIVERGED = "diverged.txt"
"""Stands for a run that diverged, where a user's own files keep its directory."""

UNLINKED = {errno.EPERM, errno.EACCES, errno.ENOTSUP, errno.EXDEV, errno.EMLINK, errno.ENOSYS}
"""Errors of file systems that cannot give a file a second name."""


def own_names(path: Path) -> set[str]:
    """Return the names of a run's own files: `FILES`, its scenario's, its report, `DIVERGED`."""
    # Not those that its scenario.toml names: who has edited it may have named a file of their own.
    return {*FILES, *checksums.copies(path), REPORT, DIVERGED}


def keep(path: Path, stage: Path) -> None:
    """Put all that is not a run's own into the directory that will replace it.

    Every file is in both until the old directory is deleted, so it is never in neither; what the
    new run has written under the same name stays.

    Raises:
        FileNotFoundError: Another process has exchanged the directory meanwhile.
        OSError: Something there can be neither linked nor copied.
    """
    if path.is_dir():
        _link_all(path, stage, but=own_names(path))


def _link_all(path: Path, to: Path, but: Collection[str] = ()) -> None:
    """Give everything in a directory a second name in another one, folders and all."""
    for entry in path.iterdir():
        place = to / entry.name
        if entry.name in but:
            continue
        if entry.is_dir() and not entry.is_symlink():
            place.mkdir(exist_ok=True)
            _link_all(entry, place)
            shutil.copystat(entry, place)
        elif not os.path.lexists(place):
            _link(entry, place)


def _link(file: Path, place: Path) -> None:
    """Give a file, or a link, a second name; copy it where the file system has only one."""
    try:
        os.link(file, place, follow_symlinks=False)
    except OSError as error:
        if error.errno not in UNLINKED:
            raise
        shutil.copy2(file, place, follow_symlinks=False)
