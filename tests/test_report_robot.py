"""The report of a robot's run: what it draws, and that its numbers are the run's."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from fivebar_sim import Scenario, report, run
from fivebar_sim.arrays import Array
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.report import look, robot, robot_figures
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.columns import trunk
from fivebar_sim.runs import stored
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
        if key.startswith(("heat", "side", "steer")):
            assert label not in cells  # this servo has no winding, these legs no S or T
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


def test_robots_are_compared_line_by_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One on a floor, and one that is held in the air: it has no trunk and no force."""
    short = ["duration=0.05", "path.seconds=0.05", "path.ramp=0.02", "limits={}"]
    read = []
    for name, own in (("floor", []), ("air", ["scene=air"])):
        found = run(Scenario.load("robot-q8bot-stand", [*short, *own]))
        read.append(StoredRun(Path(name), found.scenario, found.record, found.measured))
    with look.project_style():
        drawn = {one.key: one for one in robot.compared(read)}
    assert [*drawn] == ["from-above", "pose", "torque", "tracking-error"]
    (way,) = lines(drawn["from-above"].figure.axes[0])
    np.testing.assert_allclose(way[0][-1], 1e3 * read[0].record["trunk_x"][-1])

    torque, force = (lines(ax) for ax in drawn["torque"].figure.axes)
    motors = [read[1].record[f"{leg}_torque_{m}"][-1] for leg in LEGS for m in "AE"]
    np.testing.assert_allclose(torque[1][1][-1], 1e3 * np.sqrt(np.mean(np.square(motors))))
    feet = sum(read[0].record[f"{leg}_ground_z"][-1] for leg in LEGS)
    np.testing.assert_allclose(force[0][1][-1], feet)
    assert np.isnan(force[1][1]).all()

    # The page is put together as that of legs; its figures are drawn above.
    monkeypatch.setattr(robot, "compared", lambda runs: [])
    monkeypatch.setattr(stored, "read", lambda path: read[path.name == "air"])
    report.write([Path("floor"), Path("air")], tmp_path / "both.html")
    page = (tmp_path / "both.html").read_text()
    assert "Comparison of floor, air" in page
    assert "scene" in page.partition("What differs in the scenarios")[2].partition("</table>")[0]


def lines(ax: Axes) -> list[tuple[Array, Array]]:
    """Return x and y of the lines of the runs."""
    return [
        (np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float))
        for line in ax.lines
        if line.get_gid() == "run"
    ]
