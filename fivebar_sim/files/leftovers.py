"""Leftovers of a killed program beside a run directory; the next run there deletes them."""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

OLD = 60.0
"""Age beyond which an unlocked stage is a leftover [s]: a new one is locked within a moment."""


@contextmanager
def held(stage: Path) -> Iterator[None]:
    """Lock a directory while it is written; the system unlocks it however the program ends."""
    try:
        import fcntl
    # Windows has no fcntl; `sweep` deletes nothing there either.
    except ImportError:
        yield
        return

    handle = os.open(stage, os.O_RDONLY)
    try:
        # Some file systems have no locks; the age alone protects the directory there.
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def sweep(path: Path) -> None:
    """Delete the leftovers of earlier runs to path: hidden, beside it, old, and not locked."""
    name = re.compile(rf"\.{re.escape(path.name)}\.[a-z0-9_]{{8}}\.(partial|old)")
    # Tidying up is a courtesy: a folder that cannot be listed must not stop a run.
    with suppress(OSError):
        for found in path.parent.iterdir():
            if name.fullmatch(found.name) and _left_over(found):
                shutil.rmtree(found, ignore_errors=True)


def _left_over(found: Path) -> bool:
    """Return whether a directory is old, and not locked by the program that writes it."""
    try:
        import fcntl
    except ImportError:
        return False

    try:
        # A link could lead anywhere; only directories made here are deleted.
        if found.is_symlink() or time.time() - found.stat().st_mtime < OLD:
            return False
        handle = os.open(found, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return False

    try:
        # Only whoever still writes holds the lock, and it outlives no process.
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(handle)
    return True
