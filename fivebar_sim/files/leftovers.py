"""What a killed program leaves beside a run directory: found and deleted by the next one there."""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

OLD = 60.0
"""Age from which what nobody holds is left over [s]; it is held within a moment."""


@contextmanager
def held(stage: Path) -> Iterator[None]:
    """Hold a directory that is written to; the system lets go of it however the program ends."""
    try:
        import fcntl
    except ImportError:  # Windows has none, and nothing is swept there
        yield
        return

    handle = os.open(stage, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def sweep(path: Path) -> None:
    """Delete what is left over of earlier runs to path: hidden, beside it, old, and not held."""
    name = re.compile(rf"\.{re.escape(path.name)}\.[a-z0-9_]{{8}}\.(partial|old)")
    with suppress(OSError):  # it is no matter if one cannot look
        for found in path.parent.iterdir():
            if name.fullmatch(found.name) and _left_over(found):
                shutil.rmtree(found, ignore_errors=True)


def _left_over(found: Path) -> bool:
    """Return whether a directory is old, and not held by who writes to it."""
    try:
        import fcntl
    except ImportError:
        return False

    try:
        if found.is_symlink() or time.time() - found.stat().st_mtime < OLD:
            return False
        handle = os.open(found, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return False

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(handle)
    return True
