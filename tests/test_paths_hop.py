"""The hop: its pieces, and that a body on a vertical slide leaves the ground and lands in time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim.paths import Hop

G = 9.81
HOP = Hop(x=0.003, low=0.05, high=0.085, frequency=2.0, thrust=0.15, flight=0.25)


def ride(path: Hop, periods: int, step: float = 1e-5) -> tuple[np.ndarray, np.ndarray]:
    """Return the hip's height and the foot's above the ground of a body that rides on the leg.

    A massless leg follows the path; the ground only pushes, and stops the foot dead. The body falls
    freely, unless the leg would be below the ground: then it stands on it.
    """
    leg = -path.at(np.arange(round(periods * path.period / step)) * step).position[:, 1]
    hip = np.empty_like(leg)
    hip[:2] = leg[:2]
    for k in range(2, len(leg)):
        hip[k] = max(2.0 * hip[k - 1] - hip[k - 2] - G * step**2, leg[k])
    return hip, hip - leg


# law


@given(
    low=st.floats(0.02, 0.2),
    stroke=st.floats(0.005, 0.1),
    thrust=st.floats(0.05, 0.5),
    flight=st.floats(0.05, 0.4),
    tuck=st.floats(0.0, 1.0),
)
def test_foot_stays_between_low_and_high(
    low: float, stroke: float, thrust: float, flight: float, tuck: float
) -> None:
    path = Hop(
        low=low,
        high=low + stroke,
        frequency=1.0,
        thrust=thrust,
        flight=flight,
        tuck=tuck * ((low + stroke) - low),
        ramp=0.0,
    )
    foot = path.at(np.linspace(0.0, 1.0, 2001))
    np.testing.assert_array_equal(foot.position[:, 0], 0.0)
    z = foot.position[:, 1]
    assert np.all((z >= -path.high - 1e-14) & (z <= -path.low + 1e-14))
    assert path.at(0.0).position[1] == -low
    push = path.at(np.linspace(0.0, thrust, 2001)).acceleration[:, 1]
    # the greatest lies between two samples: off by a part 0.5 (4e-4)^2 h'''' / h'' of it
    assert push.max() == pytest.approx(path.braking, rel=1e-5)
    assert push.min() == pytest.approx(-path.braking, rel=1e-5)


def test_body_leaves_the_ground_and_is_back_before_the_crouch_ends() -> None:
    hip, foot = ride(HOP, 3)
    assert HOP.braking > 3.0 * G
    for k in range(3):
        clear = foot[50_000 * k : 50_000 * (k + 1)] > 1e-6
        takeoff, landing = np.flatnonzero(clear)[[0, -1]] * 1e-5
        assert 0.0 < takeoff < HOP.thrust * HOP.period
        assert landing < 0.9 * HOP.period
        assert np.all(clear[round(takeoff / 1e-5) : round(landing / 1e-5)])  # one flight
    # it leaves where the thrust would throw it highest: h' (1 + h'' / g) = 0
    thrust = HOP.at(np.linspace(0.0, HOP.thrust * HOP.period, 10_001))
    rise = -thrust.position[:, 1] + 0.5 * thrust.velocity[:, 1] ** 2 / G
    assert hip.max() == pytest.approx(rise.max(), abs=1e-5)  # step 10 us at 0.9 m/s
    assert hip.max() - HOP.high > 0.02


@pytest.mark.parametrize("part", [0.3, 0.95, 1.05, 1.5, 3.0])
def test_body_leaves_where_the_thrust_brakes_by_more_than_gravity(part: float) -> None:
    period = 4.0
    thrust = np.sqrt(10.0 / np.sqrt(3.0) * 0.035 / (part * G)) / period
    path = Hop(low=0.05, high=0.085, frequency=1.0 / period, thrust=thrust, flight=0.3, ramp=0.0)
    assert path.braking == pytest.approx(part * G, rel=1e-12)
    _, foot = ride(path, 1, step=1e-4)
    assert (foot.max() > 1e-6) == (part > 1.0)


# edge


def test_pieces_meet_at_rest() -> None:
    path = Hop(low=0.05, high=0.085, frequency=2.0, thrust=0.15, flight=0.25, tuck=0.02, x=0.003)
    marks = path.at(0.5 * np.array([0.0, 0.15, 0.275, 0.4, 1.0]))
    expected = [(0.003, z) for z in (-0.05, -0.085, -0.065, -0.085, -0.05)]
    np.testing.assert_allclose(marks.position, expected, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(marks.velocity, 0.0, atol=1e-13)
    np.testing.assert_allclose(marks.acceleration[[0, 1, 3, 4]], 0.0, atol=1e-11)
    flight = HOP.at(0.5 * np.linspace(0.15, 0.4, 101)).position
    np.testing.assert_array_equal(flight[:-1, 1], -0.085)  # no tuck: held
