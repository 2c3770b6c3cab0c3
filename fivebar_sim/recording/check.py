"""Whether Rerun reads a recording, to its end: a program of its own, since some damage ends it.

Usage: python -m fivebar_sim.recording.check RECORDING. Exit status 0 if it can be read; what Rerun
and its reader say of the damage is of no use to anybody, and goes where the caller sends it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from contextlib import suppress
from pathlib import Path


def reads(path: Path) -> bool:
    """Return whether the installed Rerun reads a file, asked of another process.

    In this one a panic of the reader would be the end of everything.
    """
    command = [sys.executable, "-P", "-m", "fivebar_sim.recording.check", str(path)]
    nowhere = subprocess.DEVNULL
    return subprocess.call(command, stdin=nowhere, stdout=nowhere, stderr=nowhere) == 0


def read_through(path: Path) -> None:
    """Read a recording, in this process.

    The store opens only with a whole footer, and the stream meets every other damage.

    Raises:
        Exception: Any, where Rerun cannot read it.
    """
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there is no footer
        reader = RrdReader(path)
        reader.store()
        for chunk in reader.stream():
            del chunk


if __name__ == "__main__":
    with suppress(ImportError):  # Windows has none
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a panic leaves no core file
    os.environ["CI"] = "true"  # no analytics
    read_through(Path(sys.argv[1]))
