"""Foot paths: followed without jumps as a plain loop would, and their singular points reported."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from poses import RIGID

from fivebar_sim import kinematics
from fivebar_sim.analysis.following import follow, path_report
from fivebar_sim.analysis.singularity import distances_at
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.planar import unit

CLASSIC = FiveBar()
COAXIAL = FiveBar(0.112, 0.199, 0.199, 0.112, 0.0, 0.0325)
TURN = np.linspace(0.0, 2.0 * np.pi, 201)
ELLIPSE = np.array([0.0, -0.072]) + np.array([0.02, 0.008]) * unit(TURN)


def line(start: tuple[float, float], end: tuple[float, float], count: int) -> Array:
    return np.linspace(start, end, count)


# law


@pytest.mark.parametrize("mode", MODES)
def test_followed_angles_put_the_foot_on_the_path_in_the_first_mode(mode: Mode) -> None:
    theta0 = kinematics.inverse(CLASSIC, ELLIPSE[0], mode)
    theta, modes, changed = follow(CLASSIC, ELLIPSE, theta0)
    np.testing.assert_array_equal(modes, np.broadcast_to(mode, (201, 2)))
    assert changed.tolist() == []
    assert np.abs(np.diff(theta, axis=0)).max() < 0.05
    expected = np.unwrap(kinematics.inverse(CLASSIC, ELLIPSE, mode), axis=0)
    np.testing.assert_allclose(theta, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("turns", [-3, 0, 2])
def test_angles_go_on_past_half_a_turn(turns: int) -> None:
    """A coaxial leg goes round its motors; both angles go round with it, from where they were."""
    foot = 0.25 * unit(2.0 * TURN)
    theta0 = kinematics.inverse(COAXIAL, foot[0]) + 2.0 * np.pi * turns + 0.1
    theta = follow(COAXIAL, foot, theta0).theta
    np.testing.assert_allclose(theta[0], theta0 - 0.1, rtol=0, atol=1e-13)
    np.testing.assert_allclose(theta - theta[0], 2.0 * np.column_stack([TURN, TURN]), atol=1e-12)


# oracle


def test_follow_is_a_plain_loop_of_the_nearest_solutions(rng: np.random.Generator) -> None:
    changes = 0
    for _ in range(2):
        path = rng.uniform(-1.0, 1.0, (300, 2)) * RIGID.size  # no walk: to meet all choices
        path = path[np.isfinite(kinematics.inverse_all(RIGID, path)).any(axis=(-1, -2))]
        loop = []
        now = rng.uniform(-5.0, 5.0, 2)
        for foot in path:
            now = kinematics.inverse_nearest(RIGID, foot, now)
            loop.append(now)
        followed = follow(RIGID, path, loop[0], step_max=7.0)
        np.testing.assert_allclose(followed.theta, loop, rtol=0, atol=1e-12)
        for mode in MODES:
            rows = (followed.mode == mode).all(axis=-1)
            assert rows.any()
            again = kinematics.inverse(RIGID, path[rows], mode)
            np.testing.assert_allclose(unit(followed.theta[rows]), unit(again), rtol=0, atol=1e-12)
        changes += len(followed.changed)
    assert changes > 100


def test_report_is_a_scan_of_the_distances() -> None:
    time = np.linspace(2.0, 4.0, len(ELLIPSE))
    report = path_report(CLASSIC, ELLIPSE, time)
    d = distances_at(CLASSIC, ELLIPSE)
    for name in d._fields:
        each = getattr(d, name)
        closest = getattr(report, name)
        np.testing.assert_array_equal(getattr(report.distances, name), each)
        worst = min(range(len(each)), key=lambda i, each=each: abs(each[i]))
        assert closest == (each[worst], time[worst], worst, math.inf)
        assert type(closest.distance) is type(closest.time) is float
        assert type(closest.point) is int


# edge


def through_the_edge(sweep: float) -> Array:
    """Return a path to the edge of A's reach, met at t = 0 of -1..1, that turns by `sweep` t."""
    A = kinematics.bases(CLASSIC)[0]
    t = np.linspace(-1.0, 1.0, 401)
    return A + (0.1 - 0.004 * t**2)[:, None] * unit(-1.0 + sweep * t)


