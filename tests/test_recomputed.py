"""What every shipped scenario's run says, against its files read by another program's formulas."""

from __future__ import annotations

import ast
import io
from pathlib import Path
from typing import Any

import pytest
import recomputed
import recomputed_run
import shipped
from recomputed_run import Run
from rich.console import Console

from fivebar_sim.cli.console import print_result
from fivebar_sim.metrics.catalogue import shown

EQUAL = 1e-9
"""Relative, of a metric; works are compared as a part of all the energy turned over."""


@pytest.fixture(scope="module", params=shipped.NAMES)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("runs")
    return recomputed_run.read(shipped.written(request.param, folder))


def test_every_metric_is_what_the_record_says(run: Run) -> None:
    said = recomputed.measured(run)
    found = recomputed.recomputed(run)
    assert found.keys() == said.keys()  # a new metric is recomputed too, or named in UNRECORDED
    turnover = said["energy.turnover"]
    for key, value in said.items():
        scale = turnover if key.startswith("energy.") else None
        if key == "energy.imbalance":
            scale = 1.0  # it is a part of the turnover already
        assert differing(numbers(found[key]), numbers(value), scale) == [], key


def test_the_window_is_that_of_the_scenario(run: Run) -> None:
    path = run.scenario["path"]
    window = run.metrics["window"]
    scene = run.scenario["scene"]
    lands = isinstance(scene, dict) and scene.get("drop", 0.0) >= 1e-3
    assert window["begin"] == pytest.approx(0.0 if lands else path["ramp"], abs=1e-9)
    assert window["end"] <= run.scenario["duration"] * (1.0 + 1e-9)
    lasts = recomputed_run.period(run)
    if lasts is not None:
        periods = (window["end"] - window["begin"]) / lasts
        assert periods == pytest.approx(max(round(periods), 1), abs=run.h / lasts)
        assert window["end"] + lasts > run.scenario["duration"] - run.h


def test_a_landing_is_in_its_window() -> None:
    """The motor's peak is that of the impact, which the window had missed."""
    for name, peak in (("rail-landing", 1.1285), ("doggo-landing", 1.4451)):
        metrics = shipped.results()[name].metrics
        assert metrics["window"]["begin"] == 0.0
        assert metrics["load"]["torque_peak"]["A"] == pytest.approx(peak, rel=0.01)
        assert metrics["whole"]["torque_peak"]["A"] == metrics["load"]["torque_peak"]["A"]
        assert 0.09 < metrics["whole"]["at"]["torque_peak"]["A"] < 0.14


def test_tables_fit_80_columns_and_name_the_window() -> None:
    for name, result in shipped.results().items():
        console = Console(width=80, file=io.StringIO())
        print_result(result, [], "runs/here", console)
        assert isinstance(console.file, io.StringIO)
        told = console.file.getvalue()
        assert "\u2026" not in told, name
        window = result.metrics["window"]
        assert f"window {window['begin']:g} to {window['end']:g} s" in told
        peak = shown("whole.torque_peak.A", result.metrics["whole"]["torque_peak"]["A"])
        when = result.metrics["whole"]["at"]["torque_peak"]["A"]
        row = next(line for line in told.splitlines() if line.startswith(" torque A peak"))
        assert f"{peak.split()[0]} at {when:.4g} s" in row


def test_no_formula_is_borrowed() -> None:
    for file in Path(__file__).parent.glob("recomputed*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [each.name for each in node.names]
                module = getattr(node, "module", None)
                assert not any(str(n).startswith("fivebar") for n in [*names, module])


def numbers(value: Any) -> list[float | None]:
    """Return a metric, or the metrics of all bins, as a list."""
    each = value if isinstance(value, list) else [value]
    return [None if one is None else float(one) for one in each]


def differing(
    found: list[float | None], said: list[float | None], scale: float | None
) -> list[tuple[float | None, float | None]]:
    """Return the pairs that differ by more than `EQUAL` of a scale, or of their own size."""
    pairs = list(zip(found, said, strict=True))
    return [(a, b) for a, b in pairs if a != b and not near(a, b, scale)]


def near(a: float | None, b: float | None, scale: float | None) -> bool:
    # an undefined metric is near no number
    return a is not None and b is not None and abs(a - b) <= EQUAL * (scale or abs(b))
