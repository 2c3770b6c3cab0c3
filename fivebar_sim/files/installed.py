"""What other packages bring: classes that they name in an entry-point group."""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from fivebar_sim.errors import ConfigError


def installed(group: str, what: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name.

    Args:
        group: Name of the group.
        what: What they are, "controller", for the message.

    Raises:
        ConfigError: If two packages bring one of the same name.
    """
    found: dict[str, EntryPoint] = {}
    for entry in _read(tuple(_stamp(path) for path in sys.path)).select(group=group):
        if entry.name in found and found[entry.name].value != entry.value:
            raise ConfigError(
                f"two {what}s are called {entry.name!r}: {found[entry.name].value} and "
                f"{entry.value}; uninstall one"
            )
        found[entry.name] = entry
    return found


def load(entry: EntryPoint, what: str) -> Any:
    """Return what an entry point names.

    Raises:
        ConfigError: It cannot be imported.
    """
    try:
        return entry.load()
    except Exception as error:  # what an import runs may raise anything
        raise ConfigError(
            f"cannot load {what} {entry.name!r} from {entry.value}: {type(error).__name__}: {error}"
        ) from error


def _stamp(path: str) -> tuple[str, int]:
    """Return a folder of sys.path and when something in it was installed or removed last."""
    try:
        return path, os.stat(path or ".").st_mtime_ns
    except OSError:
        return path, 0


# Reading the metadata of every installed package takes longer than many a run, so it is read again
# only after one of the folders has changed.
@cache
def _read(stamps: tuple[tuple[str, int], ...]) -> Any:
    """Return the entry points of all groups, for folders in one state: something to `select` from.

    Python 3.12 has `EntryPoints` for that, Python 3.11 a class of its own.
    """
    del stamps  # what the cache goes by
    return entry_points()
