"""A report's figures and numbers against the record that they are of."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from judged import judged
from msgspec.structs import replace

from fivebar_sim import rollout
from fivebar_sim.report import comparison, in_plane, look, numbers, over_time
from fivebar_sim.runs.stored import StoredRun
from fivebar_sim.scenario import Scenario


def stored(name: str, *settings: str) -> StoredRun:
    """Return a run as if it was read back."""
    result = rollout.run(Scenario.load(name, settings))
    return StoredRun(Path(name), result.scenario, result.record, result.measured)


@pytest.fixture(scope="module")
def ellipse() -> StoredRun:
    return stored("classic-ellipse", "duration=0.8")


@pytest.fixture(scope="module")
def landing() -> StoredRun:
    return stored("rail-landing", "duration=1.0")


def test_torques_are_within_the_band_and_reach_it() -> None:
    """What the limit clips, less what the rate costs: no step passes it, saturated ones meet it."""
    run = stored("classic-ellipse", "duration=0.8", "servo.limit=0.004")
    room = []
    for motor in "AE":
        band = numbers.torque_band(run, motor)
        assert band is not None
        tau = run.record[f"torque_{motor}"]
        room += [tau - band[0], band[1] - tau]
    assert np.min(room) == pytest.approx(0.0, abs=1e-12)
    assert run.metrics["load"]["saturated"]["A"] > 0.0
    np.testing.assert_allclose(room[0] + room[1], 2 * 0.004, rtol=1e-12)


def test_band_of_a_motor_is_its_torque_speed_line(ellipse: StoredRun) -> None:
    """All of the torque at rest; at the no-load speed none onwards, and twice it to brake."""
    assert numbers.torque_band(ellipse, "A") is None
    scenario = ellipse.scenario
    motor = replace(scenario, servo=replace(scenario.servo, limit=0.3, speed=20.0))
    record = {**ellipse.record, "theta_dot_A": np.array([0.0, 20.0, -20.0])}
    band = numbers.torque_band(ellipse._replace(scenario=motor, record=record), "A")
    assert band is not None
    np.testing.assert_allclose(band, [[-0.3, -0.6, 0.0], [0.3, 0.0, 0.6]], atol=1e-15)


@pytest.mark.parametrize(
    ("limit", "said", "lines"),
    [(None, "", 4), (0.005, "is 5 mN m at rest: dash", 6), (5.0, "5000 mN m at rest, outside", 4)],
)
def test_a_limit_is_drawn_where_it_is_near(
    ellipse: StoredRun, limit: float | None, said: str, lines: int
) -> None:
    scenario = ellipse.scenario
    limited = replace(scenario, servo=replace(scenario.servo, limit=limit))
    with look.project_style():
        drawn = over_time.torque(ellipse._replace(scenario=limited))
    assert said in drawn.caption
    assert ("limit" in drawn.caption) == bool(said)
    assert [len(ax.lines) for ax in drawn.figure.axes] == [lines, lines]


def test_figures_show_the_record(ellipse: StoredRun) -> None:
    """Foot and target, error, RMS and percentile, peak: all in the figure's units."""
    record = ellipse.record
    window = ellipse.scenario.window
    error = np.hypot(record["foot_x"] - record["target_x"], record["foot_z"] - record["target_z"])
    with look.project_style():
        path, tracking, torque = (
            draw(ellipse).figure.axes
            for draw in (in_plane.foot_path, over_time.tracking_error, over_time.torque)
        )
    target, *pieces, start = path[0].lines
    np.testing.assert_allclose(np.asarray(target.get_xdata()), 1e3 * record["target_x"])
    np.testing.assert_allclose(np.asarray(target.get_ydata()), 1e3 * record["target_z"])
    for axis, column in enumerate(("foot_x", "foot_z")):
        joined = np.concatenate([np.asarray(piece.get_data()[axis])[1:] for piece in pieces])
        np.testing.assert_allclose(joined, 1e3 * record[column][1:])
        assert np.asarray(start.get_data()[axis])[0] == 1e3 * record[column][0]
    line, rms, most = tracking[0].lines
    np.testing.assert_allclose(np.asarray(line.get_ydata()), 1e3 * error)  # few rows: all are drawn
    assert np.asarray(rms.get_ydata())[0] == pytest.approx(
        1e3 * np.sqrt(np.mean(error[window] ** 2))
    )
    below = 1e3 * error[window] <= np.asarray(most.get_ydata())[0]
    assert below.mean() == pytest.approx(0.95, abs=2 / len(below))
    for ax, motor in zip(torque, "AE", strict=True):
        ring = np.asarray(ax.lines[3].get_ydata())
        assert abs(ring[0]) == pytest.approx(1e3 * ellipse.metrics["load"]["torque_peak"][motor])


