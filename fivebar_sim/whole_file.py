"""Text files in UTF-8: written whole or not at all, or appended to.

A path in them that is no UTF-8 is told with backslashes.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from fivebar_sim.errors import ConfigError


def write(path: Path, text: str) -> None:
    """Write a text beside its place, then rename it; its folder is made.

    Raises:
        ConfigError: The place cannot be written.
    """
    try:
        if path.exists() and not path.is_file():  # a device would be renamed away
            raise ConfigError(f"cannot write {path}: something that is no file is there")
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".fivebar-", suffix=".partial", dir=path.parent)
        stage = Path(name)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(text.encode(errors="backslashreplace"))
            stage.chmod(0o644)
            stage.replace(path)
        finally:
            stage.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror or error}") from None


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
