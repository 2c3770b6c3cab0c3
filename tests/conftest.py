"""Fixtures of all tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shell import CSV, ELLIPSE, Shell


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20240607)


@pytest.fixture
def shell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Shell:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(ELLIPSE, encoding="utf-8")
    (tmp_path / "foot.csv").write_text(CSV, encoding="utf-8")
    return Shell(tmp_path, capsys)
