"""Rerun's viewer from its wheel: the native program, and the files of the web viewer."""

from __future__ import annotations

import http.client
import importlib.util
import os
import re
import subprocess
import threading
from pathlib import Path

from fivebar_sim.errors import FiveBarError

LOOPBACK = "127.0.0.1"
WEB_FILES = ("re_viewer.js", "re_viewer_bg.wasm", "favicon.ico")
PATIENCE = 60.0
"""How long fetching the files of the web viewer may take [s]; it takes about one."""


class ViewerMissingError(FiveBarError, FileNotFoundError):
    """The installed Rerun has no viewer binary, or it gives no web viewer."""


def quiet_environment() -> dict[str, str]:
    """Return this process's environment with Rerun's analytics switched off."""
    # Rerun sends none in CI.
    return {**os.environ, "CI": "true"}


def binary() -> Path:
    """Return the path of the viewer's binary.

    Raises:
        ViewerMissingError: The installation lacks the binary.
    """
    # Not the `rerun` script on the PATH: that wrapper outlives its viewer, or dies without it.
    spec = importlib.util.find_spec("rerun_cli")
    folders = [Path(folder) for folder in (spec and spec.submodule_search_locations) or []]
    for folder in folders:
        for name in ("Rerun.app/Contents/MacOS/Rerun", "rerun", "rerun.exe"):
            if (folder / name).is_file():
                return folder / name
    raise ViewerMissingError(
        f"the viewer's binary is missing from rerun-sdk: no 'rerun' in {folders or 'rerun_cli'}"
    )


def native_command(path: Path) -> list[str]:
    """Return the command that opens a recording in a new native viewer.

    Raises:
        ViewerMissingError: The installation lacks the binary.
    """
    # The viewer also serves recordings, by default to the whole network: bind it to this machine.
    return [str(binary()), "--bind", LOOPBACK, "--port", "auto", str(path.resolve())]


def web_files() -> dict[str, bytes]:
    """Return the files of the web viewer, by their names in `WEB_FILES`.

    They are inside the binary, which gives them out only over HTTP: it is started on a free
    loopback port, asked for them, and ended.

    Raises:
        ViewerMissingError: The installation lacks the binary, or it does not give the files.
    """
    command = [str(binary()), "--serve-web", "--bind", LOOPBACK, "--web-viewer-port", "0"]
    # Without an address to show it would start a server for recordings too; it never opens this.
    source = subprocess.Popen(
        [*command, f"http://{LOOPBACK}:1/none.rrd"],
        env=quiet_environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    # Reading a pipe has no time limit; killing the program ends it.
    late = threading.Timer(PATIENCE, source.kill)
    late.start()

    try:
        port = _port(source)
        return {name: _fetch(port, name) for name in WEB_FILES}
    except (OSError, http.client.HTTPException) as error:
        raise ViewerMissingError(f"Rerun gives no web viewer: {error}") from None
    finally:
        late.cancel()
        source.kill()
        source.communicate()


def _port(source: subprocess.Popen[bytes]) -> int:
    """Return the port that a started web viewer prints."""
    assert source.stdout is not None
    last = b""
    for line in source.stdout:
        found = re.search(rb"web-viewer at http://127\.0\.0\.1:(\d+)", line)
        if found:
            return int(found[1])
        last = line
    # What it printed last is the likeliest reason.
    raise OSError(last.decode(errors="replace").strip() or "it ended without a message")


def _fetch(port: int, name: str) -> bytes:
    """Return a file of the web viewer."""
    connection = http.client.HTTPConnection(LOOPBACK, port, timeout=PATIENCE)
    try:
        connection.request("GET", f"/{name}")
        answer = connection.getresponse()
        if answer.status != http.HTTPStatus.OK:
            raise OSError(f"{name}: {answer.status} {answer.reason}")
        return answer.read()
    finally:
        connection.close()
