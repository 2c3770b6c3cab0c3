"""Run directories: complete, exact and whole; nothing of others is touched."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pyarrow.parquet as pq
import pytest
from fivebar_controllers.pd import Pd
from run_directories import a_result, names
from shell import CSV

from fivebar_sim import report, rollout
from fivebar_sim.report import single
from fivebar_sim.rollout import Result
from fivebar_sim.runs import checksums, directory
from fivebar_sim.runs.directory import FILES
from fivebar_sim.scenario import Scenario

COLUMNS = (
    "time target_x target_z foot_x foot_z theta_A theta_B theta_E theta_D theta_dot_A theta_dot_B "
    "theta_dot_E theta_dot_D ctrl_A ctrl_E torque_A torque_E gap"
).split()
MEASURED = [
    *("tracking.rms", "tracking.max", "closure.rms", "closure.max"),
    *("load.torque_rms.A", "load.torque_rms.E", "load.torque_peak.A", "load.torque_peak.E"),
    *("load.share_A", "load.thermal_share_A", "branch.working_mode", "branch.assembly"),
    *("branch.flips", "warnings", "verdict"),
]

FOLLOWING = """
duration = 0.5
[path]
kind = "csv"
file = "trot.csv"
ramp = 0.1
"""


@pytest.fixture(scope="module")
def result() -> Result:
    return a_result()


def look_up(table: Mapping[str, Any], key: str) -> Any:
    for part in key.split("."):
        table = table[part]
    return table


def refuse_link(*args: object, **how: object) -> NoReturn:
    raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))


def refuse_constant(name: str) -> NoReturn:
    raise AssertionError(f"metrics.json says {name}")


# law


def test_run_directory_is_complete_and_alone(tmp_path: Path, result: Result) -> None:
    where = result.write(tmp_path / "runs" / "deep" / "mine")
    assert where == tmp_path / "runs" / "deep" / "mine"
    assert names(where) == set(FILES)
    assert names(where.parent) == {"mine"}
    assert directory.is_run(where)
    directory.check_run(where)
    assert all((where / name).stat().st_size > 0 for name in FILES)


def test_parquet_is_the_record(tmp_path: Path, result: Result) -> None:
    table = pq.read_table(result.write(tmp_path / "mine") / "rollout.parquet")
    assert table.column_names == COLUMNS
    assert {str(field.type) for field in table.schema} == {"double"}
    assert table.num_rows == result.scenario.steps == 751
    for name in COLUMNS:
        column = table[name].to_numpy()
        np.testing.assert_array_equal(column, result.record[name])
        assert np.isfinite(column).all()
    # computed, not summed up: bit for bit
    np.testing.assert_array_equal(table["time"].to_numpy(), (np.arange(751) + 1) * 0.001)


def test_metrics_are_strict_json_and_say_where_they_come_from(
    tmp_path: Path, result: Result
) -> None:
    text = (result.write(tmp_path / "mine") / "metrics.json").read_text(encoding="utf-8")
    metrics = json.loads(text, parse_constant=refuse_constant)
    assert metrics == json.loads(json.dumps(result.metrics))
    for key in MEASURED:
        assert look_up(metrics, key) is not None
    assert metrics["verdict"] == result.verdict == "fail"
    (limit,) = metrics["limits"]
    assert (limit["key"], limit["low"], limit["high"]) == ("tracking.rms", None, 1e-9)
    assert (limit["value"], limit["ok"]) == (metrics["tracking"]["rms"], False)
    provenance = metrics["provenance"]
    for key in ("fivebar_sim", "mujoco", "numpy", "python", "platform"):
        assert isinstance(provenance[key], str)
    settings = provenance["integrator"], provenance["timestep"], provenance["seed"]
    assert settings == ("discrete", 0.001, 0)
    assert "git" in provenance


def test_run_of_a_run_is_the_same_run(tmp_path: Path) -> None:
    first = rollout.run(Scenario.load("q8bot-trot", ["duration=2.1"]))
    where = first.write(tmp_path / "trot")
    assert names(where) == {*FILES, "q8bot_trot.csv"}
    again = rollout.run(Scenario.load(where / "scenario.toml"))
    for name in COLUMNS:
        np.testing.assert_array_equal(again.record[name], first.record[name])
    # in its own place, where the CSV is read from what is exchanged
    again.write(where)
    assert names(where) == {*FILES, "q8bot_trot.csv"}
    assert names(tmp_path) == {"trot"}


def test_run_of_another_controller_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(single, "figures", lambda run: [])  # that the run is read is enough
    loaded = Scenario.load("classic-ellipse", ["duration=0.5", "path.frequency=4", "limits={}"])
    first = rollout.run(loaded.driven_by(Pd(kp=3.0)))
    where = first.write(tmp_path / "steered")
    report.write([where])
    assert (where / "report.html").is_file()
    read = Scenario.load(where / "scenario.toml")
    assert (read.controller_name, read.controller) == ("pd", Pd(kp=3.0))
    again = rollout.run(read)
    for name in COLUMNS:
        np.testing.assert_array_equal(again.record[name], first.record[name])


def test_result_is_read_back_as_it_was(tmp_path: Path, result: Result) -> None:
    """The text of the scenarios: a directory's path and controller are other objects."""
    read = Result.read(result.write(tmp_path / "run"))
    assert read.scenario.table() == result.scenario.table()
    assert list(read.record) == list(result.record)
    for name, column in result.record.items():
        np.testing.assert_array_equal(read.record[name], column)
    assert read.metrics == result.metrics
    assert (read.limits, read.verdict) == (result.limits, "fail")


