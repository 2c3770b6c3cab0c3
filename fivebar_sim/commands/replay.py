"""`fivebar replay`."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.errors import ConfigError


def replay(run_dir: Positional[Annotated[Path, arg(metavar="RUN_DIR")]], /) -> int:
    """Open the recording of a run in the Rerun viewer, on this machine only.

    Args:
        run_dir: A run directory that `fivebar run` wrote.
    """
    import subprocess

    from fivebar_sim import recording, run_directory

    run_directory.check_run(run_dir)
    command = recording.viewer_command(run_dir / "recording.rrd")
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        raise ConfigError(
            f"no screen here: neither DISPLAY nor WAYLAND_DISPLAY is set; open "
            f"{run_dir / 'recording.rrd'} with Rerun on a machine that has one"
        )
    quiet = {**os.environ, "CI": "true"}  # keeps Rerun's analytics off
    return subprocess.run(command, env=quiet).returncode
