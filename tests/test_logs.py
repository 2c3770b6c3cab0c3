"""Logs as tools write them: read into SI, or refused in one line that names column and cure."""

from __future__ import annotations

import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fivebar_sim.errors import FiveBarError
from fivebar_sim.logs import Log, read, read_map

FOLDER = Path(__file__).parent / "logs"
CASES: list[dict[str, Any]] = tomllib.loads((FOLDER / "expected.toml").read_text())["log"]
TRUTH = np.genfromtxt(FOLDER / "truth.csv", delimiter=",", names=True)
RATES = ("theta_dot_A", "theta_dot_E")
CURRENTS = ("current_A", "current_E")
WITH_MCAP = find_spec("mcap") is not None


def log_of(file: str, table: dict[str, Any]) -> Log:
    if file.endswith(".mcap") and not WITH_MCAP:
        pytest.skip("mcap is not installed")
    return read(FOLDER / file, read_map(table, f"{file}: log"))


def id_of(case: dict[str, Any]) -> str:
    return f"{case['file']}{'-refused' if 'error' in case else ''}"


def test_every_file_is_told_of() -> None:
    files = {path.name for path in FOLDER.iterdir()} - {"expected.toml"}
    assert {case["file"] for case in CASES} == files
    assert len(files) >= 30


@pytest.mark.parametrize("case", [c for c in CASES if "error" not in c], ids=id_of)
def test_logs_are_read_as_they_are(case: dict[str, Any]) -> None:
    found = log_of(case["file"], case["is"])
    assert found.time[0] == 0.0
    assert (np.diff(found.time) > 0.0).all()
    bounds: dict[str, float] = dict.fromkeys(RATES, case.get("rates", 1e-6))
    bounds |= dict.fromkeys(CURRENTS, case.get("current", 1e-6))
    for name in TRUTH.dtype.names or ():
        if name == "time" or not found.has(name):
            continue
        # Where a channel was not sampled in every row, it is as true at its own times.
        time, values = found.samples(name)
        due = np.interp(time, TRUTH["time"], TRUTH[name])
        assert np.abs(values - due).max() <= bounds.get(name, case["within"]), name
    gaps = [(gap.start, gap.length) for gap in found.gaps]
    np.testing.assert_allclose(np.reshape(gaps, (-1, 2)), np.reshape(case.get("gaps", []), (-1, 2)))
    remark = case.get("remark", "")
    assert [said for said in found.remarks if remark and remark in said] or not remark


@pytest.mark.parametrize("case", [c for c in CASES if "error" in c], ids=id_of)
def test_other_logs_are_refused_in_one_line_with_a_cure(case: dict[str, Any]) -> None:
    with pytest.raises(FiveBarError) as refused:
        log_of(case["file"], case["is"])
    said = str(refused.value)
    assert case["error"] in said
    assert case["file"] in said
    assert "\n" not in said
