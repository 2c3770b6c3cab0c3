"""The report of a robot's run: what it draws, and that its numbers are the run's."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from fivebar_sim import Scenario, report, run
from fivebar_sim.errors import ArgumentError
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.report import look, robot, robot_figures
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.columns import trunk
from fivebar_sim.runs.stored import StoredRun

SHORT = ("duration=0.5", "path.ramp=0.2", "robot.servo=ideal", "limits={}", "limits.robot.falls=0")


@pytest.fixture(scope="module")
def trot() -> StoredRun:
    found = run(Scenario.load("robot-q8bot-trot", SHORT))
    return StoredRun(Path("run"), found.scenario, found.record, found.measured)


@pytest.fixture(scope="module")
def page(trot: StoredRun) -> str:
    with look.project_style():
        return robot.page(trot, robot.figures(trot))


def test_page_has_path_gait_forces_and_load_of_each_leg(page: str) -> None:
    keys = re.findall(r'<figure id="([^"]+)">', page)
    assert keys == ["from-above", "gait", "forces", "pose", "torques", "tracking-error"]
    assert "The robot q8bot of 220 g" in page


def test_table_of_legs_has_the_runs_numbers(page: str, trot: StoredRun) -> None:
    part = page.partition("How the legs shared the load")[2].partition("</table>")[0]
    rows = re.findall(r"<tr><th scope=\"row\">(.*?)</th>(.*?)</tr>", part)
    cells = {label: re.findall(r"<td[^>]*>(.*?)</td>", rest) for label, rest in rows}
    for key, label, unit in robot.ROWS:
        if key.startswith("heat"):
            assert label not in cells  # this servo has no winding
            continue
        wanted = [shown(unit, look_up(trot.metrics, f"legs.{leg}.{key}")) for leg in LEGS]
        assert [unescape(cell).replace("\xa0", " ") for cell in cells[label]] == wanted
    assert "robot.speed" in re.sub("<wbr>", "", page)
    assert "legs.FL" not in re.sub("<wbr>", "", page)  # they have their own table


def test_bars_of_the_gait_are_as_long_as_the_feet_stand(trot: StoredRun) -> None:
    drawn = robot_figures.gait(trot)
    (ax,) = drawn.figure.axes
    lengths = [
        sum(np.ptp(np.asarray(path.vertices)[:, 0]) for path in bars.get_paths())
        for bars in ax.collections
    ]
    stood = [(trot.record[f"{leg}_ground_z"] > 0.0).sum() * 1e-3 for leg in reversed(LEGS)]
    np.testing.assert_allclose(lengths, stood, atol=1e-9)


def test_outline_points_where_the_trunk_faces(trot: StoredRun) -> None:
    body = trunk(trot.record)
    assert body is not None
    (ax,) = robot_figures.from_above(trot, body).figure.axes
    outline = np.array(ax.lines[-1].get_data()).T
    nose = outline[2] - 1e3 * body.position[-1, :2]
    forward = nose / np.hypot(*nose)
    assert forward[0] == pytest.approx(1.0, abs=0.01)
    assert 0.04 < 1e-3 * np.hypot(*nose) < 0.1


def test_robots_are_not_compared(tmp_path: Path) -> None:
    stand = Scenario.load(
        "robot-q8bot-stand", ["duration=0.05", "path.seconds=0.05", "path.ramp=0.02", "limits={}"]
    )
    places = [run(stand).write(tmp_path / name) for name in ("one", "two")]
    with pytest.raises(ArgumentError, match="runs of robots are not compared yet"):
        report.write(places, tmp_path / "both.html")
