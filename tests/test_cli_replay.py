"""`fivebar replay`: what it starts, and what it refuses."""

from __future__ import annotations

import subprocess
import sys

import pytest
from shell import Shell


def test_replay_of_no_run_is_one_line(shell: Shell) -> None:
    lacks = "it lacks scenario.toml, metrics.json, rollout.parquet, recording.rrd"
    assert shell.refused("replay", ".") == f". is no run directory: {lacks}"
    assert shell.refused("replay", "no") == "no is no run directory: no such directory"
    assert "File name too long" in shell.refused("replay", "x" * 300)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a screen is always there")
def test_replay_without_a_screen_is_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    assert shell("run", "short.toml", "--out", "mine", "--quiet").status == 0
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert shell.refused("replay", "mine").startswith("no screen here: neither DISPLAY nor")


def test_replay_starts_the_viewer_on_loopback(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert shell("run", "short.toml", "--out", "mine", "--quiet").status == 0
    started: list[list[str]] = []

    def pretend(command: list[str], env: dict[str, str]) -> subprocess.CompletedProcess[bytes]:
        started.append(command)
        assert env["CI"] == "true"
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(subprocess, "run", pretend)
    assert shell("replay", "mine").status == 0
    ((_, *arguments),) = started
    assert arguments[:2] == ["--bind", "127.0.0.1"]
    assert arguments[-1].endswith("mine/recording.rrd")
