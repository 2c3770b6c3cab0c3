"""A new metric is a row and a function: those of docs/how-to/add-a-metric.md, in a copy."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from shell import Said

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
Program = Callable[[str], Said]
COMMANDS = """
import contextlib, io, json, sys
from fivebar_sim import cli
from fivebar_sim.report import single
single.figures = lambda run: []  # what it draws says nothing of the metric
for command in sys.stdin:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = cli.main(command.split())
    print(json.dumps([status, out.getvalue(), err.getvalue()]), flush=True)
"""
"""A program that calls a command a line, since each by itself would import everything anew."""


@pytest.fixture
def fivebar(tmp_path: Path, quick_start: None) -> Iterator[Program]:
    """Yield what calls commands of a copy of the package that has the page's metric."""
    # With its bytecode, which holds while a file keeps its time: else all of it is compiled.
    shutil.copytree(ROOT / "fivebar_sim", tmp_path / "fivebar_sim")
    for name in ("models", "scenarios", "controllers"):
        (tmp_path / name).symlink_to(ROOT / name)

    page = (ROOT / "docs/how-to/add-a-metric.md").read_text()
    function, row = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    tracking = tmp_path / "fivebar_sim/metrics/tracking.py"
    tracking.write_text(f"{tracking.read_text()}\n\n{function}")
    catalogue = tmp_path / "fivebar_sim/metrics/catalogue.py"
    before, begin, after = catalogue.read_text().partition("CATALOGUE = (\n")
    catalogue.write_text(f"{before}{begin}{row},\n{after}")

    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    with subprocess.Popen(
        [sys.executable, "-c", COMMANDS],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path, "COLUMNS": "80"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin
        assert process.stdout
        asked = process.stdin
        said = process.stdout

        def program(command: str) -> Said:
            print(command, file=asked, flush=True)
            return Said(*json.loads(said.readline()))

        yield program


def test_a_row_and_a_function_are_all(fivebar: Program, tmp_path: Path) -> None:
    """Console, report, recording, baseline, limit and JUnit have the metric."""
    scenario = tmp_path / "mine.toml"
    scenario.write_text(SCENARIO.format(limit=0.02))

    ran = fivebar("run mine.toml --out run")
    assert (ran.status, ran.err) == (0, "")
    assert re.search(rf"{LABEL} +[\d.]+ mm +<= 20 mm +pass", ran.out)

    metrics = json.loads((tmp_path / "run/metrics.json").read_text())
    tracked = metrics["tracking"]
    assert tracked["rms"] < tracked["percentile_95"] < tracked["max"]
    assert LABEL.encode() in (tmp_path / "run/recording.rrd").read_bytes()

    assert fivebar("report run").status == 0
    assert LABEL in (tmp_path / "run/report.html").read_text()

    assert fivebar("check mine.toml --update --junit junit.xml").status == 0
    assert f'name="{KEY}"' in (tmp_path / "junit.xml").read_text()
    baseline = tmp_path / "baselines/mine.json"
    recorded = json.loads(baseline.read_text())["metrics"][KEY]
    assert recorded["value"] == pytest.approx(tracked["percentile_95"], rel=1e-5)

    # neither a broken limit nor a better value passes unseen
    (tmp_path / "strict.toml").write_text(SCENARIO.format(limit=1e-6))
    baseline.write_text(baseline.read_text().replace(str(recorded["value"]), "0.5"))
    failed = fivebar("check strict.toml")
    assert failed.status == 1
    assert f"FAIL: mine: {LABEL}: " in failed.out
    assert f"better than its baseline: {LABEL}" in fivebar("check mine.toml").out