@pytest.mark.parametrize("s_E", [-1, 1])
@pytest.mark.parametrize("s_A", [-1, 1])
@pytest.mark.parametrize("sweep", [-0.3, 0.3])
def test_from_the_edge_of_reach_the_leg_goes_on_in_the_nearest_mode(
    sweep: float, s_A: int, s_E: int
) -> None:
    """theta_A = alpha + s_A beta, alpha ~ sweep t, beta ~ 0.35 |t|: s_A is against the sweep."""
    foot = through_the_edge(sweep)
    goes = -int(np.sign(sweep))
    came = follow(CLASSIC, foot, kinematics.inverse(CLASSIC, foot[0], (s_A, s_E)))
    assert came.mode[:200].tolist() == [[s_A, s_E]] * 200
    assert came.mode[201:].tolist() == [[goes, s_E]] * 200
    changed = [i for i in range(1, 401) if (came.mode[i] != came.mode[i - 1]).any()]
    assert came.changed.tolist() == changed
    assert len(changed) == (s_A != goes)
    assert np.abs(np.diff(came.theta, axis=0)).max() < 0.01

    time = np.linspace(0.0, 1.0, 401)
    report = path_report(CLASSIC, foot, time, mode=came.mode)
    assert report.side_A.point == 200
    assert abs(report.side_A.distance) < 1e-9
    assert report.side_A.crossing == pytest.approx(0.5, abs=1e-9)
    assert report.side_E.crossing == math.inf
    np.testing.assert_array_equal(np.sign(report.distances.side_A[:200]), s_A)
    np.testing.assert_array_equal(np.sign(report.distances.side_A[201:]), goes)


def test_equally_near_solutions_keep_the_mode() -> None:
    """Straight to the edge and straight back: both modes are equally near from there on."""
    foot = through_the_edge(0.0)
    for mode in MODES:
        theta0 = kinematics.inverse(CLASSIC, foot[0], mode)
        followed = follow(CLASSIC, foot, theta0)
        assert followed.changed.tolist() == []
        np.testing.assert_allclose(followed.theta[-1], theta0, rtol=0, atol=1e-12)


def test_path_through_the_flat_loop_is_timed_between_its_points() -> None:
    """Up the axis of symmetry B, C and D are in line where C is as high as the knees."""
    leg = FiveBar(0.03, 0.04, 0.04, 0.03, 0.06)

    def height(z: float) -> float:
        theta = kinematics.inverse(leg, (0.0, z))
        return float(kinematics.knees(leg, theta)[0][1]) - z

    low = -0.04
    high = -0.0266
    assert height(low) * height(high) < 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if height(low) * height(middle) > 0.0 else (low, middle)
    errors = []
    for count in (20, 40):
        foot = line((0.0, -0.04), (0.0, -0.0266), count)
        report = path_report(leg, foot, np.linspace(0.0, 1.0, count))
        expected = (low + 0.04) / (0.04 - 0.0266)
        errors.append(abs(report.loop.crossing - expected))
        assert report.side_A.crossing == report.side_E.crossing == math.inf
        assert report.loop.distance * report.distances.loop[0] != 0.0
        flips = [i for i, (a, b) in enumerate(pairwise(report.distances.loop)) if a * b < 0.0]
        assert len(flips) == 1
        assert flips[0] <= report.loop.crossing * (count - 1) <= flips[0] + 1
    assert max(errors) < 2e-3  # the chord of a curve: of the second order in 1 / count


def test_first_of_several_crossings_is_reported() -> None:
    leg = FiveBar(0.03, 0.04, 0.04, 0.03, 0.06)
    there = line((0.0, -0.04), (0.0, -0.0266), 30)
    once = path_report(leg, there, np.arange(30.0))
    back = np.concatenate([there, there[-2::-1]])
    twice = path_report(leg, back, np.arange(59.0))
    assert twice.loop.crossing == once.loop.crossing < 30.0


