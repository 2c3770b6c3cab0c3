"""What takes long is made once for all processes of a run of the tests, not once in each."""

from __future__ import annotations

import fcntl
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

folders: list[Path] = []
"""The folder that the processes share; empty where there is only one process."""


def once(name: str, make: Callable[[], T]) -> T:
    """Return what is made, by whichever process comes first; the others wait for it.

    Args:
        name: A file's name, which nothing else has.
        make: Makes it; its answer is pickled.
    """
    if not folders:
        return make()

    file = folders[0] / name
    with file.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not file.exists():
            made = make()
            partial = file.with_suffix(".partial")
            partial.write_bytes(pickle.dumps(made))
            partial.rename(file)  # a process that is killed leaves no half of it
            return made
    return pickle.loads(file.read_bytes())
