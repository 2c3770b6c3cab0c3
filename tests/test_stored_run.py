"""Runs read back: what was written comes back, and what is damaged is named."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from reports import unrecorded
from sealed import seal

from fivebar_sim import rollout
from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.rollout import Result
from fivebar_sim.runs import stored
from fivebar_sim.scenario import Scenario


@pytest.fixture(scope="module")
def result() -> Result:
    return rollout.run(Scenario.load("rail-landing", ["duration=0.8"]))


@pytest.fixture(scope="module")
def written(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with unrecorded():
        return result.write(tmp_path_factory.mktemp("runs") / "landing")


def test_what_was_written_comes_back(result: Result, written: Path) -> None:
    run = stored.read(written)
    assert run.scenario.table() == result.scenario.table()
    assert run.metrics == json.loads(json.dumps(result.metrics))
    assert list(run.record) == list(result.record)
    assert {"hip_z", "ground_z"} <= set(run.record)
    for name, column in result.record.items():
        np.testing.assert_array_equal(run.record[name], column, err_msg=name)


@pytest.fixture(scope="module")
def trot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run whose foot follows a CSV."""
    made = rollout.run(Scenario.load("q8bot-trot", ["duration=2.1"]))
    with unrecorded():
        return made.write(tmp_path_factory.mktemp("runs") / "trot")


def _edited(file: Path) -> None:
    file.write_bytes(file.read_bytes() + b"\n")


@cache
def _other() -> Result:
    """Return what comes of the same scenario with a stiffer servo."""
    return rollout.run(Scenario.load("q8bot-trot", ["duration=2.1", "servo.kp=20.0"]))


def _of_other(run: Path, name: str) -> None:
    """Put the file of another run there."""
    with unrecorded():
        shutil.copy(_other().write(run.parent / "other") / name, run / name)


def _scaled(run: Path, column: str) -> None:
    """Change a column, and keep the metadata."""
    file = run / "rollout.parquet"
    table = pyarrow.parquet.read_table(file)
    new = pyarrow.array(0.9 * table[column].to_numpy())
    table = table.set_column(table.column_names.index(column), column, new)
    pyarrow.parquet.write_table(table, file)


def _bare(run: Path) -> None:
    file = run / "rollout.parquet"
    table = pyarrow.parquet.read_table(file).replace_schema_metadata(None)
    pyarrow.parquet.write_table(table, file)


CHANGED = "is not the run's: it was changed after the run, or is another run's; run scenario.toml"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda run: _edited(run / "metrics.json"), f"metrics.json {CHANGED} again"),
        (lambda run: _edited(run / "scenario.toml"), f"scenario.toml {CHANGED} again"),
        (lambda run: _edited(run / "q8bot_trot.csv"), f"q8bot_trot.csv {CHANGED} again"),
        (lambda run: (run / "q8bot_trot.csv").unlink(), "q8bot_trot.csv is missing"),
        (lambda run: _of_other(run, "metrics.json"), f"metrics.json {CHANGED} again"),
        (lambda run: _of_other(run, "scenario.toml"), f"scenario.toml {CHANGED} again"),
        (
            lambda run: _of_other(run, "rollout.parquet"),
            "rollout.parquet is of another run than scenario.toml and metrics.json beside it",
        ),
        (lambda run: _scaled(run, "torque_A"), f"rollout.parquet {CHANGED} again"),
        (_bare, "rollout.parquet has no checksums"),
    ],
)
def test_a_file_that_is_not_the_runs_is_named(
    trot: Path, tmp_path: Path, change: Callable[[Path], object], said: str
) -> None:
    run = shutil.copytree(trot, tmp_path / "run")
    (run / "notes.txt").write_text("mine", encoding="utf-8")
    stored.read(run)
    change(run)
    with pytest.raises(RunDirectoryError) as caught:
        stored.read(run)
    message = str(caught.value)
    assert message.startswith(f"{run}/{said}")
    assert "\n" not in message


def _truncated(run: Path) -> None:
    file = run / "rollout.parquet"
    file.write_bytes(file.read_bytes()[:-100])