def test_share_is_undefined_without_load(ellipse: StoredRun) -> None:
    record = dict(ellipse.record)
    for motor in "AE":
        record[f"torque_{motor}"] = np.where(record["time"] < 0.4, 0.0, 0.003)
    share = numbers.share(ellipse._replace(record=record))
    assert np.isnan(share[record["time"] < 0.37]).all()
    np.testing.assert_allclose(share[record["time"] > 0.43], 0.5)


def test_moments_are_evenly_along_the_way(ellipse: StoredRun, landing: StoredRun) -> None:
    """A period where the foot moves in it; the drop and all where it then stands still."""
    for run in (ellipse, landing):
        rows = in_plane.moments(run)
        assert len(rows) == 12
        foot = np.stack([run.record["foot_x"], run.record["foot_z"]], axis=-1)
        steps = np.hypot(*np.diff(foot, axis=0).T)
        ways = [steps[a:b].sum() for a, b in itertools.pairwise(rows)]
        np.testing.assert_allclose(ways, np.mean(ways), atol=2.0 * steps.max())
    times = ellipse.record["time"][in_plane.moments(ellipse)]
    np.testing.assert_allclose(times[[0, -1]], [0.251, 0.751], atol=0.002)
    assert landing.record["time"][in_plane.moments(landing)[0]] < 0.15


def test_ground_is_drawn_only_where_there_is_one(ellipse: StoredRun, landing: StoredRun) -> None:
    with look.project_style():
        assert over_time.ground_contact(ellipse) is None
        drawn = over_time.ground_contact(landing)
    assert drawn is not None
    force, height = drawn.figure.axes
    np.testing.assert_allclose(np.asarray(force.lines[0].get_ydata()), landing.record["ground_z"])
    assert np.max(np.asarray(height.lines[0].get_ydata())) == pytest.approx(
        1e3 * landing.metrics["ground"]["foot_height_max"]
    )


@pytest.mark.parametrize(
    ("key", "first", "value", "said"),
    [
        ("tracking.rms", 2e-3, 1e-3, "-50 %"),
        ("tracking.rms", 2e-3, 2e-3, "same"),
        ("tracking.rms", 2e-3, 4e-2, "20 times"),
        ("tracking.rms", 0.0, 1e-3, "from 0"),
        ("load.work.A.net", -1e-3, 1e-3, "+200 %"),
        ("load.share_A", 0.5, 0.62, "+12 points"),
        ("load.share_A", None, 0.62, "-"),
        ("load.share_A", None, None, "same"),
    ],
)
def test_difference(
    ellipse: StoredRun, key: str, first: float | None, value: float | None, said: str
) -> None:
    def valued(number: float | None) -> StoredRun:
        return ellipse._replace(measured=judged({key: number}))

    assert comparison.difference(key, valued(value), valued(first)) == said


def test_overlaid_gaps_are_on_a_scale_by_powers(ellipse: StoredRun, landing: StoredRun) -> None:
    runs = [ellipse, landing._replace(path=Path("_two")), ellipse._replace(path=Path("three"))]
    with look.project_style():
        drawn = {one.key: one.figure for one in comparison.figures(runs)}
    ax = drawn["loop-gap"].axes[0]
    assert ax.get_yscale() == "log"
    assert ax.get_ylim()[1] > 1e6 * max(float(run.record["gap"].max()) for run in runs)
    for figure in drawn.values():
        (legend,) = figure.legends
        assert [text.get_text() for text in legend.get_texts()] == comparison.names(runs)
        colours = [line.get_color() for line in figure.axes[0].lines if line.get_gid() == "run"]
        assert colours == [look.colour(f"run-{k}") for k in (1, 2, 3)]
