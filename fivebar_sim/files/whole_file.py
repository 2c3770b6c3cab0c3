"""Files that are written whole or not at all: into a temporary file beside, then renamed.

Text that is not UTF-8 is written with backslashes.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fivebar_sim.errors import ConfigError, FiveBarError


def check_place(path: Path) -> None:
    """Raise unless a file can be written at path, as far as the system can tell beforehand.

    Raises:
        ConfigError: No file can be made there, or something other than a file is there.
    """
    try:
        _check_free(path)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from None
    check_parent(path, ConfigError)


def check_parent(path: Path, error: type[FiveBarError]) -> None:
    """Raise unless a file or directory can be made at path; missing folders above it count.

    Args:
        path: What is to be written.
        error: The class of error that is raised.
    """
    try:
        there = next((p for p in path.absolute().parents if p.exists()), path)
    except OSError as cause:
        raise error(f"cannot write {path}: {cause.strerror or cause}") from None
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        raise error(f"cannot write {path}: {there} is not a directory one may write in")


def _check_free(path: Path) -> None:
    """Raise if a directory or a device is there, which a file must not replace."""
    if path.is_dir():
        raise ConfigError(f"cannot write {path}: a directory is there")
    # The rename would remove a device such as /dev/null.
    if path.exists() and not path.is_file():
        raise ConfigError(f"cannot write {path}: something that is not a file is there")


@contextmanager
def stage(path: Path) -> Iterator[Path]:
    """Give a temporary path beside a file; it is renamed to the file if no error occurs.

    Raises:
        ConfigError: The file cannot be written.
    """
    try:
        _check_free(path)
        # Beside the target, on one file system: only there is a rename atomic.
        handle, name = tempfile.mkstemp(prefix=".fivebar-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        place = Path(name)
        try:
            yield place
            # mkstemp makes files that only their owner can read.
            place.chmod(0o644)
            place.replace(path)
        finally:
            place.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from None


def write(path: Path, content: str | bytes) -> None:
    """Write a file atomically; missing folders are made.

    Raises:
        ConfigError: The file cannot be written.
    """
    data = content if isinstance(content, bytes) else content.encode(errors="backslashreplace")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from None
    with stage(path) as place:
        place.write_bytes(data)


def append(path: Path, text: str) -> None:
    """Append text to a file; a missing file or folder is made.

    Raises:
        ConfigError: The file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab") as file:
            file.write(text.encode(errors="backslashreplace"))
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from None
