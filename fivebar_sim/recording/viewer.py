"""Rerun's viewer, as its wheel brings it: the native one, and the files of the one for browsers."""

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
"""How long the files of the web viewer may take [s]; they take about one."""


class ViewerMissingError(FiveBarError, FileNotFoundError):
    """The installed Rerun has no viewer binary, or it gives no web viewer."""


def quiet() -> dict[str, str]:
    """Return this process's environment with Rerun's analytics off."""
    return {**os.environ, "CI": "true"}


def binary() -> Path:
    """Return the viewer's binary.

    The `rerun` script on the PATH is a wrapper that outlives its viewer or dies without it.

    Raises:
        ViewerMissingError: The installation lacks the binary.
    """
    spec = importlib.util.find_spec("rerun_cli")
    folders = [Path(folder) for folder in (spec and spec.submodule_search_locations) or []]
    for folder in folders:
        for name in ("Rerun.app/Contents/MacOS/Rerun", "rerun", "rerun.exe"):
            if (folder / name).is_file():
                return folder / name
    raise ViewerMissingError(
        f"the viewer's binary is missing from rerun-sdk: no 'rerun' in {folders or 'rerun_cli'}"
    )


def native(path: Path) -> list[str]:
    """Return the command that opens a recording in a new native viewer, reachable from here only.

    Rerun's viewer also serves, by default to the whole network; it binds the loopback only when
    its command line says so.

    Raises:
        ViewerMissingError: The installation lacks the binary.
    """
    return [str(binary()), "--bind", LOOPBACK, "--port", "auto", str(path.resolve())]


def web_files() -> dict[str, bytes]:
    """Return the files of the web viewer, by their names in `WEB_FILES`.

    They are inside the binary, which hands them out over HTTP and no other way: it is started on
    a free loopback port, asked, and ended. It is given an address to show, which it does not look
    at, because without one it would also start a server for recordings.

    Raises:
        ViewerMissingError: The installation lacks the binary, or it does not give the files.
    """
    command = [str(binary()), "--serve-web", "--bind", LOOPBACK, "--web-viewer-port", "0"]
    source = subprocess.Popen(
        [*command, f"http://{LOOPBACK}:1/none.rrd"],
        env=quiet(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    late = threading.Timer(PATIENCE, source.kill)
    late.start()

    try:
        port = _port(source)
        return {name: _fetched(port, name) for name in WEB_FILES}
    except (OSError, http.client.HTTPException) as error:
        raise ViewerMissingError(f"Rerun gives no web viewer: {error}") from None
    finally:
        late.cancel()
        source.kill()
        source.communicate()


def _port(source: subprocess.Popen[bytes]) -> int:
    """Return the port that a started web viewer says it is at."""
    assert source.stdout is not None
    said = b""
    for line in source.stdout:
        found = re.search(rb"web-viewer at http://127\.0\.0\.1:(\d+)", line)
        if found:
            return int(found[1])
        said = line
    raise OSError(said.decode(errors="replace").strip() or "it ended without a word")


def _fetched(port: int, name: str) -> bytes:
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
