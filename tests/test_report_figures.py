"""A report's figures and numbers against the record that they are of."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from fivebar_controllers.pd import Pd
from judged import judged
from msgspec.structs import replace

from fivebar_sim import FiveBar, kinematics, rollout
from fivebar_sim.metrics.columns import JOINT_COLUMNS
from fivebar_sim.report import axes, comparison, draw, in_plane, look, motors, numbers, over_time
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
    """A landing whose window begins after it, as that of any other run begins after the ramp."""
    run = stored("rail-landing", "duration=1.0")
    settled = replace(run.scenario.scene, drop=0.0)
    return run._replace(scenario=replace(run.scenario, scene=settled))


def test_torques_are_within_the_band_and_reach_it() -> None:
    """What the limit clips, less what the rate costs: no step passes it, saturated ones meet it."""
    run = stored("rail-landing", "duration=1.0", "servo.limit=0.4")
    room = []
    for motor in "AE":
        band = numbers.torque_band(run, motor)
        assert band is not None
        tau = run.record[f"torque_{motor}"]
        room += [tau - band[0], band[1] - tau]
    assert np.min(room) == pytest.approx(0.0, abs=1e-12)
    assert run.metrics["load"]["saturated"]["A"] > 0.0
    np.testing.assert_allclose(room[0] + room[1], 2 * 0.4, rtol=1e-12)


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
    [(None, "", 4), (0.005, "is 5 mN m at rest: dash", 6), (5.0, "5 N m at rest, outside", 4)],
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
            each(ellipse).figure.axes
            for each in (in_plane.foot_path, over_time.tracking_error, over_time.torque)
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


def test_power_of_the_window_is_the_work_of_the_metrics(ellipse: StoredRun) -> None:
    """The integral of torque times speed is the net work, to rounding."""
    window = ellipse.scenario.window
    for motor in "AE":
        work = 1e-3 * numbers.power(ellipse, motor)[window].sum()
        assert work == pytest.approx(ellipse.metrics["load"]["work"][motor]["net"], abs=1e-12)
        watts = ellipse.record[f"torque_{motor}"] * ellipse.record[f"theta_dot_{motor}"]
        # a mean over the step against the rate at its end
        assert numbers.power(ellipse, motor) == pytest.approx(watts, abs=0.05 * np.abs(watts).max())


def test_motors_are_drawn_from_the_record(ellipse: StoredRun) -> None:
    record = ellipse.record
    with look.project_style():
        angles, speeds, power = (
            each(ellipse).figure.axes for each in (motors.angles, motors.speeds, motors.power)
        )
        (parts,) = over_time.error_parts(ellipse).figure.axes
    for k, motor in enumerate("AE"):
        drawn = [np.asarray(line.get_ydata()) for line in angles[k].lines[:2]]
        np.testing.assert_allclose(np.radians(drawn[0]), record[f"theta_{motor}"])
        np.testing.assert_allclose(np.radians(drawn[1]), record[f"ctrl_{motor}"])
        speed = np.asarray(speeds[0].lines[k].get_ydata())
        np.testing.assert_allclose(speed, record[f"theta_dot_{motor}"])
        assert "mW" in power[0].get_ylabel()
        drawn = np.asarray(power[0].lines[k].get_ydata())
        np.testing.assert_allclose(drawn, 1e3 * numbers.power(ellipse, motor))
        ahead = record[f"foot_{'xz'[k]}"] - record[f"target_{'xz'[k]}"]
        np.testing.assert_allclose(np.asarray(parts.lines[k].get_ydata()), 1e3 * ahead)


def test_a_torque_drive_has_no_setpoints(ellipse: StoredRun) -> None:
    steered = ellipse.scenario.driven_by(Pd(kp=3.0))
    with look.project_style():
        drawn = motors.angles(ellipse._replace(scenario=steered))
    assert "setpoint" not in drawn.caption
    assert all(len(ax.lines) == 1 or ax.lines[1].get_gid() == "cut" for ax in drawn.figure.axes)


def test_torque_against_speed_is_inside_the_servo_s_line(ellipse: StoredRun) -> None:
    """At rest the line is the limit, at the no-load speed nothing; only the window is drawn."""
    scenario = ellipse.scenario
    peak = max(ellipse.metrics["load"]["torque_peak"].values())
    window = scenario.window
    speeds = np.stack([ellipse.record[f"theta_dot_{motor}"][window] for motor in "AE"])
    limited = replace(scenario.servo, limit=2.0 * peak, speed=3.0 * float(np.abs(speeds).max()))
    with look.project_style():
        drawn = motors.torque_speed(ellipse._replace(scenario=replace(scenario, servo=limited)))
        free = motors.torque_speed(ellipse)
    (ax,) = drawn.figure.axes
    low, high = (line for line in ax.lines if line.get_linestyle() == "-.")
    for edge, side in ((low, -1.0), (high, 1.0)):
        v, tau = (np.asarray(values) for values in edge.get_data())
        np.testing.assert_allclose(tau, 1e3 * (side * 2.0 * peak - 2.0 * peak / limited.speed * v))
    for motor, line in zip("AE", ax.lines, strict=False):
        v, tau = (np.asarray(values) for values in line.get_data())
        assert len(v) == scenario.window.stop - scenario.window.start
        np.testing.assert_allclose(
            np.sort(v), np.sort(ellipse.record[f"theta_dot_{motor}"][window])
        )
        assert (np.abs(tau + 1e3 * 2.0 * peak / limited.speed * v) < 2e3 * peak).all()
    assert "no limit" in free.caption


def test_axes_are_scaled_by_the_window_and_what_is_cut_is_marked(landing: StoredRun) -> None:
    """The landing at 0.1 s is before the window: its peaks are told, and hide nothing behind."""
    window = landing.scenario.window
    with look.project_style():
        figures = [
            over_time.tracking_error(landing),
            over_time.error_parts(landing),
            over_time.torque(landing),
            motors.angles(landing),
            motors.speeds(landing),
            motors.power(landing),
        ]
    for drawn in figures:
        assert axes.CUT in drawn.caption
        for ax in drawn.figure.axes:
            bottom, top = ax.get_ylim()
            said = [float(text.get_text()) for text in ax.texts]
            marks = [line for line in ax.lines if line.get_gid() == "cut"]
            assert len(said) == len(marks) > 0
            lines = [line for line in ax.lines if len(np.asarray(line.get_xdata())) > 100]
            values = np.concatenate([np.asarray(line.get_ydata()) for line in lines])
            inside = np.concatenate([np.asarray(line.get_ydata())[window] for line in lines])
            assert bottom <= inside.min() <= inside.max() <= top
            for peak, edge in ((values.max(), top), (values.min(), bottom)):
                beyond = peak > top or peak < bottom
                assert (pytest.approx(peak, rel=5e-3) in said) == beyond, edge


def test_only_what_is_beyond_the_axes_is_marked(ellipse: StoredRun) -> None:
    rows = len(ellipse.record["time"])
    gap = np.full(rows, np.nan)
    for high, low, said in ((1.0, -1.0, []), (1.25, -1.0, ["1.25"]), (1.0, -2e4, ["-20000"])):
        with look.project_style():
            _, (ax,) = draw.panels(1, height=2.0)
            ax.set_ylim(-1.0, 1.0)
            assert axes.mark_cut(ax, ellipse, gap, np.linspace(low, high, rows)) == bool(said)
        assert [text.get_text() for text in ax.texts] == said


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


def test_letters_of_the_joints_are_apart(ellipse: StoredRun) -> None:
    """Also A and E of a coaxial leg; A is to the left of E."""
    coaxial = replace_leg(ellipse, FiveBar(L1=0.04, L2=0.06, L3=0.06, L4=0.04, L5=0.0))
    for run in (ellipse, coaxial):
        with look.project_style():
            figure = in_plane.leg_moments(run).figure
            figure.canvas.draw()
        letters = {text.get_text(): text.get_window_extent() for text in figure.axes[0].texts}
        assert list(letters) == list("ABCDE")
        for one, other in itertools.combinations(letters.values(), 2):
            assert not one.overlaps(other)
        assert letters["A"].x1 < letters["E"].x0


def replace_leg(run: StoredRun, leg: FiveBar) -> StoredRun:
    """Return a run that holds another leg in its rest pose."""
    record = dict(run.record)
    for name, angle in zip(JOINT_COLUMNS, kinematics.home(leg), strict=True):
        record[name] = np.full(len(record["time"]), float(angle))
    return run._replace(scenario=replace(run.scenario, leg=leg), record=record)


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


def test_overlaid_torques_are_scaled_by_the_windows(ellipse: StoredRun, landing: StoredRun) -> None:
    """The landing's torque before its window is five times what is measured."""
    with look.project_style():
        drawn = {one.key: one for one in comparison.figures([landing, ellipse])}
    ax = drawn["torque"].figure.axes[0]
    window = landing.scenario.window
    measured = 1e3 * np.abs(landing.record["torque_A"][window]).max()
    assert measured < ax.get_ylim()[1] < 1.2 * measured
    assert axes.CUT in drawn["torque"].caption
    assert "1129" in [text.get_text() for text in ax.texts]
    assert axes.CUT not in drawn["ground"].caption
    assert drawn["ground"].figure.axes[0].get_ylim()[1] > landing.record["ground_z"].max()


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
