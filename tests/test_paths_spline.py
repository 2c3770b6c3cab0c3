"""Cubic splines: those of scipy to rounding, whatever the knots, between them and beyond."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim.paths.spline import Spline

ENDS = {True: "periodic", False: "not-a-knot"}


def points(rng: np.random.Generator, count: int, periodic: bool) -> np.ndarray:
    """Return random points of a plane; the last one of a periodic curve is its first."""
    drawn = rng.normal(size=(count, 2))
    if periodic:
        drawn[-1] = drawn[0]
    return drawn


def assert_as_scipy(time: np.ndarray, point: np.ndarray, at: np.ndarray, periodic: bool) -> None:
    """Compare the curve and its derivatives, each as far as its own size and the knots allow."""
    from scipy.interpolate import CubicSpline

    expected = CubicSpline(time, point, bc_type=ENDS[periodic])
    found = Spline.through(time, point, periodic=periodic).evaluate(at)
    length = np.diff(time)
    # Rounding of a difference of points grows as it is divided by a short piece.
    steep = np.ptp(point) / length.min()
    for order, value in enumerate(found):
        scale = steep / length.min() ** (order - 1)
        np.testing.assert_allclose(value, expected(at, order), rtol=0.0, atol=2e-14 * scale)


@pytest.mark.parametrize("periodic", [False, True])
def test_spline_is_that_of_scipy(rng: np.random.Generator, periodic: bool) -> None:
    for count in (*range(3 if periodic else 2, 10), 40, 41, 200):
        for longest in (1.0, 1.5, 30.0):
            length = rng.uniform(1.0, longest, count - 1)
            time = np.concatenate([[0.0], np.cumsum(length)])
            # At the knots, between them, and at both ends.
            at = np.concatenate([time, rng.uniform(0.0, time[-1], 50)])
            assert_as_scipy(time, points(rng, count, periodic), at, periodic)


def test_outer_pieces_go_on_beyond_the_ends(rng: np.random.Generator) -> None:
    time = np.array([0.0, 1.0, 1.7, 3.0, 3.9])
    assert_as_scipy(time, points(rng, 5, False), np.array([-0.5, 4.4]), False)


def test_spline_takes_times_of_any_shape(rng: np.random.Generator) -> None:
    spline = Spline.through(np.arange(5.0), points(rng, 5, False))
    at = rng.uniform(0.0, 4.0, (3, 2))
    once = spline.evaluate(at)
    for row in range(3):
        for column in range(2):
            alone = spline.evaluate(np.asarray(at[row, column]))
            for all_of_them, one in zip(once, alone, strict=True):
                np.testing.assert_array_equal(all_of_them[row, column], one)


def test_two_points_give_a_line_and_three_a_parabola() -> None:
    line = Spline.through(np.array([0.0, 2.0]), np.array([[1.0], [5.0]])).evaluate(np.array([0.5]))
    np.testing.assert_array_equal(np.ravel(line), [2.0, 2.0, 0.0])
    parabola = Spline.through(np.array([0.0, 1.0, 3.0]), np.array([[0.0], [1.0], [9.0]]))
    np.testing.assert_allclose(np.ravel(parabola.evaluate(np.array([2.0]))), [4.0, 4.0, 2.0])


def test_pieces_of_very_different_length_are_solved_to_rounding() -> None:
    # A microsecond between rows of whole seconds: no row may be exchanged, and none has to be.
    time = np.array([0.0, 1.0, 1.000001, 2.0, 3.0, 3.000001])
    cubic = time[:, np.newaxis] ** 3
    at = np.linspace(0.0, 3.0, 31)
    position, velocity, _ = Spline.through(time, cubic).evaluate(at)
    np.testing.assert_allclose(position[:, 0], at**3, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(velocity[:, 0], 3.0 * at**2, rtol=0.0, atol=1e-7)
