"""Two directories exchanged in one step, so that there is never a moment without either."""

from __future__ import annotations

import errno
import os
from pathlib import Path

AT_FDCWD = -100
RENAME_EXCHANGE = 2
"""Constants of Linux, from fcntl.h and linux/fs.h."""

MISSING = {errno.ENOSYS, errno.EINVAL, errno.ENOTSUP}
"""Errors of systems, and of file systems, that exchange nothing."""


def exchange(one: Path, other: Path) -> bool:
    """Exchange what is at two places; return whether the system can.

    Raises:
        OSError: It can, but not here: one of them is gone.
    """
    import ctypes

    # glibc 2.28 and musl 1.2.3 have it, and no other system does.
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    paths = [os.fsencode(one), os.fsencode(other)]
    if rename(AT_FDCWD, paths[0], AT_FDCWD, paths[1], RENAME_EXCHANGE) == 0:
        return True

    error = ctypes.get_errno()
    if error in MISSING:
        return False
    raise OSError(error, os.strerror(error))


def flush(folder: Path) -> None:
    """Wait until a directory and the files right in it are on the disk."""
    for path in (*folder.iterdir(), folder):
        if path.is_symlink() or not (path.is_file() or path == folder):
            continue
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
