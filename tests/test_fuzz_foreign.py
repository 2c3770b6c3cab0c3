"""Logs of real legs and models of other programs, damaged in any way: the law of fuzz.py."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable
from pathlib import Path

import fuzz_inputs as inputs
import pytest
from fuzz import Bench, Law, both_forms
from hypothesis import strategies as st
from shell import JUDGED

from fivebar_sim import cli

HERE = Path(__file__).parent
LOGS = {
    name: (HERE / "logs" / name).read_bytes()
    for name in (
        *("arduino_labels.txt", "dynamixel_wizard.csv", "excel_german.csv", "esp32_ms.csv"),
        *("labview.lvm", "leg.mcap", "lines.jsonl", "log.parquet", "pandas_datetime.csv"),
        *("plotjuggler.csv", "quoted.csv", "ros2_bag.csv", "units_row.csv", "log.csv.gz"),
    )
}
MODELS = {path.name: path.read_bytes() for path in (HERE / "sources").iterdir()}
COLUMNS = """
[log]
file = "log.csv"
time = "time"
theta_A = { column = "theta_A", unit = "rad", sign = 1, offset = 0.0 }
theta_E = "theta_E"
ctrl_A = "ctrl_A"
ctrl_E = "ctrl_E"
"""

Pair = tuple[str, bytes]


@pytest.fixture
def bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Bench:
    (tmp_path / "short.toml").write_text(JUDGED, encoding="utf-8")
    return Bench(tmp_path, monkeypatch, capfd)


def _put(bench: Bench, files: dict[str, bytes], damage: Pair) -> None:
    name, content = damage
    for each, whole in files.items():
        (bench.folder / each).write_bytes(content if each == name else whole)


def any_log(bench: Bench, damage: Pair) -> None:
    name, content = damage
    (bench.folder / name).write_bytes(content)
    bench.lawful("log", name)


@functools.cache
def parts() -> dict[str, bytes]:
    """Return a table of columns and the log that it is of, a simulated leg's."""
    with tempfile.TemporaryDirectory() as name:
        scenario = Path(name) / "short.toml"
        scenario.write_text(JUDGED, encoding="utf-8")
        out = Path(name) / "out"
        assert cli.main(["run", str(scenario), "--log", "csv", "--out", str(out), "--quiet"]) == 0
        return {"log.toml": COLUMNS.encode(), "log.csv": (out / "log.csv").read_bytes()}


def any_overlay(bench: Bench, damage: Pair | None) -> None:
    """Lay a log over the model; None is no damage."""
    _put(bench, parts(), damage or ("log.csv", parts()["log.csv"]))
    bench.lawful("compare", "short.toml", "log.toml")


def any_model(bench: Bench, damage: Pair) -> None:
    _put(bench, MODELS, damage)
    (bench.folder / "leg.toml").unlink(missing_ok=True)
    said = bench.lawful("import", damage[0], "--out", "leg.toml")
    assert (bench.folder / "leg.toml").exists() == (said.status == 0)


@st.composite
def damaged(draw: st.DrawFn, files: Callable[[], dict[str, bytes]], *ends: str) -> Pair:
    """Return one of some files, and what may be in it."""
    name = draw(st.sampled_from(sorted(n for n in files() if n.endswith(ends))))
    return name, draw(inputs.mutated(files()[name]))


QUOTED = ("quoted.csv", LOGS["quoted.csv"])
CHAIN = ("chain.xml", MODELS["chain.xml"])
LAWS = {
    "logs": Law(QUOTED, damaged(lambda: LOGS, ""), any_log, 9, 0.05),
    "overlays": Law(None, damaged(parts, ""), any_overlay, 4, 0.02),
    "models": Law(CHAIN, damaged(lambda: MODELS, ".xml", ".urdf"), any_model, 6, 0.03),
}


test_few_inputs_keep_the_law, test_many_inputs_keep_the_law = both_forms(LAWS)
