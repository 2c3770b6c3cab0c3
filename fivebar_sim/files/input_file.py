"""Input files: only regular files of a reasonable size are read, so that no read can hang."""

from __future__ import annotations

import errno
import json
import os
import stat
from pathlib import Path
from typing import Any

TEXT = 10_000_000
"""Largest TOML or JSON file [bytes]."""

TABLE = 200_000_000
"""Largest CSV [bytes]: several rows for every step of the longest run."""


def check(path: Path, most: int) -> None:
    """Raise unless path is a regular file of at most `most` bytes.

    Raises:
        OSError: The file cannot be opened, is a device or a pipe, or is too large.
    """
    # stat, not open: opening a pipe waits for its writer, and /dev/zero never ends.
    status = path.stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is not a regular file")
    if status.st_size > most:
        size = f"{status.st_size / 1e6:.4g} MB"
        raise OSError(errno.EFBIG, f"it must have at most {most / 1e6:g} MB, got {size}")


def read_json(path: Path) -> Any:
    """Return what a JSON file holds.

    Raises:
        OSError: As `check`, or it cannot be read.
        ValueError: It is not JSON, is nested too deep, or has a key twice: which one counts would
            not be clear.
    """
    check(path, TEXT)
    text = path.read_text(encoding="utf-8")
    try:
        return json.loads(text, object_pairs_hook=_object)
    # Where that is, and in which words Python says it, differs from release to release.
    except RecursionError:
        raise ValueError("nested too deep") from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice!r:.60} is there twice")
    return table
