"""Check that Rerun can read a whole recording, as a separate program: some damage crashes it.

Usage: python -m fivebar_sim.recording.check RECORDING. Exit status 0 if it can be read. Rerun's own
messages about the damage help nobody; they go where the caller sends them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from contextlib import suppress
from pathlib import Path


def reads(path: Path) -> bool:
    """Return whether the installed Rerun reads a file, tried in another process.

    In this process a panic of the reader would end the whole program.
    """
    # -P: a rerun.py in the user's folder must not be imported for Rerun.
    command = [sys.executable, "-P", "-m", "fivebar_sim.recording.check", str(path)]
    nowhere = subprocess.DEVNULL
    return subprocess.call(command, stdin=nowhere, stdout=nowhere, stderr=nowhere) == 0


def read_through(path: Path) -> None:
    """Read a recording in this process.

    Raises:
        Exception: Any, if Rerun cannot read it.
    """
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        # A recording that was cut off has no footer, and the reader warns of that.
        warnings.simplefilter("ignore")
        reader = RrdReader(path)
        # The store opens only with a whole footer; the stream finds every other damage.
        reader.store()
        for chunk in reader.stream():
            del chunk


if __name__ == "__main__":
    # Windows has no module resource.
    with suppress(ImportError):
        import resource

        # A panic of the reader is expected here: it should not leave a core file.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Rerun sends no analytics in CI.
    os.environ["CI"] = "true"
    read_through(Path(sys.argv[1]))
