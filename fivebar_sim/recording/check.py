"""Check that Rerun can read a whole recording, as a separate program: some damage crashes it.

Usage: python -m fivebar_sim.recording.check RECORDING [RUN]. Exit status 0 if it can be read and,
where a run is given, is that run's. Rerun's own messages about the damage help nobody; they go
where the caller sends them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from types import ModuleType

PROPERTY = "run"
"""The property that says which run a recording is of; it has one column, `sha256`."""


def reads(path: Path, run: str | None = None) -> bool:
    """Return whether the installed Rerun reads a recording, tried in another process.

    In this process a panic of the reader would end the whole program.

    Args:
        path: The recording.
        run: What identifies the run whose recording it must be, see `identity`; None for any.
    """
    # -P: a rerun.py in the user's folder must not be imported for Rerun.
    command = [sys.executable, "-P", "-m", "fivebar_sim.recording.check", str(path)]
    if run is not None:
        command.append(run)

    nowhere = subprocess.DEVNULL
    return subprocess.call(command, stdin=nowhere, stdout=nowhere, stderr=nowhere) == 0


def read_through(path: Path) -> str | None:
    """Read a recording in this process; return which run it is of, None if it does not say.

    Raises:
        Exception: Any, if Rerun cannot read it.
    """
    # What rerun.chunk is made of, without all of Rerun: a sixth of the time to start.
    from rerun_bindings import RrdReaderInternal

    run = None

    with warnings.catch_warnings():
        # A recording that was cut off has no footer, and the reader warns of that.
        warnings.simplefilter("ignore")
        reader = RrdReaderInternal(str(path))
        # The store opens only with a whole footer; the stream finds every other damage.
        reader.store(store=None)
        for chunk in reader.stream(store=None):
            if chunk.entity_path == f"/__properties/{PROPERTY}":
                run = chunk.to_record_batch()["sha256"].to_pylist()[0][0]
    return run


if __name__ == "__main__":
    # Windows has no module resource.
    with suppress(ImportError):
        import resource

        # A panic of the reader is expected here: it should not leave a core file.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Rerun sends no analytics in CI.
    os.environ["CI"] = "true"
    # To raise an error the reader imports all of Rerun, which takes longer than everything else
    # here. What it finds is no package: another error, which will do as well.
    sys.modules["rerun"] = ModuleType("rerun")
    found = read_through(Path(sys.argv[1]))
    sys.exit(sys.argv[2:] not in ([], [found]))
