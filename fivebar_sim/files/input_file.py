"""What may be read as an input: regular files of a reasonable size, so that no reading hangs."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

TEXT = 10_000_000
"""Upper end of a TOML or JSON file [bytes]."""

TABLE = 200_000_000
"""Upper end of a CSV [bytes]: several rows for every step of the longest run."""


def check(path: Path, most: int) -> None:
    """Raise unless path is a regular file of at most `most` bytes.

    Raises:
        OSError: As opening it would, or that it is a device or a pipe, or too large.
    """
    status = path.stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is no regular file")
    if status.st_size > most:
        size = f"{status.st_size / 1e6:.4g} MB"
        raise OSError(errno.EFBIG, f"it must have at most {most / 1e6:g} MB, got {size}")