def test_repr_of_a_result_is_one_short_line(result: Result) -> None:
    assert repr(result) == "Result('classic-ellipse': fail, 751 steps)"


# edge


def test_load_that_nobody_shares_is_null(tmp_path: Path) -> None:
    settings = ["path.kind=line", "path.start=[0,-0.08]", "path.stop=[0,-0.08]"]
    held = rollout.run(Scenario.load("classic-ellipse", [*settings, "leg.gravity=[0,0]"]))
    text = (held.write(tmp_path / "mine") / "metrics.json").read_text(encoding="utf-8")
    share = json.loads(text, parse_constant=refuse_constant)["load"]["share_A"]
    assert share is None or math.isfinite(share)


@pytest.mark.usefixtures("light")
def test_existing_run_and_empty_directory_are_exchanged(tmp_path: Path, result: Result) -> None:
    where = tmp_path / "mine"
    where.mkdir()
    result.write(where)
    before = os.stat(where).st_ino
    result.write(where)
    assert names(where) == set(FILES)
    assert os.stat(where).st_ino != before
    assert names(tmp_path) == {"mine"}


@pytest.mark.usefixtures("light")
@pytest.mark.parametrize("links", [True, False])
def test_running_again_deletes_only_the_own_files_of_the_run(
    tmp_path: Path, result: Result, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    """Notes, folders and links stay; the old run's files, inputs and report go."""
    where = rollout.run(Scenario.load("q8bot-trot", ["duration=2.1"])).write(tmp_path / "mine")
    for name in ("notes.txt", "report.html", "deep/er/plot.png"):
        (where / name).parent.mkdir(parents=True, exist_ok=True)
        (where / name).write_text(f"my {name}", encoding="utf-8")
    (where / "link").symlink_to("nowhere")
    (where / "deep").chmod(0o750)
    if not links:
        monkeypatch.setattr(os, "link", refuse_link)
    result.write(where)
    assert names(where) == {*FILES, "notes.txt", "deep", "link"}
    assert (where / "notes.txt").read_text(encoding="utf-8") == "my notes.txt"
    assert (where / "deep/er/plot.png").read_text(encoding="utf-8") == "my deep/er/plot.png"
    assert os.readlink(where / "link") == "nowhere"
    assert (where / "deep").stat().st_mode & 0o777 == 0o750
    assert (
        json.loads((where / "metrics.json").read_text())["tracking"] == result.metrics["tracking"]
    )
    assert names(tmp_path) == {"mine"}


@pytest.mark.usefixtures("light", "two_steps")
def test_a_note_is_in_the_new_directory_before_the_old_one_is_moved(
    tmp_path: Path, result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = result.write(tmp_path / "mine")
    (where / "notes.txt").write_text("precious", encoding="utf-8")
    rename = Path.rename
    moved: list[str] = []

    def watched(self: Path, target: Path) -> Path:
        (stage,) = tmp_path.glob(".mine.*.partial")
        moved.append((stage / "notes.txt").read_text(encoding="utf-8"))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", watched)
    result.write(where)
    assert moved == ["precious", "precious"]


@pytest.mark.usefixtures("light")
def test_relative_and_odd_names_are_taken_literally(
    tmp_path: Path, result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("plain", "~", "~/mine", "s3:/bucket", "two words", "é"):
        directory.check_run(result.write(name))
    assert names(tmp_path) == {"plain", "~", "s3:", "two words", "é"}


def test_a_csv_is_kept_as_it_was_when_it_was_read(tmp_path: Path) -> None:
    (tmp_path / "trot.csv").write_text(CSV, encoding="utf-8")
    (tmp_path / "mine.toml").write_text(FOLLOWING, encoding="utf-8")
    planned = rollout.plan(Scenario.load(tmp_path / "mine.toml"))
    (tmp_path / "trot.csv").write_text(CSV.replace("-80", "-78"), encoding="utf-8")
    where = rollout.execute(planned).write(tmp_path / "mine")
    assert (where / "trot.csv").read_text(encoding="utf-8") == CSV
    assert Result.read(where).scenario.path.at(0.0).position.tolist() == [0.0, -0.08]


@pytest.mark.usefixtures("light")
def test_a_users_file_that_an_edited_scenario_names_is_not_the_runs(
    tmp_path: Path, result: Result
) -> None:
    where = rollout.run(Scenario.load("q8bot-trot", ["duration=2.1"])).write(tmp_path / "mine")
    (where / "q8bot_trot.csv").rename(where / "better.csv")
    scenario = (where / "scenario.toml").read_text(encoding="utf-8")
    scenario = scenario.replace("q8bot_trot.csv", "better.csv")
    (where / "scenario.toml").write_text(scenario, encoding="utf-8")
    result.write(where)
    assert names(where) == {*FILES, "better.csv"}


@pytest.mark.usefixtures("light")
def test_a_record_that_lists_the_files_of_others_deletes_none(
    tmp_path: Path, result: Result
) -> None:
    where = result.write(tmp_path / "mine")
    precious = [where / "notes.txt", tmp_path / "notes.csv", tmp_path / "whole.csv"]
    for file in precious:
        file.write_text("precious", encoding="utf-8")
    record = where / checksums.RECORD
    names_of_others = ["notes.txt", "../notes.csv", str(precious[2])]
    sums = checksums.of_files(where, names_of_others)
    table = pq.read_table(record).replace_schema_metadata(checksums.written(sums))
    pq.write_table(table, record)

    result.write(where)
    assert names(where) == {*FILES, "notes.txt"}
    pq.write_table(table, record)
    directory.discard(where, "it diverged")
    assert all(file.exists() for file in precious)
