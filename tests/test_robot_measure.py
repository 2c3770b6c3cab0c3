"""How a robot moved, against motions whose speed, turning and falls are known."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest

from fivebar_sim.arrays import Array
from fivebar_sim.robots import measure
from fivebar_sim.robots.measure import Trunk

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

SIZE = (0.12, 0.05, 0.03)
CENTER = np.array([0.01, 0.0, 0.005])
ALL = slice(None)


def trunk(position: Array, turned: Rotation) -> Trunk:
    time: Array = 1e-3 * np.arange(1, len(position) + 1, dtype=np.float64)
    return Trunk(time, position, turned.as_quat(scalar_first=True), np.zeros_like(position))


def about(axis: str, angle: Array) -> Rotation:
    """Return the rotations about an axis by some angles [rad], (N,)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler(axis, angle[:, None])


@pytest.mark.parametrize("turns", [-2.5, 1.5])
def test_circle_has_its_speed_and_its_rate(turns: float) -> None:
    """On a circle, more than once round, the way along the heading is the whole way."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 4001)
    side = np.sign(turns)
    place = 0.2 * side * np.stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle], axis=-1)
    place[:, 2] = 0.05 + 0.004 * np.sin(7.0 * angle)
    went = measure.measure(trunk(place, about("z", angle)), ALL, 0.12, 0)

    rate = 2.0 * np.pi * turns / 4.0
    assert went.turn_rate == pytest.approx(rate, rel=1e-12)
    assert went.speed == pytest.approx(0.2 * abs(rate), rel=1e-5)
    assert went.body_lengths_per_second == pytest.approx(0.2 * abs(rate) / 0.12, rel=1e-5)
    assert went.drift == pytest.approx(0.0, abs=1e-9)
    assert went.bob == pytest.approx(0.008, rel=1e-4)
    assert went.lean == pytest.approx(0.0, abs=1e-9)


def test_side_step_is_drift() -> None:
    """A robot that faces along y and moves along x drifts to its right."""
    place = np.zeros((1001, 3))
    place[:, 0] = np.linspace(0.0, 0.3, 1001)
    facing = about("z", np.full(1001, 0.5 * np.pi))
    went = measure.measure(trunk(place, facing), slice(500, None), 0.12, 0)
    assert went.drift == pytest.approx(-0.3, rel=1e-9)
    assert went.speed == pytest.approx(0.0, abs=1e-12)


def test_lean_and_lowest_corner_in_any_pose(rng: np.random.Generator) -> None:
    from scipy.spatial.transform import Rotation

    turned = Rotation.random(200, rng=rng)
    place = rng.uniform(-1.0, 1.0, (200, 3))
    body = trunk(place, turned)

    vertical = turned.apply([0.0, 0.0, 1.0])[:, 2]
    np.testing.assert_allclose(np.cos(measure.lean(body.quaternion)), vertical, atol=1e-12)

    signs = np.array(list(product((-0.5, 0.5), repeat=3)))
    corners = np.stack([turned.apply(CENTER + s * SIZE) + place for s in signs])
    lowest = measure.lowest(body, SIZE, CENTER)
    np.testing.assert_allclose(lowest, corners[..., 2].min(axis=0), atol=1e-12)


def test_falls_are_counted_from_each_time_it_was_up() -> None:
    angle = np.zeros(1000)
    angle[200:300] = np.deg2rad(70.0)  # leans, gets up
    angle[600:] = np.deg2rad(50.0)  # leans, but not too far
    place = np.full((1000, 3), 0.1)
    place[800:, 2] = 0.02  # and then touches the floor
    first, second = measure.falls(trunk(place, about("x", angle)), SIZE, CENTER)
    assert first.time == pytest.approx(0.201)
    assert first.why == "the trunk leans 70 deg, more than 60"
    assert second.time == pytest.approx(0.801)
    assert second.why == "the trunk touches the floor, leaning 50 deg"


def test_upright_robot_does_not_fall() -> None:
    from scipy.spatial.transform import Rotation

    place = np.full((10, 3), 0.1)
    assert measure.falls(trunk(place, Rotation.identity(10)), SIZE, CENTER) == []
