"""The environment of the wheel alone: what it asks for is there, and nothing else."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "scripts" / "link_packages.py"
WHEEL = """Metadata-Version: 2.4
Name: fivebar-sim
Version: 1.0
Requires-Dist: attrs
Requires-Dist: pytest-cov; python_version < "3"
Requires-Dist: pytest[dev]; extra == "tests"
Requires-Dist: markdown-it-py
"""


def test_what_a_wheel_asks_for_is_linked_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / "fivebar_sim-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(WHEEL, encoding="utf-8")

    monkeypatch.setattr(sys, "argv", ["link_packages.py", str(tmp_path)])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    linked = {path.name for path in tmp_path.iterdir() if path.is_symlink()}
    modules = {name for name in linked if not name.endswith(".dist-info")}
    assert modules == {"attr", "attrs", "markdown_it", "mdurl"}  # the last through another
    assert (tmp_path / "mdurl" / "__init__.py").is_file()
