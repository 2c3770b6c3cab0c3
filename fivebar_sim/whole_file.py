"""Files that are written whole or not at all: beside their place first, then renamed to it.

A path in a text that is no UTF-8 is told with backslashes.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fivebar_sim.errors import ConfigError


@contextmanager
def beside(path: Path) -> Iterator[Path]:
    """Give a place beside a file to write to; it is renamed to the file if all goes well.

    Raises:
        ConfigError: The file cannot be written.
    """
    try:
        if path.is_dir():
            raise ConfigError(f"cannot write {path}: a directory is there")
        if path.exists() and not path.is_file():  # a device would be renamed away
            raise ConfigError(f"cannot write {path}: something that is no file is there")
        handle, name = tempfile.mkstemp(prefix=".fivebar-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        stage = Path(name)
        try:
            yield stage
            stage.chmod(0o644)
            stage.replace(path)
        finally:
            stage.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from None


def write(path: Path, content: str | bytes) -> None:
    """Write a whole file; its folder is made.

    Raises:
        ConfigError: The file cannot be written.
    """
    data = content if isinstance(content, bytes) else content.encode(errors="backslashreplace")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from None
    with beside(path) as stage:
        stage.write_bytes(data)


def append(path: Path, text: str) -> None:
    """Append a text to a file, which is made if it is not there, and so is its folder.

    Raises:
        ConfigError: The place cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab") as file:
            file.write(text.encode(errors="backslashreplace"))
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from None
