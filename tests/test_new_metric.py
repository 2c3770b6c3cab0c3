"""A new metric is a row and a function: those of docs/how-to/add-a-metric.md, in a copy."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
KEY = "tracking.percentile_95"
LABEL = "tracking 95 %"
SCENARIO = """
name = "mine"
duration = 0.8
[path]
kind = "ellipse"
centre = [0.0, -0.072]
radii = [0.02, 0.008]
frequency = 4.0
ramp = 0.1
[limits]
tracking.percentile_95 = {limit}
"""
Program = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def fivebar(tmp_path: Path) -> Program:
    """Return the command `fivebar` of a copy of the package that has the page's metric."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "fivebar_sim", tmp_path / "fivebar_sim", ignore=ignored)
    for name in ("models", "scenarios", "controllers"):
        (tmp_path / name).symlink_to(ROOT / name)

    page = (ROOT / "docs/how-to/add-a-metric.md").read_text()
    function, row = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    tracking = tmp_path / "fivebar_sim/metrics/tracking.py"
    tracking.write_text(f"{tracking.read_text()}\n\n{function}")
    catalogue = tmp_path / "fivebar_sim/metrics/catalogue.py"
    before, begin, after = catalogue.read_text().partition("CATALOGUE = (\n")
    catalogue.write_text(f"{before}{begin}{row},\n{after}")

    def program(*args: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "fivebar_sim", *args],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(tmp_path), "COLUMNS": "80"},
            capture_output=True,
            text=True,
            check=False,
        )

    return program


def test_a_row_and_a_function_are_all(fivebar: Program, tmp_path: Path) -> None:
    """Console, report, recording, baseline, limit and JUnit have the metric."""
    scenario = tmp_path / "mine.toml"
    scenario.write_text(SCENARIO.format(limit=0.02))

    ran = fivebar("run", "mine.toml", "--out", "run")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert re.search(rf"{LABEL} +[\d.]+ mm +<= 20 mm +pass", ran.stdout)

    metrics = json.loads((tmp_path / "run/metrics.json").read_text())
    tracked = metrics["tracking"]
    assert tracked["rms"] < tracked["percentile_95"] < tracked["max"]
    assert LABEL.encode() in (tmp_path / "run/recording.rrd").read_bytes()

    assert fivebar("report", "run").returncode == 0
    assert LABEL in (tmp_path / "run/report.html").read_text()

    checked = fivebar("check", "mine.toml", "--update", "--junit", "junit.xml")
    assert checked.returncode == 0
    assert f'name="{KEY}"' in (tmp_path / "junit.xml").read_text()
    baseline = tmp_path / "baselines/mine.json"
    recorded = json.loads(baseline.read_text())["metrics"][KEY]
    assert recorded["value"] == pytest.approx(tracked["percentile_95"], rel=1e-5)

    # neither a broken limit nor a better value passes unseen
    scenario.write_text(SCENARIO.format(limit=1e-6))
    failed = fivebar("check", "mine.toml")
    assert failed.returncode == 1
    assert f"FAIL: mine: {LABEL}: " in failed.stdout
    scenario.write_text(SCENARIO.format(limit=0.02))
    baseline.write_text(baseline.read_text().replace(str(recorded["value"]), "0.5"))
    assert f"better than its baseline: {LABEL}" in fivebar("check", "mine.toml").stdout
