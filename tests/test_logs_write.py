"""Logs of runs: what sensors and bus would have logged, written so that it is read back."""

from __future__ import annotations

import json
import tomllib
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from logged_runs import SENSORS, log_of, ran

from fivebar_sim import Scenario, cli
from fivebar_sim.errors import ConfigError
from fivebar_sim.logs import load
from fivebar_sim.logs.opening import open_file
from fivebar_sim.overlay import measured, write
from fivebar_sim.runs import directory, mcap
from fivebar_sim.runs.anew import beside
from fivebar_sim.runs.stored import StoredRun

needs_mcap = pytest.mark.skipif(find_spec("mcap") is None, reason="mcap is not installed")


@pytest.mark.parametrize(
    "kind",
    [
        "csv",
        pytest.param("mcap", marks=needs_mcap),
    ],
)
def test_logs_that_are_written_are_read_back(kind: str, tmp_path: Path) -> None:
    log = log_of(ran(), *SENSORS)
    log.channels["theta_A"][3] = np.nan
    place = tmp_path / f"log.{kind}"
    write.write(log, place)
    again = load(place)
    np.testing.assert_allclose(again.time, log.time, atol=1e-9)
    assert set(again.channels) == set(log.channels)
    for name, values in log.channels.items():
        np.testing.assert_allclose(again.channels[name], values, rtol=1e-8, atol=1e-12)


@needs_mcap
def test_a_run_as_mcap_is_read_back_bit_by_bit(tmp_path: Path) -> None:
    result = ran()
    place = tmp_path / "run.mcap"
    mcap.write(StoredRun(tmp_path, result.scenario, result.record, result.measured), place)
    raw = open_file(place)
    assert raw.names == ("log_time", *(f"leg.{name}" for name in result.record))
    assert raw.units["leg.torque_A"] == "N m"
    (block,) = raw.blocks(raw.names)
    cells = {name: np.array(column.to_pylist(), float) for name, column in block.cells.items()}
    np.testing.assert_array_equal(cells["log_time"], np.rint(1e9 * result.record["time"]))
    for name, column in result.record.items():
        np.testing.assert_array_equal(cells[f"leg.{name}"], column, err_msg=name)

    log = load(place)
    np.testing.assert_array_equal(log.channels["theta_A"], result.record["theta_A"])


def test_the_schema_has_units_and_words() -> None:
    told = mcap.schema("leg", {"torque_A": np.ones(1), "own": np.ones(1)})
    torque = {"unit": "N m", "description": "torque that motor A gave in the step"}
    assert told["properties"] == {
        "torque_A": {"type": "number", **torque},
        "own": {"type": "number"},
    }


@needs_mcap
def test_scenario_and_metrics_are_attached(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from mcap.reader import make_reader

    result = ran()
    place = tmp_path / "run"
    place.mkdir()
    (place / "scenario.toml").write_text(directory.as_toml(result.scenario), encoding="utf-8")
    more = beside.written(result.measured)
    directory.write_record(place, result.record, ["scenario.toml"], more)
    file = tmp_path / "run.mcap"
    assert cli.main(["export", str(place), "--mcap", str(file)]) == 0
    assert "1200 steps written as MCAP" in capsys.readouterr().out
    with file.open("rb") as stream:
        kept = {each.name: each.data for each in make_reader(stream).iter_attachments()}
    assert json.loads(kept["metrics.json"])["tracking"] == result.metrics["tracking"]
    table = tomllib.loads(kept["scenario.toml"].decode())
    assert Scenario.from_table(table, "again", tmp_path) == result.scenario


def test_no_other_suffix_is_mcaps(tmp_path: Path) -> None:
    result = ran()
    run = StoredRun(tmp_path, result.scenario, result.record, result.measured)
    with pytest.raises(ConfigError, match=r"the file must end in \.mcap"):
        mcap.write(run, tmp_path / "run.csv")


def test_sensors_round_and_shake_what_they_log() -> None:
    exact = log_of(ran())
    steps = log_of(ran(), "sensors.resolution=0.01").channels["theta_A"] / 0.01
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    noisy = log_of(ran(), "sensors.noise=0.002").channels["theta_E"] - exact.channels["theta_E"]
    assert 0.0017 < noisy.std() < 0.0023


def test_commands_are_logged_as_they_were_sent() -> None:
    log = log_of(ran())
    record = ran().record
    late = log_of(ran("servo.delay=0.007"), "servo.delay=0.007")
    # A delay on the bus changes when a command acts, not when it was sent.
    np.testing.assert_allclose(late.pair("ctrl")[:-2], log.pair("ctrl")[:-2], atol=1e-12)
    assert np.abs(record["ctrl_A"] - ran("servo.delay=0.007").record["ctrl_A"]).max() > 1e-3


def test_robots_have_no_log_of_one_leg() -> None:
    with pytest.raises(ConfigError, match="is a robot's scenario"):
        measured.check_leg(Scenario.load("robot-q8bot-trot"))
