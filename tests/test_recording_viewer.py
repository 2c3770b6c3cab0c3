"""Rerun's viewer: its binary, bound to the loopback, and the files of the web viewer."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from fivebar_sim.errors import FiveBarError
from fivebar_sim.recording import viewer


def test_viewer_is_the_binary_and_binds_the_loopback(tmp_path: Path) -> None:
    command = viewer.native_command(tmp_path / "a.rrd")
    assert command[-1] == str((tmp_path / "a.rrd").resolve())
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    shown = subprocess.run([command[0], "--help"], capture_output=True, text=True, check=True)
    for flag in (word for word in command if word.startswith("--")):
        assert flag in shown.stdout


def test_missing_viewer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(viewer.ViewerMissingError, match="rerun_cli") as caught:
        viewer.native_command(Path("a.rrd"))
    assert isinstance(caught.value, FiveBarError)
    assert isinstance(caught.value, FileNotFoundError)


def test_web_files_are_taken_over_the_loopback_and_the_source_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def start(command: list[str], **kwargs: object) -> subprocess.Popen[bytes]:
        assert command[command.index("--bind") + 1] == "127.0.0.1"
        started.append(popen(command, **kwargs))  # pyright: ignore[reportArgumentType, reportCallIssue]
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    files = viewer.web_files()
    assert files["re_viewer_bg.wasm"][:4] == b"\0asm"
    assert b"wasm_bindgen" in files["re_viewer.js"]
    assert [source.returncode is not None for source in started] == [True]


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("echo no web viewer in here", "no web viewer in here"),
        ("true", "it ended without a message"),
        ("echo web-viewer at http://127.0.0.1:1", "refused"),
    ],
)
def test_a_binary_without_a_web_viewer_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, said: str
) -> None:
    binary = tmp_path / "rerun"
    binary.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    binary.chmod(0o755)
    monkeypatch.setattr(viewer, "binary", lambda: binary)
    with pytest.raises(viewer.ViewerMissingError, match=said):
        viewer.web_files()
