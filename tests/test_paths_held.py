"""Step and lines: from point to point in time, and then held."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim.paths import Lines, Step

POINTS = ((0.01, -0.08), (-0.02, -0.07), (-0.02, -0.09))
STEP = Step(start=(-0.02, -0.08), stop=(0.01, -0.07), lift=0.02, seconds=0.5)


# law


@given(st.lists(st.floats(0.1, 5.0), min_size=2, max_size=5), st.floats(0.0, 1.0))
def test_lines_are_straight_and_each_takes_its_time(seconds: list[float], part: float) -> None:
    count = len(seconds) + 1
    points = np.random.default_rng(count).uniform(-0.1, 0.1, (count, 2))
    path = Lines(points=tuple(map(tuple, points.tolist())), seconds=tuple(seconds))
    ends = np.concatenate([[0.0], np.cumsum(seconds)])
    assert path.rest == pytest.approx(ends[-1], rel=1e-15)
    now = path.at(ends[:-1] + part * np.array(seconds))
    between = points[:-1] + part * np.diff(points, axis=0)
    np.testing.assert_allclose(now.position, between, rtol=0.0, atol=1e-14)
    np.testing.assert_array_equal(now.acceleration, 0.0)
    on = path.at(ends[:-1] + 0.5 * np.array(seconds))
    speed = np.diff(points, axis=0) / np.array(seconds)[:, None]
    np.testing.assert_allclose(on.velocity, speed, rtol=1e-12)


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0.0, 0.1), st.floats(0.1, 5.0))
def test_step_is_half_way_and_lifted_at_half_time(
    x: float, z: float, lift: float, seconds: float
) -> None:
    path = Step(start=(0.01, -0.08), stop=(x, z), lift=lift, seconds=seconds)
    ends = path.at([0.0, seconds])
    np.testing.assert_array_equal(ends.position, [(0.01, -0.08), (x, z)])
    np.testing.assert_array_equal([ends.velocity, ends.acceleration], 0.0)
    middle = path.at(0.5 * seconds)
    np.testing.assert_allclose(
        middle.position, (0.5 * (x + 0.01), 0.5 * (z - 0.08) + lift), rtol=0.0, atol=1e-15
    )
    # 15/8 of the mean speed: the minimum-jerk peak
    mean = np.array([x - 0.01, z + 0.08]) / seconds
    np.testing.assert_allclose(middle.velocity, 15.0 / 8.0 * mean, rtol=0.0, atol=1e-13)


# edge


def test_velocity_of_lines_is_that_of_the_next_line_at_a_point() -> None:
    path = Lines(points=POINTS, seconds=0.5)
    assert path.rest == 1.0
    before = path.at(0.5 - 1e-12)
    at = path.at(0.5)
    np.testing.assert_array_equal(at.position, POINTS[1])
    np.testing.assert_allclose(before.velocity, (-0.06, 0.02), rtol=1e-12)
    np.testing.assert_allclose(at.velocity, (0.0, -0.04), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(path.at(0.0).velocity, (-0.06, 0.02), rtol=1e-12)  # at speed
    np.testing.assert_array_equal(path.at(1.0).velocity, 0.0)


def test_a_line_of_no_length_waits() -> None:
    path = Lines(points=(POINTS[0], POINTS[0], POINTS[1]), seconds=0.5)
    np.testing.assert_array_equal(path.at([0.0, 0.2, 0.4]).position, [POINTS[0]] * 3)


def test_lists_are_kept_as_tuples() -> None:
    lists: Any = [[0, -1], [1, 0]]
    seconds: Any = [2]
    path = Lines(points=lists, seconds=seconds)
    assert (path.points, path.seconds) == (((0.0, -1.0), (1.0, 0.0)), (2.0,))
    assert hash(path) == hash(Lines(points=path.points, seconds=path.seconds))


def test_step_without_lift_is_straight() -> None:
    path = Step(start=(0.0, -0.08), stop=(0.02, -0.07), lift=0.0, seconds=0.5)
    x, z = path.at(np.linspace(0.0, 0.5, 101)).position.T
    np.testing.assert_allclose(z, -0.08 + 0.5 * x, rtol=0.0, atol=1e-16)
    assert np.all(np.diff(x) > 0.0)


def test_step_rises_above_its_line() -> None:
    time = np.linspace(0.0, 0.5, 1001)
    foot = STEP.at(time).position
    line = STEP.start[1] + (foot[:, 0] + 0.02) / 3.0
    height = foot[:, 1] - line
    assert np.argmax(height) == 500
    assert np.max(height) == pytest.approx(0.02, rel=1e-12)
    assert np.all(height >= -1e-16)
