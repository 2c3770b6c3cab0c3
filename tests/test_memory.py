"""How much memory a run takes: so much a step, and of many runs no more than of one."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from shell import Shell

from fivebar_sim import rollout
from fivebar_sim.cli import common
from fivebar_sim.metrics.columns import COLUMNS
from fivebar_sim.recording import rrd
from fivebar_sim.recording.plots import Series
from fivebar_sim.runs import coarse
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.plan import Plan

RECORD = 8 * len(COLUMNS)
"""What the record alone takes [bytes a step]."""


def planned(steps: int) -> Plan:
    h = 1e-5  # short enough that the path's period is a whole number of steps
    settings = [f"sim.timestep={h}", f"duration={steps * h}", "path.frequency=20", "limits={}"]
    return rollout.plan(Scenario.load("classic-ellipse", [*settings, "path.ramp=0.01"]))


def peak(does: Callable[[], object]) -> int:
    """Return the most that a call takes on top of what there was [bytes]."""
    tracemalloc.start()
    try:
        does()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_run_takes_a_few_times_its_record() -> None:
    """Beside its record: the plan, what the metrics need of each step, and their own arrays."""
    short, long = (peak(lambda n=n: rollout.execute(planned(n))) for n in (8_000, 24_000))
    assert RECORD < (long - short) / 16_000 < 4.5 * RECORD


@pytest.mark.parametrize("rows", [1, 7, 8, 9, 20])
def test_plot_in_parts_is_the_plot(monkeypatch: pytest.MonkeyPatch, rows: int) -> None:
    """Also one with gaps, whose values are fewer than its rows."""
    monkeypatch.setattr(rrd, "CHUNK", 8)
    shown = np.arange(rows) % 3 != 1
    values = np.arange(2.0 * shown.sum()).reshape(-1, 2)
    plot = Series("share", "", {"A": (0, 0, 0), "E": (0, 0, 0)}, values, shown)
    steps, parts = zip(*rrd.parts(plot), strict=True)
    np.testing.assert_array_equal(np.concatenate(steps), np.arange(rows) + 1)
    np.testing.assert_array_equal(np.concatenate([part.values for part in parts]), values)
    assert all(len(part.values) == part.shown.sum() for part in parts)
    assert max(len(part.shown) for part in parts) <= 8


@pytest.mark.parametrize("most", [0, 1500, 10**6])
def test_verdicts_do_not_depend_on_how_many_runs_fit(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """Runs are batched, and plans that would not fit are made again: same verdicts, same order."""
    names = ["short.toml", "second.toml", "third.toml"]
    text = Path("short.toml").read_text(encoding="utf-8")
    for name in names[1:]:
        own = text.replace('"short"', f'"{name[:-5]}"')
        Path(name).write_text(own, encoding="utf-8")

    together = rollout.run_all
    calls = []
    monkeypatch.setattr(
        rollout, "run_all", lambda plans, nthread=1: (calls.append(len(plans)), together(plans))[1]
    )
    monkeypatch.setattr(common, "TOGETHER", most)
    said = shell("check", *names)
    assert said.status == 0
    places = [said.out.index(name[:-5]) for name in names]
    assert places == sorted(places)
    steps = Scenario.load("short.toml").steps
    fit = max(1, min(3, most // steps))
    assert calls == [fit] * (3 // fit) + [3 % fit] * bool(3 % fit)


def _written(count: int, steps: int) -> list[str]:
    """Write scenarios of so many steps; return their files' names."""
    scenario = planned(steps).scenario
    names = [f"run-{k}.toml" for k in range(count)]
    for name in names:
        own = {**scenario.table(), "name": name[:-5], "limits": {"tracking.rms": 1.0}}
        Path(name).write_text(tomli_w.dumps(own), encoding="utf-8")
    return names


def test_a_check_of_many_long_runs_has_one_of_them_at_a_time(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is left of each run is its verdict: four of them take what two take."""
    steps = 6_000
    monkeypatch.setattr(common, "TOGETHER", steps)
    # The runs in shorter steps are those of one scenario, and gone before the next.
    monkeypatch.setattr(coarse, "warnings", lambda *given: [])
    names = _written(4, steps)
    assert shell("check", *names[:1]).status == 0
    two, four = (peak(lambda n=n: shell("check", *names[:n])) for n in (2, 4))
    assert four - two < RECORD * steps


@pytest.mark.long
def test_a_check_of_twenty_runs_of_a_million_steps_takes_less_than_a_gigabyte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import resource

    monkeypatch.chdir(tmp_path)
    names = _written(20, 1_000_000)
    command = [sys.executable, "-m", "fivebar_sim", "check", "--quiet", *names]
    subprocess.run(command, check=True, timeout=3600.0)
    # Of the largest child so far [kB].
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < 1e6
