"""Runs without metrics.json: measured anew from the record, the numbers are those of the run."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
import run_directories
import shipped
from sealed import seal
from test_recomputed import EQUAL, differing, numbers

from fivebar_sim import rollout
from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.files import resources
from fivebar_sim.metrics.measured import Judged
from fivebar_sim.report import comparison, html, look, single
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.rollout import Result
from fivebar_sim.runs import checksums, directory, stored
from fivebar_sim.runs.anew import beside, robots
from fivebar_sim.scenario import Scenario
from fivebar_sim.walking.plan import plan_scenario

SOME = ("payload-ellipse", "q8bot-trot", "rail-landing", "rail-hop")
"""Pushes, a CSV, a landing, a ground under `implicitfast`."""

ROBOTS = sorted(name for name in resources.shipped("scenarios") if name.startswith("robot-"))

OF_ROBOTS = 1e-6
"""The same of a robot's energies: what of its contacts the solver leaves unsolved is no force."""


def _bare(result: Result, place: Path) -> Path:
    """Return a folder with no more than record and scenario of a run."""
    place.mkdir()
    (place / "scenario.toml").write_text(directory.as_toml(result.scenario), encoding="utf-8")
    for name, content in result.scenario.files.items():
        (place / name).write_bytes(content)
    others = ["scenario.toml", *result.scenario.files]
    directory.write_record(place, result.record, others, beside.written(result.measured))
    return place


def _check_alike(anew: Judged, first: Judged, equal: float) -> None:
    """Fail unless two runs measured the same; energies as a part of all that was turned over."""
    assert anew.verdict == first.verdict
    assert anew.provenance == first.provenance
    found = dict(_flat("", anew.table))
    said = dict(_flat("", first.table))
    assert found.keys() == said.keys()
    for key, value in said.items():
        # Copies of the metrics: whether they hold is in the verdict.
        if key.startswith("limits."):
            continue
        if not isinstance(value, float | int) or isinstance(value, bool):
            assert found[key] == value, key
            continue
        # Of a guard that looks at energy the value is such a part already.
        is_part = key.startswith("guards.") or key == "energy.imbalance"
        turnover = said["energy.turnover"] if key.startswith("energy.") else None
        scale = 1.0 if is_part else turnover
        most = equal / EQUAL if key.startswith(("energy.", "guards.")) else 1.0
        assert differing(numbers(found[key]), numbers(value), most * (scale or abs(value))) == [], (
            key
        )


def _flat(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the values of nested tables and lists."""
    if not isinstance(value, dict | list):
        yield prefix, value
        return
    pairs = value.items() if isinstance(value, dict) else enumerate(value)
    for key, part in pairs:
        yield from _flat(f"{prefix}.{key}".lstrip("."), part)


@pytest.mark.parametrize("name", SOME)
def test_record_and_scenario_are_enough(name: str, tmp_path: Path) -> None:
    result = rollout.run(shipped.shortened(name))
    read = stored.read(_bare(result, tmp_path / "run"))
    assert read.anew
    _check_alike(read.measured, result.measured, EQUAL)


@pytest.mark.long
@pytest.mark.parametrize("name", shipped.NAMES)
def test_record_and_scenario_of_all_are_enough(name: str, tmp_path: Path) -> None:
    result = shipped.results()[name]
    _check_alike(stored.read(_bare(result, tmp_path / "run")).measured, result.measured, EQUAL)


def test_those_of_a_robot_are_enough(tmp_path: Path) -> None:
    """With what a record has no column of besides, pushes, and motors of its hips."""
    hips = 'robot.hips.steering={kp=4, kd=0.03, mass="10 g"}'
    steered = "gait.steering={FL=0.2, FR=0.2, RL=0, RR=0}"
    push = "push=[{time=0.7, duration=0.02, force=[0, 2, 0], at=[0, 0, 0.02]}]"
    settings = ["duration=1.1", "robot.mass=0.3", hips, steered, push]
    result = rollout.run(Scenario.load("robot-q8bot-turn", settings))
    read = stored.read(_bare(result, tmp_path / "run"))
    _check_alike(read.measured, result.measured, OF_ROBOTS)


@pytest.mark.long
@pytest.mark.parametrize("name", ROBOTS)
def test_those_of_all_robots_are_enough(name: str, tmp_path: Path) -> None:
    result = rollout.run(Scenario.load(name))
    read = stored.read(_bare(result, tmp_path / "run"))
    _check_alike(read.measured, result.measured, OF_ROBOTS)


def test_uneven_ground_cannot_be_measured_anew() -> None:
    scenario = Scenario.load("robot-q8bot-stand", ["scene.ground=rough"])
    assert isinstance(scenario, RobotScenario)
    planned = plan_scenario(scenario)
    with pytest.raises(RunDirectoryError, match="the forces, but not where they act"):
        robots.walk(planned, {}, np.zeros(0, dtype=bool))


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _bare(run_directories.a_result(), tmp_path_factory.mktemp("runs") / "bare")


def test_the_page_says_that_its_numbers_are_computed_anew(bare: Path) -> None:
    read = stored.read(bare)
    with look.project_style():
        pages = [single.page(run, []) for run in (read, read._replace(anew=False))]
        both = comparison.page([read._replace(path=Path("whole"), anew=False), read], [])
    assert [html.text(single.ANEW) in page for page in pages] == [True, False]
    assert "The metrics of bare are computed anew from the record" in both


def _older(file: Path) -> None:
    """Take away what is beside the columns."""
    table = pyarrow.parquet.read_table(file)
    kept = {checksums.KEY: (table.schema.metadata or {})[checksums.KEY]}
    pyarrow.parquet.write_table(table.replace_schema_metadata(kept), file)


def _of_no_run(file: Path) -> None:
    """Change a column, and seal it."""
    table = pyarrow.parquet.read_table(file)
    column = pyarrow.array(1.001 * table["foot_x"].to_numpy())
    table = table.set_column(table.column_names.index("foot_x"), "foot_x", column)
    pyarrow.parquet.write_table(table, file)
    seal(file.parent)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (_older, "is missing, and .* is of a version that did not keep what measuring anew needs"),
        (_of_no_run, "the record cannot be measured: its column foot_x does not follow from the"),
    ],
)
def test_what_cannot_be_measured_anew_is_refused(
    bare: Path, tmp_path: Path, damage: Callable[[Path], None], said: str
) -> None:
    place = shutil.copytree(bare, tmp_path / "run")
    damage(place / "rollout.parquet")
    with pytest.raises(RunDirectoryError, match=said):
        stored.read(place)


def test_unsolved_steps_are_counted_from_the_first_on() -> None:
    guards = [SimpleNamespace(name="solver", value=3.0, time=0.005)]
    measured: Any = SimpleNamespace(provenance={"seed": 0, "git": None}, guards=guards)
    kept = beside.read(beside.written(measured))
    assert kept is not None
    assert kept.provenance == measured.provenance
    steps = kept.steps(10, 1e-3)
    assert steps.sum() == 3
    assert int(np.argmax(steps)) == 4
    assert beside.read({beside.KEY: b"{}"}) is None
    assert beside.read(None) is None
