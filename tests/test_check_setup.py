"""The check of the set-up: which Pythons it takes, and what it counts as a difference."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def check_setup() -> ModuleType:
    spec = importlib.util.spec_from_file_location("check_setup", ROOT / "scripts/check_setup.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def program(path: Path, lines: str) -> str:
    """Write a shell script; return its path."""
    path.write_text(f"#!/bin/sh\n{lines}\n", encoding="utf-8")
    path.chmod(0o755)
    return str(path)


def test_python_that_does_not_start_is_left_out(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    check_setup: ModuleType,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As a version manager leaves them on the PATH, for Pythons that are not chosen."""
    works = program(tmp_path / "python3.11", f'exec "{sys.executable}" "$@"')
    fails = program(tmp_path / "python3.12", "echo 'pyenv: not found' >&2; exit 127")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert check_setup.pythons() == [works]
    assert capsys.readouterr().out == f"{fails} is left out: pyenv: not found\n"


def test_every_difference_from_the_locks_is_seen(check_setup: ModuleType) -> None:
    locked = {"numpy": "2.4", "rich": "15.0", "typing-extensions": "4.1"}
    same = "numpy==2.4 rich==15.0 typing_extensions==4.1 pip==23.0 setuptools==65"
    assert check_setup.difference(same, locked) == []
    other = "numpy==2.5 rich==15.0 odd==1 Typing.Extensions==4.1"
    assert check_setup.difference(other, locked) == [
        "numpy: locked 2.4, installed 2.5",
        "odd: locked None, installed 1",
    ]
    fewer = "numpy==2.4 rich==15.0"
    assert check_setup.difference(fewer, locked) == [
        "typing-extensions: locked 4.1, installed None"
    ]
