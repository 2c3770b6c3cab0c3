"""`fivebar replay`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import NO_PATHS, Paths
from fivebar_sim.errors import ConfigError
from fivebar_sim.render import screen

RunDir = Positional[Annotated[Path, arg(metavar="RUN_DIR")]]
RunDirs = Positional[Annotated[Paths, arg(metavar="[RUN_DIR ...]")]]


def replay(
    run_dir: RunDir, others: RunDirs = NO_PATHS, /, *, web: bool = False, port: int = 0
) -> int:
    """Open the recordings of runs in the Rerun viewer, on this machine.

    Args:
        run_dir: A run directory that `fivebar run` wrote.
        others: More run directories, overlaid on the first in other colours.
        web: Serve the recording to a browser on this machine until Ctrl-C; open no window.
        port: Port of --web; 0 takes any free port.
    """
    run_dirs = (run_dir, *others)
    if web:
        return _serve(run_dirs, port)
    if port:
        raise ConfigError(f"--port needs --web, got --port {port} alone")
    return _show(run_dirs)


def _show(run_dirs: tuple[Path, ...]) -> int:
    """Show the recording in the native viewer until its window is closed."""
    import subprocess

    from fivebar_sim.recording import viewer
    from fivebar_sim.runs import recording_file

    with recording_file.opened(run_dirs) as file:
        command = viewer.native_command(file)
        shown = f"`fivebar replay {' '.join(map(str, run_dirs))} --web` shows it in a browser"
        screen.check(shown)
        return subprocess.run(command, env=viewer.quiet_environment()).returncode


def _serve(run_dirs: tuple[Path, ...], port: int) -> int:
    """Serve the recording to browsers until Ctrl-C, which is the normal end: status 0."""
    from fivebar_sim.cli import signals
    from fivebar_sim.recording import web
    from fivebar_sim.runs import recording_file

    title = " + ".join(recording_file.labels_of(run_dirs))
    try:
        with web.Server(port) as server:
            with recording_file.opened(run_dirs) as file:
                server.pages = web.pages(file, title)
            print(f"{title}: {server.url} (Ctrl-C ends it)", flush=True)  # noqa: T201
            server.serve_forever()
    except KeyboardInterrupt:
        # Here Ctrl-C is a wish that was met: `listen` must not raise it once more.
        signals.acknowledge()

    return 0
