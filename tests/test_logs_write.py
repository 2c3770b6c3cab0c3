"""Logs of runs: what sensors and bus would have logged, written so that it is read back."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from logged_runs import SENSORS, log_of, ran

from fivebar_sim import Scenario
from fivebar_sim.errors import ConfigError
from fivebar_sim.logs import load
from fivebar_sim.overlay import measured, write


@pytest.mark.parametrize(
    "kind",
    [
        "csv",
        pytest.param(
            "mcap",
            marks=pytest.mark.skipif(find_spec("mcap") is None, reason="mcap is not installed"),
        ),
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
