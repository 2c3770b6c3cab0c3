"""`fivebar log`: what is in a file, what it may be, and whether a leg can have such angles."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fivebar_sim.arrays import Array
from fivebar_sim.cli import main
from fivebar_sim.errors import ConfigError, LoopOpenError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.logged import check_closes
from fivebar_sim.logs import Log, guess, load, read, read_map, survey, text
from fivebar_sim.logs.opening import open_file

FOLDER = Path(__file__).parent / "logs"
CLASSIC = FiveBar.load("classic")
GUESSED: dict[str, dict[str, Any]] = {
    "dynamixel_wizard.csv": {"time": "ms", "theta_A": "turn/4096", "theta_E": "turn/4096"},
    "excel_german.csv": {"time": "ms", "theta_A": "deg", "theta_E": "deg", "current_A": "mA"},
    "odrive.csv": {"time": "", "theta_A": "", "theta_E": ""},
    "pandas_datetime.csv": {"time": "", "theta_A": "", "theta_E": ""},
    "simplefoc.txt": {"rate": 0.0},
    "units_row.csv": {"time": "", "theta_A": "deg", "theta_E": "deg", "current_A": "mA"},
}


@pytest.fixture(scope="module")
def truth() -> Log:
    return load(FOLDER / "truth.csv")


@pytest.mark.parametrize("file", GUESSED)
def test_guesses_have_the_units_that_names_and_ranges_tell(file: str) -> None:
    raw = open_file(FOLDER / file)
    found = guess.guess(raw, survey.survey(raw))
    units = {
        k: v if k == "rate" else "" if isinstance(v, str) else v["unit"] for k, v in found.items()
    }
    assert units == GUESSED[file]


def test_survey_by_blocks_is_that_of_all_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = open_file(FOLDER / "pandas_gaps.csv")
    whole = survey.survey(raw)
    timing = survey.timing(raw, "t", 1.0)
    # Arrow cuts blocks of no less than a line: some rows each.
    monkeypatch.setattr(text, "BLOCK", 100)
    assert len(list(raw.blocks(["t"]))) > 5
    assert survey.survey(raw) == whole
    again = survey.timing(raw, "t", 1.0)
    assert timing is not None
    assert again is not None
    np.testing.assert_allclose(again, timing)
    assert (timing.gaps, timing.jumps, timing.repeated) == (1, 0, 0)
    np.testing.assert_allclose(
        [timing.interval, timing.span, timing.longest], [0.005, 0.115, 0.025]
    )
    assert whole.columns["theta_A"].there == 18


def test_log_shows_a_file_and_writes_a_table_to_start_from(
    truth: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / "map.toml"
    file = FOLDER / "excel_german.csv"
    assert main(["log", str(file), "--map", str(place), "--leg", "classic"]) == 0
    said = capsys.readouterr().out
    for part in ("semicolons, decimal commas, cp1252; 24 rows", "theta_A deg", "200 Hz; 0.115 s"):
        assert part in said
    assert "the loop of the leg classic closes in every row" in said
    assert tomllib.loads(place.read_text())["log"]["theta_E"]["unit"] == "deg"
    np.testing.assert_allclose(load(place).pair("theta"), truth.pair("theta"), atol=1e-6)
    assert main(["log", str(place)]) == 0
    assert "24 rows, 200 Hz, 0.115 s; 0 gaps" in capsys.readouterr().out
    assert main(["log", str(FOLDER / "excel_german.csv"), "--leg", "classic"]) == 2
    assert "fivebar log" in capsys.readouterr().err


MISREAD: dict[str, Callable[[Array], Array]] = {
    "A and E swapped: exchange": lambda theta: theta[:, ::-1],
    "degrees read as radians, a factor of 57.3: unit = 'deg'": np.degrees,
    "radians read as degrees, a factor of 57.3": np.radians,
    "sign = -1 for both": np.negative,
}


@pytest.mark.parametrize("said", MISREAD)
def test_angles_that_are_not_the_legs_are_refused_with_a_guess(said: str, truth: Log) -> None:
    with pytest.raises(LoopOpenError, match="first at t = ") as refused:
        check_closes(CLASSIC, truth.time, MISREAD[said](truth.pair("theta")), "bench.csv")
    assert said in str(refused.value)


def test_a_loop_that_opens_says_when_and_by_how_much(truth: Log) -> None:
    theta = truth.pair("theta").copy()
    check_closes(CLASSIC, truth.time, theta, "bench.csv")
    # Cranks that point apart: the knees are 30 + 2 x 40 mm apart, and L2 + L3 is 100 mm.
    short = FiveBar(L1=0.04, L2=0.05, L3=0.05, L4=0.04, L5=0.03)
    theta[7] = (np.pi, 0.0)
    with pytest.raises(LoopOpenError) as refused:
        check_closes(short, truth.time, theta, "bench.csv")
    assert refused.value.index == (7,)
    said = str(refused.value)
    assert "in 4.17 % of rows: first at t = 0.035 s, where the knees are 10 mm too far" in said


WRONG = {
    "unknown key 'theta_a'": {"theta_a": "x"},
    "unit must be one of": {"theta_A": {"column": "a", "unit": "m"}},
    "kt is for torques": {"theta_A": {"column": "a", "kt": 1.0}},
    "sign must be one of 1, -1, got 2": {"theta_A": {"column": "a", "sign": 2}},
    "rate is for logs without time": {"time": "t", "rate": 10.0},
    "end must be above start = 2 s, got 1 s": {"start": 2.0, "end": 1.0},
    "jumps must be": {"jumps": "ignore"},
    "theta_A.column is missing": {"theta_A": {"unit": "deg"}},
}


@pytest.mark.parametrize("said", WRONG)
def test_wrong_tables_are_refused_by_their_key(said: str) -> None:
    with pytest.raises(ConfigError) as refused:
        read_map(WRONG[said], "bench.toml: log")
    assert said in str(refused.value)


def test_start_and_end_choose_rows(truth: Log) -> None:
    table = {"time": "time", "theta_A": "theta_A", "start": 0.02, "end": "50 ms"}
    found = read(FOLDER / "truth.csv", read_map(table, "log"))
    np.testing.assert_allclose(found.time, truth.time[:7])
    np.testing.assert_array_equal(found.channels["theta_A"], truth.channels["theta_A"][4:11])
