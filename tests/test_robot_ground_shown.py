"""Uneven ground where it is looked at: the recording's surface, the report's contours and words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded import read

from fivebar_sim import Result, Scenario, run
from fivebar_sim.recording.poses import Room
from fivebar_sim.report import look, robot, robot_figures
from fivebar_sim.robots.columns import trunk
from fivebar_sim.robots.ground import Ground, Rough, Steps
from fivebar_sim.runs.stored import StoredRun
from fivebar_sim.walking.shown import ground as shown_ground
from fivebar_sim.walking.shown import recording

SHORT = ("duration=0.1", "path.seconds=0.1", "path.ramp=0.05", "limits={}")
STAIR = 'scene.ground={kind="steps", height="-5 mm", length="30 mm", start="20 mm"}'


@pytest.fixture(scope="module")
def stood() -> Result:
    return run(Scenario.load("robot-q8bot-stand", [*SHORT, STAIR]))


@pytest.mark.parametrize(
    "ground", [Rough(height=0.02, cell=0.02, size=1.0), Steps(height=0.01, length=0.03)]
)
def test_drawn_triangles_lie_in_the_ground(ground: Ground) -> None:
    room = Room(np.array([-0.2, 0.0]), np.array([0.2, 0.1]), 0.1, 0.0, floor=True)
    corners = shown_ground.triangles(ground, *shown_ground.lines(ground, room))
    middles = corners.mean(axis=1)
    # Walls stand upright, and have no height of their own.
    flat = np.ptp(corners[..., 0], axis=1) > 1e-9
    heights = ground.heights(middles[:, 0], middles[:, 1])
    np.testing.assert_allclose(middles[flat, 2], heights[flat], atol=1e-12)
    assert (corners[..., 0].min(), corners[..., 0].max()) == pytest.approx((-0.3, 0.3))
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * sides[:, 2].sum() == pytest.approx(0.6 * 0.2)


def test_recording_has_the_ground_and_no_flat_floor_over_it(stood: Result, tmp_path: Path) -> None:
    recording.write(tmp_path / "a.rrd", [stood])
    _, static = read(tmp_path / "a.rrd")
    floor = static["/floor"]
    assert any(name.startswith("Mesh3D") for name in floor)
    assert not any(name.startswith("Boxes3D") for name in floor)


def test_report_says_and_draws_the_ground(stood: Result) -> None:
    stored = StoredRun(Path("run"), stood.scenario, stood.record, stood.measured)
    body = trunk(stored.record)
    assert body is not None
    with look.project_style():
        drawn = robot_figures.from_above(stored, body)
        page = robot.page(stored, [drawn])
    assert "in the scene floor with 5 steps of -5 mm, driven" in page
    assert "Thin: contours of the ground." in drawn.caption
