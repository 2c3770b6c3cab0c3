"""Baselines: what is recorded, what comes back, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from shipped import NAMES, results

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import resources
from fivebar_sim.metrics.catalogue import ABSOLUTE, SHOWN
from fivebar_sim.regression import baseline

METRICS = {
    "tracking": {"rms": 1.23456789e-3, "max": 2e-3},
    "closure": {"rms": 1e-7, "max": 3e-7},
    "load": {
        "torque_rms": {"A": 0.1, "E": 0.2},
        "torque_peak": {"A": 0.3, "E": 0.4},
        "share_A": None,
        "thermal_share_A": 0.5,
        "saturated": {"A": 0.0, "E": 0.0},
    },
    "provenance": {
        "mujoco": "3.17.0",
        "numpy": "2.0.0",
        "platform": "Linux x86_64",
        "integrator": "discrete",
        "timestep": 0.001,
        "seed": 0,
    },
}


def written(path: Path, change: dict[str, Any] | None = None) -> Path:
    """Write a baseline whose table has some keys changed."""
    baseline.write(path, baseline.record(METRICS))
    table = json.loads(path.read_text("utf-8"))
    path.write_text(json.dumps(table | (change or {})), encoding="utf-8")
    return path


# law


def test_what_is_written_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "x.json"
    recorded = baseline.record(METRICS)
    assert baseline.read(path) is None
    baseline.write(path, recorded)
    assert baseline.read(path) == recorded
    first = path.read_bytes()
    baseline.write(path, recorded)
    assert path.read_bytes() == first
    assert [each.name for each in path.parent.iterdir()] == ["x.json"]


def test_recorded_values_have_six_digits_and_tolerances() -> None:
    each = baseline.record(METRICS).metrics
    assert each["tracking.rms"] == baseline.Recorded(1.23457e-3, 1e-9, baseline.RELATIVE)
    assert each["tracking.rms"].tolerance == 1e-9 + baseline.RELATIVE * 1.23457e-3
    assert each["load.share_A"].value is None
    assert not [key for key in each if key.startswith("ground")]
    assert set(ABSOLUTE) <= set(SHOWN)


def test_edited_tolerances_stay(tmp_path: Path) -> None:
    edited = {"metrics": {"tracking.rms": {"value": 1.0, "absolute": 0.5, "relative": 0.25}}}
    old = baseline.read(written(tmp_path / "x.json", edited))
    new = baseline.record(METRICS, old).metrics
    assert new["tracking.rms"] == baseline.Recorded(1.23457e-3, 0.5, 0.25)
    assert new["tracking.max"] == baseline.Recorded(2e-3, 1e-9, baseline.RELATIVE)


def test_differences_name_both_sides() -> None:
    here = baseline.record(METRICS)
    assert here.differences(METRICS["provenance"]) == []
    there = METRICS["provenance"] | {"mujoco": "3.99.0", "timestep": 0.002, "numpy": "3"}
    assert here.differences(there) == ["mujoco 3.17.0, now 3.99.0", "timestep 0.001, now 0.002"]


def test_place_is_beside_the_scenario() -> None:
    assert baseline.place("some/mine.toml") == Path("some/baselines/mine.json")
    shipped = resources.folder("scenarios") / "baselines" / "rail-hop.json"
    assert baseline.place("rail-hop") == shipped


# oracle


@pytest.mark.parametrize("name", NAMES)
def test_shipped_baselines_are_what_is_measured_here(name: str) -> None:
    recorded = baseline.read(baseline.place(name))
    assert recorded is not None
    measured = baseline.record(results()[name].metrics)
    assert recorded.metrics.keys() == measured.metrics.keys()
    for key, each in recorded.metrics.items():
        now = measured.metrics[key]
        assert (each.absolute, each.relative) == (now.absolute, now.relative)
        # another machine may move a value by 5e-8; the last of its six digits by 1e-5
        assert each.value == (None if now.value is None else pytest.approx(now.value, rel=2e-5))


def test_every_shipped_baseline_has_its_scenario() -> None:
    folder = resources.folder("scenarios") / "baselines"
    assert sorted(path.name for path in folder.iterdir()) == [f"{name}.json" for name in NAMES]


# refusal

VALUE = {"value": 1.0, "absolute": 0.0, "relative": 0.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"more": 1}, ": unknown key 'more'; known: made, metrics"),
        ({"made": {"mujoco": "3"}}, ": made.platform is missing"),
        ({"made": None}, ": made must be a table, got None"),
        ({"metrics": {}}, ": metrics must have at least one metric, got none"),
        ({"metrics": []}, ": metrics must be a table, got []"),
        ({"metrics": {"tracking.rm": VALUE}}, ": metrics: unknown key 'tracking.rm'; known: clos"),
        ({"metrics": {"tracking.rms": 1.0}}, ": metrics.tracking.rms must be a table, got 1.0"),
        (
            {"metrics": {"tracking.rms": VALUE | {"value": "1"}}},
            ": metrics.tracking.rms.value must be a number, got '1'",
        ),
        (
            {"metrics": {"tracking.rms": VALUE | {"value": float("nan")}}},
            ": metrics.tracking.rms.value must be finite, got nan",
        ),
        (
            {"metrics": {"tracking.rms": VALUE | {"relative": -0.1}}},
            ": metrics.tracking.rms.relative must be in [0, inf), got -0.1",
        ),
        (
            {"metrics": {"tracking.rms": {"value": 1.0, "absolute": 0.1}}},
            ": metrics.tracking.rms.relative is missing",
        ),
    ],
)
def test_damage_names_file_and_key(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    path = written(tmp_path / "x.json", change)
    with pytest.raises(ConfigError) as caught:
        baseline.read(path)
    assert str(caught.value).startswith(f"{path} is not a baseline{message}")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not JSON: Expecting value"),
        (b"{", "not JSON: Expecting property"),
        (b"\xff\xfe", "not JSON: "),
        (b"[" * 100_000, "not JSON: "),
        (b'{"made": 1, "metrics": 2, "made": 3}', "not JSON: the key 'made' is there twice"),
        (b"[1]", "it must be a table, got [1]"),
        (b"{}", "made must be a table, got None"),
    ],
)
def test_foreign_files_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "x.json"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        baseline.read(path)
    assert str(caught.value).startswith(f"{path} is not a baseline: {message}")


def test_places_that_cannot_be_read_or_written_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^cannot read baseline .*: Is a directory$"):
        baseline.read(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match=r"^cannot write .*: "):
        baseline.write(tmp_path / "file" / "x.json", baseline.record(METRICS))
    with pytest.raises(ConfigError, match=r"^cannot write .*: a directory is there"):
        baseline.write(tmp_path, baseline.record(METRICS))
