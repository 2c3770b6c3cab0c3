"""`fivebar replay`: what it starts, what it serves, how it ends, and what it refuses."""

from __future__ import annotations

import errno
import http.client
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from shell import ELLIPSE, Shell, started

from fivebar_sim import rollout
from fivebar_sim.recording.check import read_through
from fivebar_sim.scenario import Scenario

PROGRAM = "import sys; from fivebar_sim.cli import main; sys.exit(main())"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the run directory of a short run."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "short.toml").write_text(ELLIPSE, encoding="utf-8")
    return rollout.run(Scenario.load(folder / "short.toml")).write(folder / "mine")


@pytest.fixture
def recorded(shell: Shell, written: Path) -> Shell:
    """Return a shell in whose folder there are two runs."""
    for name in ("mine", "other"):
        shutil.copytree(written, shell.folder / name)
    return shell


def test_replay_of_no_run_is_one_line(shell: Shell) -> None:
    lacks = "it lacks scenario.toml, metrics.json, rollout.parquet, recording.rrd"
    for flags in ((), ("--web",)):
        assert shell.refused("replay", ".", *flags) == f". is not a run directory: {lacks}"
        assert (
            shell.refused("replay", "no", *flags) == "no is not a run directory: no such directory"
        )
    assert "File name too long" in shell.refused("replay", "x" * 300)
    twice = "run directories must be different, got no twice"
    assert shell.refused("replay", "no", "no") == twice
    assert shell.refused("replay", "no", "no", "--web") == twice


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a screen is always there")
def test_replay_without_a_screen_is_one_line(
    recorded: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    for runs in ("mine", "mine other"):
        said = recorded.refused("replay", *runs.split())
        assert said.startswith("no screen here: neither DISPLAY nor WAYLAND_DISPLAY is set; ")
        assert f"`fivebar replay {runs} --web`" in said


@pytest.mark.parametrize("runs", [["mine"], ["mine", "other"]])
def test_replay_starts_the_viewer_on_loopback(
    recorded: Shell, monkeypatch: pytest.MonkeyPatch, runs: list[str]
) -> None:
    started: list[list[str]] = []

    def pretend(command: list[str], env: dict[str, str]) -> subprocess.CompletedProcess[bytes]:
        started.append(command)
        assert env["CI"] == "true"
        read_through(Path(command[-1]))
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(subprocess, "run", pretend)
    before = recorded.names()
    assert recorded("replay", *runs).status == 0
    ((_, *arguments),) = started
    assert arguments[:2] == ["--bind", "127.0.0.1"]
    own = arguments[-1] == str(recorded.folder / "mine" / "recording.rrd")
    assert own == (runs == ["mine"])
    assert Path(arguments[-1]).exists() == own
    assert recorded.names() == before


def test_port_is_refused_where_it_is_of_no_use(recorded: Shell) -> None:
    assert recorded.refused("replay", "mine", "--port", "8000") == (
        "--port needs --web, got --port 8000 alone"
    )
    said = recorded.refused("replay", "mine", "--web", "--port", "70000")
    assert said == "--port must be in [0, 65535], got 70000"
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        said = recorded.refused("replay", "mine", "--web", "--port", str(port))
    assert said == f"--port must be free, got {port}: {os.strerror(errno.EADDRINUSE)}"


@pytest.mark.parametrize(
    ("runs", "number", "status"),
    [(["mine", "other"], signal.SIGINT, 0), (["mine"], signal.SIGTERM, 143)],
)
def test_web_serves_until_it_is_ended_and_leaves_nothing(
    recorded: Shell, tmp_path: Path, runs: list[str], number: signal.Signals, status: int
) -> None:
    (tmp_path / "temporary").mkdir()
    before = recorded.names()
    server = started(
        [sys.executable, "-c", PROGRAM, "replay", *runs, "--web"],
        text=True,
        env=os.environ | {"TMPDIR": str(tmp_path / "temporary")},
    )
    try:
        assert server.stdout is not None
        line = server.stdout.readline()
        title = re.escape(" + ".join(runs))
        found = re.fullmatch(rf"{title}: http://127\.0\.0\.1:(\d+)/ \(Ctrl-C ends it\)\n", line)
        assert found
        connection = http.client.HTTPConnection("127.0.0.1", int(found[1]), timeout=10)
        connection.request("GET", "/recording.rrd")
        (tmp_path / "served.rrd").write_bytes(connection.getresponse().read())
        read_through(tmp_path / "served.rrd")
        server.send_signal(number)
        out, err = server.communicate(timeout=30)
        assert (server.returncode, out, err) == (status, "", "")
    finally:
        server.kill()
        server.communicate()
    assert recorded.names() == before | {"served.rrd"}
