"""Sweeps: which points there are, a row for each, and the same table however it came about."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from shell import Shell, started

from fivebar_sim.errors import ConfigError, UnknownError
from fivebar_sim.metrics.catalogue import LIMIT_KEYS
from fivebar_sim.rollout import run
from fivebar_sim.scenario import Scenario
from fivebar_sim.sweep import sweep
from fivebar_sim.sweep.axes import parse
from fivebar_sim.sweep.points import points
from fivebar_sim.workers.here import Answer, Here, Task

VARY = ("leg.L2,leg.L3=0.04:0.06:3", "servo=ideal,xl330")
SHORT = ("duration=0.4",)


def rows(place: Path) -> list[dict[str, Any]]:
    return pq.read_table(place / "runs.parquet").to_pylist()


class Broken:
    """Workers that are gone after some tasks, and do them in the wrong order."""

    def __init__(self, most: int) -> None:
        self.most = most

    def results(self, function: Callable[[Any], Any], tasks: Iterable[Task]) -> Iterator[Answer]:
        """Do the last tasks."""
        for k, argument in sorted(tasks, key=lambda task: -task[0])[: self.most]:
            yield k, function(argument)
        raise KeyboardInterrupt


@pytest.fixture
def short(shell: Shell) -> Path:
    return shell.folder / "short.toml"


def test_values_are_those_that_people_write() -> None:
    assert parse("leg.L2=0.05:0.08:31").values[:3] == (0.05, 0.051, 0.052)
    assert parse("sim.seed=0:6:4").values == (0, 2, 4, 6)
    assert parse("a=0:5:3").values == (0.0, 2.5, 5.0)
    assert parse("a=3:3:1").values == (3,)
    assert parse("a,b=-1e-3:1e-3:3").values == (-0.001, 0.0, 0.001)
    lists = parse('path.radii=[0.01, 0.02],[0.03,0.01], "a,b",true,x:1')
    assert lists.values == ([0.01, 0.02], [0.03, 0.01], "a,b", True, "x:1")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("leg.L2", "--vary takes KEY=LOW:HIGH:N or KEY=VALUE,VALUE,..., got 'leg.L2'"),
        ("a=", "--vary takes"),
        ("a,,b=1", "--vary takes"),
        ("a,a=1", "--vary a,a: a key is there twice"),
        ("a=1:0:3", "LOW must be at most HIGH, got 1 and 0"),
        ("a=0:1:0", r"N must be an integer in [1, 1000000], got '0'"),
        ("a=0:1:2.5", "N must be an integer"),
        ("a=0:1:1", "N = 1 value cannot be both LOW and HIGH"),
        ("a=0:1", "how many values? Write a=0:1:N, or add --sample"),
        ("a=0:b:3", "with numbers"),
        ("a=0:1e999:3", "LOW must be at most HIGH"),
        ("a=0:1:2:3", "with numbers"),
    ],
)
def test_odd_ranges_are_refused(text: str, why: str) -> None:
    with pytest.raises(ConfigError) as raised:
        points([text])
    assert why in str(raised.value)


def test_grid_has_every_combination_once_and_the_last_changes_fastest() -> None:
    grid = points(["a=1:3:3", "b=x,y"])
    assert [grid.at(k) for k in range(3)] == [[1, "x"], [1, "y"], [2, "x"]]
    assert len({tuple(grid.at(k)) for k in range(grid.count)}) == grid.count == 6
    with pytest.raises(ConfigError, match=r"would undo --vary leg.L2: give leg first"):
        points(["leg.L2=1,2", "leg=classic,q8bot"])
    with pytest.raises(ConfigError, match="varied twice"):
        points(["a=1,2", "b,a=1,2"])
    with pytest.raises(ConfigError, match="at most 100,000,000 points"):
        points(["a=0:1:100000", "b=0:1:100000"])


def test_sample_is_even_repeatable_and_within_its_ranges() -> None:
    found = points(["a=2:4", "b=x,y", "c=1:5:5"], sample=200, seed=3)
    drawn = [found.at(k) for k in range(found.count)]
    again = points(["a=2:4", "b=x,y", "c=1:5:5"], sample=200, seed=3)
    assert drawn == [again.at(k) for k in range(200)]
    assert drawn != [points(["a=2:4", "b=x,y", "c=1:5:5"], 200, 4).at(k) for k in range(200)]
    low, names, levels = (np.array(column) for column in zip(*drawn, strict=True))
    # A random sample of 200 would miss a half by 7 as often as not; a Sobol net hardly at all.
    assert low.min() >= 2.0
    assert low.max() < 4.0
    assert abs(int((low < 3.0).sum()) - 100) <= 3
    assert abs(int((names == "x").sum()) - 100) <= 3
    assert set(levels.tolist()) == {1, 2, 3, 4, 5}


def test_every_row_is_the_run_of_its_values(short: Path) -> None:
    swept = sweep(short, VARY, short.parent / "out", settings=SHORT)
    found = rows(short.parent / "out")
    assert (swept.size, swept.new, len(found)) == (6, 6, 6)
    assert [row["run"] for row in found] == list(range(6))
    for row in (found[3], found[4]):
        changes = [f"{key}={row[key]}" for key in ("leg.L2", "leg.L3", "servo")]
        alone = run(Scenario.load(short, [*SHORT, *changes]))
        assert row["verdict"] == alone.verdict
        assert row["limits"] == [limit.key for limit in alone.limits if not limit.ok]
        assert row["tracking.rms"] == alone.metrics["tracking"]["rms"]
        assert row["load.torque_peak.E"] == alone.metrics["load"]["torque_peak"]["E"]
        assert row["ground.slip"] is None
    assert set(LIMIT_KEYS) < set(found[0])
    assert not (short.parent / "out" / "blocks").exists()


def test_what_cannot_be_run_is_a_row(short: Path) -> None:
    """Out of reach; refused by the scenario; breaks down while it runs."""
    vary = ["leg.L2=0.9,0.02,0.06", "servo.kp=8.0,5e5"]
    sweep(short, vary, short.parent / "out", settings=[*SHORT, "sim.integrator=implicitfast"])
    found = rows(short.parent / "out")
    assert [row["verdict"] is None for row in found] == [True, True, True, True, False, True]
    assert "the links can never close" in found[0]["error"]
    assert "path out of reach" in found[2]["error"]
    assert found[4]["error"] is None
    assert "the foot left its path" in found[5]["error"]
    assert found[0]["tracking.rms"] is None


def test_broken_off_it_goes_on_to_the_same_bytes(short: Path) -> None:
    folder = short.parent
    sweep(short, VARY, folder / "whole", settings=SHORT)
    for most in (2, 1):
        with pytest.raises(KeyboardInterrupt):
            sweep(short, VARY, folder / "parts", settings=SHORT, workers=Broken(most))
    assert len(list((folder / "parts" / "blocks").iterdir())) == 3
    (folder / "parts" / ".fivebar-left.parquet").write_bytes(b"half a fi")
    told: list[tuple[int, int]] = []
    rest = sweep(
        short, VARY, folder / "parts", settings=SHORT, watch=lambda *args: told.append(args)
    )
    assert rest.new == 3
    assert told == [(3, 6), (4, 6), (5, 6), (6, 6)]
    whole, parts = (folder / name / "runs.parquet" for name in ("whole", "parts"))
    assert whole.read_bytes() == parts.read_bytes()
    assert {path.name for path in (folder / "parts").iterdir()} == {"runs.parquet", "sweep.json"}
    assert sweep(short, VARY, folder / "parts", settings=SHORT).new == 0


def test_another_sweep_in_the_directory_is_refused(short: Path) -> None:
    out = short.parent / "out"
    vary = ["leg.L2=0.05,0.06"]
    sweep(short, vary, out, settings=SHORT)
    text = short.read_text("utf-8")
    for kind, why in (
        ({"vary": ["leg.L2=0.05,0.07"]}, r"its --vary was {\"leg.L2\": \[0.05, 0.06\]}"),
        ({"settings": ["duration=0.5"]}, "of another scenario, or of its file before a change"),
        ({"sample": 2}, "its --sample was null"),
    ):
        with pytest.raises(ConfigError, match=why):
            sweep(short, **{"vary": vary, "out": out, "settings": SHORT, **kind})
    short.write_text(text.replace("0.008", "0.009"), encoding="utf-8")
    with pytest.raises(ConfigError, match="of another scenario"):
        sweep(short, vary, out, settings=SHORT)
    (short.parent / "mine").mkdir()
    (short.parent / "mine" / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(ConfigError, match="holds something else: choose another --out"):
        sweep(short, vary, short.parent / "mine", settings=SHORT)
    (out / "sweep.json").write_text("{", encoding="utf-8")
    for text in ("{", "[" * 100_000):
        (out / "sweep.json").write_text(text, encoding="utf-8")
        with pytest.raises(ConfigError, match=r"its sweep\.json is damaged"):
            sweep(short, vary, out, settings=SHORT)


def test_damaged_tables_of_a_sweep_are_named(short: Path) -> None:
    """A whole one, and the block of one that was broken off."""
    vary = ["leg.L2=0.05,0.06"]
    out = short.parent / "out"
    sweep(short, vary, out, settings=SHORT)
    sound = pq.read_table(out / "runs.parquet")
    (out / "blocks").mkdir()
    for file in (out / "runs.parquet", out / "blocks" / "00000000.parquet"):
        for damage, why in (
            (b"PAR1", "damaged"),
            (sound.drop_columns(["verdict"]), "the column verdict must be string, once"),
            (sound.append_column("x", sound["run"]), "has the column 'x'"),
            (pa.concat_tables([sound, sound]), r"must have \d rows, got 4"),
        ):
            if isinstance(damage, bytes):
                file.write_bytes(damage)
            else:
                pq.write_table(damage, file)
            with pytest.raises(ConfigError, match=why) as caught:
                sweep(short, vary, out, settings=SHORT)
            assert str(file) in str(caught.value)
        file.unlink()


def test_two_programs_do_not_sweep_into_one_place(short: Path) -> None:
    class Second(Here):
        def results(
            self, function: Callable[[Any], Any], tasks: Iterable[Task]
        ) -> Iterator[Answer]:
            with pytest.raises(ConfigError, match=r"another program sweeps into .* now"):
                sweep(short, ["leg.L2=0.05,0.06"], short.parent / "out", settings=SHORT)
            return super().results(function, tasks)

    sweep(short, ["leg.L2=0.05,0.06"], short.parent / "out", settings=SHORT, workers=Second())


def test_typing_errors_stop_it_before_it_begins(shell: Shell) -> None:
    def refused(*args: str) -> str:
        return shell.refused("sweep", "short.toml", "--out", "o", *args)

    assert "[leg]: unknown key 'L22'" in refused("--vary", "leg.L22=0.05,0.06")
    assert "did you mean 'hobby-9g'?" in refused("--vary", "servo=xl330,hobby9g")
    assert "unknown key 'pth'" in refused("--vary", "pth.radius=1,2")
    assert "duration must be" in refused("--vary", "duration=abc,def")
    assert "varies at least one key" in refused()
    assert "--sample must be in" in refused("--vary", "leg.L2=0.05:0.06", "--sample", "0")
    plot = refused("--vary", "leg.L2=0.05,0.06", "--plot", "tracking.rm")
    assert "--plot: unknown metric 'tracking.rm'" in plot
    assert "did you mean 'tracking.rms'?" in plot
    over = refused("--vary", "leg.L2=0.05,0.06", "--over", "leg.L3")
    assert "--over: unknown key 'leg.L3'" in over
    with pytest.raises(UnknownError, match="unknown scenario 'classic-elipse'"):
        sweep("classic-elipse", ["leg.L2=0.05,0.06"], "o")


def test_scenario_without_a_file_is_swept_too(short: Path) -> None:
    loaded = Scenario.load(short, SHORT)
    sweep(loaded, ["leg.L2=0.05,0.06"], short.parent / "one")
    sweep(short, ["leg.L2=0.05,0.06"], short.parent / "other", settings=SHORT)
    one, other = (rows(short.parent / name) for name in ("one", "other"))
    assert one == other
    with pytest.raises(ConfigError, match="this is a Scenario already"):
        sweep(loaded, ["leg.L2=0.05,0.06"], short.parent / "out", settings=SHORT)


def test_command_draws_and_says_how_the_runs_ended(shell: Shell) -> None:
    args = ("sweep", "short.toml", "--out", "o", "--set", "duration=0.4")
    vary = ("--vary", "leg.L2=0.02:0.06:3", "--vary", "servo=ideal,xl330")
    said = shell(*args, *vary, "--plot", "tracking.rms")
    assert said.status == 0
    assert "6 runs in o/runs.parquet" in said.out
    assert "4 could not be run (the first: path out of reach" in said.out
    assert (shell.folder / "o" / "tracking.rms.png").read_bytes()[:4] == b"\x89PNG"
    assert "servo" in (shell.folder / "o" / "tracking.rms.svg").read_text("utf-8")
    none = shell(*args, *vary, "--plot", "ground.slip")
    assert (none.status, none.err) == (
        2,
        "fivebar: --plot ground.slip: none of the 6 runs has it\n",
    )
    nothing = shell("sweep", "short.toml", "--out", "n", "--vary", "leg.L2=0.02,0.021", "--quiet")
    assert (nothing.status, nothing.out) == (1, "")


@pytest.mark.long
def test_killed_at_any_moment_it_goes_on_to_the_same_bytes(short: Path) -> None:
    command = [sys.executable, "-m", "fivebar_sim", "sweep", "short.toml", "--processes", "2"]
    command += ["--vary", "leg.L2=0.05:0.07:40", "--out"]
    subprocess.run([*command, "whole"], check=True, capture_output=True)
    for k in range(12):
        run = started([*command, "parts"])
        time.sleep(1.0 + 0.15 * k)
        run.send_signal(signal.SIGKILL if k % 2 else signal.SIGINT)
        run.communicate()
    subprocess.run([*command, "parts"], check=True, capture_output=True)
    whole, parts = (short.parent / name / "runs.parquet" for name in ("whole", "parts"))
    assert whole.read_bytes() == parts.read_bytes()
    assert json.loads((short.parent / "parts" / "sweep.json").read_text("utf-8"))["sample"] is None