def test_one_point_is_a_path() -> None:
    theta = kinematics.inverse(CLASSIC, ELLIPSE[0])
    followed = follow(CLASSIC, ELLIPSE[:1], theta)
    np.testing.assert_array_equal(followed.theta, theta[None])
    assert followed.mode.tolist() == [[-1, 1]]
    report = path_report(CLASSIC, ELLIPSE[:1], [3.0])
    assert report.loop[1:] == (3.0, 0, math.inf)


def test_coaxial_leg_with_both_knees_on_one_side_is_always_singular() -> None:
    foot = line((0.2, 0.0), (0.2, 0.1), 5)
    report = path_report(FiveBar(0.09, 0.162, 0.162, 0.09, 0.0), foot, range(5), mode=(1, 1))
    assert report.loop.distance == 0.0
    assert report.loop.crossing == 0.0


# refusal


def test_jumps_are_refused() -> None:
    apart = np.concatenate([ELLIPSE[:10], -ELLIPSE[10:]])
    with pytest.raises(UnreachableError, match=r"must be within 0\.5 rad .* step of") as info:
        follow(CLASSIC, apart, kinematics.inverse(CLASSIC, apart[0]))
    assert info.value.index == (10,)
    steps = np.abs(np.diff(kinematics.inverse(CLASSIC, ELLIPSE), axis=0)).max()
    theta0 = kinematics.inverse(CLASSIC, ELLIPSE[0])
    follow(CLASSIC, ELLIPSE, theta0, step_max=1.001 * steps)
    with pytest.raises(UnreachableError):
        follow(CLASSIC, ELLIPSE, theta0, step_max=0.999 * steps)


def test_points_out_of_reach_are_named() -> None:
    path = ELLIPSE.copy()
    path[[7, 9]] = (0.5, 0.0), (math.nan, 0.0)
    theta0 = kinematics.inverse(CLASSIC, path[0])
    for call in (
        lambda: follow(CLASSIC, path, theta0),
        lambda: path_report(CLASSIC, path, TURN),
        lambda: path_report(CLASSIC, path, TURN, mode=np.broadcast_to((1, -1), (201, 2))),
    ):
        with pytest.raises(UnreachableError, match=r"out of reach: \|AF\| .* at index \(7,\)") as e:
            call()
        assert e.value.index == (7,)


def test_wrong_arguments_are_refused() -> None:
    theta0 = kinematics.inverse(CLASSIC, ELLIPSE[0])
    for foot in (ELLIPSE[0], ELLIPSE[None], np.zeros((0, 2))):
        with pytest.raises(ArgumentError, match=r"foot must have shape \(N, 2\)"):
            follow(CLASSIC, foot, theta0)
        with pytest.raises(ArgumentError, match=r"foot must have shape \(N, 2\)"):
            path_report(CLASSIC, foot, TURN)
    with pytest.raises(ArgumentError, match=r"theta0 must have shape \(2,\), got \(1, 2\)"):
        follow(CLASSIC, ELLIPSE, theta0[None])
    with pytest.raises(ArgumentError, match="finite"):
        follow(CLASSIC, ELLIPSE, (math.nan, 0.0))
    for step_max in (0.0, -1.0, math.nan, math.inf, True):
        with pytest.raises(ArgumentError, match="step_max must be in"):
            follow(CLASSIC, ELLIPSE, theta0, step_max=step_max)
    for time in (TURN[:-1], TURN[:, None], 0.0):
        with pytest.raises(ArgumentError, match=r"time must have shape \(201,\)"):
            path_report(CLASSIC, ELLIPSE, time)
    for time in (TURN[::-1], 0.0 * TURN, TURN * math.nan, np.where(TURN > 6.0, math.inf, TURN)):
        with pytest.raises(ArgumentError, match="time must be finite and rising"):
            path_report(CLASSIC, ELLIPSE, time)
    with pytest.raises(ArgumentError, match="time must be numbers"):
        path_report(CLASSIC, ELLIPSE, ["a"] * 201)
    with pytest.raises(ArgumentError, match=r"mode must be one of .*, got \(0, 1\)"):
        path_report(CLASSIC, ELLIPSE, TURN, mode=(0, 1))
    with pytest.raises(ArgumentError, match=r"mode must have shape \(2,\) or \(201, 2\)"):
        path_report(CLASSIC, ELLIPSE, TURN, mode=(1, 1, 1))