def _rewritten(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8")
    seal(file.parent)


def _foreign(run: Path) -> None:
    table = pyarrow.table({"time": [1.0]})
    pyarrow.parquet.write_table(table, run / "rollout.parquet")


def _changed(run: Path, column: str, value: object) -> None:
    file = run / "rollout.parquet"
    table = pyarrow.parquet.read_table(file).to_pydict()
    table[column][3] = value
    pyarrow.parquet.write_table(pyarrow.table(table), file)


def _without(run: Path, column: str) -> None:
    file = run / "rollout.parquet"
    pyarrow.parquet.write_table(pyarrow.parquet.read_table(file).drop_columns([column]), file)


def _shortened(run: Path) -> None:
    file = run / "rollout.parquet"
    pyarrow.parquet.write_table(pyarrow.parquet.read_table(file).slice(0, 700), file)


def _doubled(run: Path, column: str) -> None:
    file = run / "rollout.parquet"
    table = pyarrow.parquet.read_table(file)
    pyarrow.parquet.write_table(table.append_column(column, table[column]), file)


def _worded(run: Path, column: str) -> None:
    file = run / "rollout.parquet"
    table = pyarrow.parquet.read_table(file)
    words = pyarrow.array(["0.0"] * len(table))
    table = table.set_column(table.column_names.index(column), column, words)
    pyarrow.parquet.write_table(table, file)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (_truncated, "rollout.parquet is not a record, or is damaged: "),
        (_foreign, "rollout.parquet is not a record: it lacks the column target_x"),
        (lambda run: _changed(run, "gap", None), "column gap must be numbers, all there"),
        (lambda run: _changed(run, "gap", float("nan")), "column gap is not finite"),
        (lambda run: _doubled(run, "gap"), "not a record: it has the column gap twice"),
        (lambda run: _worded(run, "gap"), "column gap must be numbers, all there"),
        (_shortened, "a run of 0.8 s at 0.001 s has 800 rows, got 700"),
        (lambda run: (run / "rollout.parquet").write_bytes(b""), "is not a record, or is damaged"),
        (lambda run: _rewritten(run / "metrics.json", "{"), "metrics.json is not JSON: "),
        (lambda run: _rewritten(run / "metrics.json", "[" * 100_000), "metrics.json is not JSON: "),
        (
            lambda run: _without(run, "ground_z"),
            "not a record of the scene 'rail': it lacks the column",
        ),
        (
            lambda run: _changed(run, "foot_x", 1e200),
            "foot_x must be in [-1e+30, 1e+30], got 1e+200",
        ),
        # A recording is drawn in single precision, which ends at 3.4e38.
        (lambda run: _changed(run, "target_x", 1e39), "target_x must be in [-1e+30, 1e+30], "),
        (lambda run: _changed(run, "hip_z", -1e39), "hip_z must be in [-1e+30, 1e+30], "),
        (
            lambda run: _changed(run, "torque_E", -2e9),
            "torque_E must be in [-1e+09, 1e+09], got -2e",
        ),
        (lambda run: _changed(run, "theta_dot_B", 2e4), "theta_dot_B must be in [-10000, 10000], "),
        (lambda run: _changed(run, "time", 9.0), "column time must be 0.004 s in row 3, got 9"),
        (
            lambda run: (run / "scenario.toml").unlink(),
            "is not a run directory: it lacks scenario.toml",
        ),
        (lambda run: _rewritten(run / "scenario.toml", "x = 1"), "cannot be read as a run: "),
        (shutil.rmtree, "is not a run directory: no such directory"),
    ],
)
def test_damage_is_named(
    written: Path, tmp_path: Path, damage: Callable[[Path], object], said: str
) -> None:
    run = tmp_path / "run"
    shutil.copytree(written, run)
    stored.read(run)
    damage(run)
    with pytest.raises(RunDirectoryError) as caught:
        stored.read(run)
    message = str(caught.value)
    assert said in message
    assert str(run) in message
    assert "\n" not in message


def _long(run: Path) -> None:
    """Give the record a thousand times its rows, each column a constant."""
    file = run / "rollout.parquet"
    table = pyarrow.parquet.read_table(file)
    column = pyarrow.repeat(0.0, 1000 * len(table))
    pyarrow.parquet.write_table(pyarrow.table(dict.fromkeys(table.column_names, column)), file)


def _never(*args: object, **options: object) -> None:
    raise AssertionError("its rows were read")


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (_long, "a run of 0.8 s at 0.001 s has 800 rows, got 800000"),
        (lambda run: _doubled(run, "gap"), "it has the column gap twice"),
        (lambda run: _worded(run, "gap"), "column gap must be numbers, all there"),
    ],
)
def test_what_is_too_much_is_refused_before_its_rows_are_read(
    written: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    damage: Callable[[Path], object],
    said: str,
) -> None:
    """A file of 8 MB can hold 1e8 rows of a constant, which would take 24 GB."""
    run = shutil.copytree(written, tmp_path / "run")
    damage(run)
    monkeypatch.setattr(pyarrow.parquet, "read_table", _never)
    monkeypatch.setattr(pyarrow.parquet.ParquetFile, "read", _never)
    with pytest.raises(RunDirectoryError, match=re.escape(said)) as caught:
        stored.read(run)
    assert str(caught.value).count(str(run)) == 1


def test_columns_of_others_are_left_out(result: Result, written: Path, tmp_path: Path) -> None:
    run = shutil.copytree(written, tmp_path / "run")
    file = run / "rollout.parquet"
    table = pyarrow.parquet.read_table(file)
    table = table.append_column("mine", pyarrow.array(["x"] * len(table)))
    pyarrow.parquet.write_table(table, file)
    assert list(stored.read(run).record) == list(result.record)
