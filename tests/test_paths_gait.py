"""The gait: a straight stance at the speed of the ground, and a swing that begins and ends so."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths import Gait
from fivebar_sim.paths.gait import GRAVITY
from fivebar_sim.paths.quintic import STEEPEST, arch, pieces

GAIT = Gait(
    centre=(0.004, -0.08), stride=0.03, lift=0.02, frequency=1.6, duty=0.6, touchdown=0.15, ramp=0.0
)
LANDING = 0.7 * 0.625
"""Of GAIT, which begins in the middle of its stance [s]."""

gaits = st.builds(
    Gait,
    centre=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.2, -0.01)),
    stride=st.floats(-0.1, 0.1),
    lift=st.floats(0.001, 0.1),
    frequency=st.floats(0.1, 10.0),
    duty=st.floats(0.1, 0.9),
    ramp=st.just(0.0),
)


def over_a_period(path: Gait, n: int = 4001) -> np.ndarray:
    return np.linspace(0.0, path.period, n, endpoint=False)


# law


@given(gaits)
def test_stance_is_straight_and_as_fast_as_the_ground(path: Gait) -> None:
    time = over_a_period(path, 500)
    stance = path.in_stance(time)
    foot = path.at(time[stance])
    np.testing.assert_array_equal(foot.position[:, 1], path.centre[1])
    np.testing.assert_array_equal([foot.velocity[:, 1], *foot.acceleration.T], 0.0)
    np.testing.assert_allclose(foot.velocity[:, 0], -path.stance_speed, rtol=1e-14, atol=1e-100)
    assert path.stance_speed == path.stride * path.frequency / path.duty
    # on the ground the foot stands: its place there does not depend on the time
    half = time[stance] < 0.5 * path.period
    place = (foot.position[:, 0] + path.stance_speed * time[stance])[half]
    np.testing.assert_allclose(place, path.centre[0], rtol=0.0, atol=1e-14)


@given(gaits)
def test_duty_is_the_part_of_a_period_that_stands(path: Gait) -> None:
    time = over_a_period(path, 10_000)
    assert np.mean(path.in_stance(time)) == pytest.approx(path.duty, abs=2e-4)  # two ends
    np.testing.assert_array_equal(path.in_stance(time), path.cycle(time) < path.duty)
    swings = path.at(time).position[:, 1] > path.centre[1]
    assert not np.any(swings & path.in_stance(time))
    assert np.mean(swings) == pytest.approx(1.0 - path.duty, abs=1e-3)  # begins as u^3: rounding


@given(gaits, st.floats(0.0, 1.0))
def test_swing_never_passes_lift_or_turns_on_its_way(path: Gait, part: float) -> None:
    path = Gait(
        centre=path.centre,
        stride=path.stride,
        lift=path.lift,
        duty=path.duty,
        frequency=path.frequency,
        touchdown=part * path.fastest_touchdown,
        ramp=0.0,
    )
    u = np.linspace(1e-6, 1.0 - 1e-6, 1001)
    start = 0.5 * path.duty
    swing = 1.0 - path.duty
    foot = path.at((start + swing * u) / path.frequency)
    height = foot.position[:, 1] - path.centre[1]
    assert np.max(height) == pytest.approx(path.lift, rel=1e-12)
    up = np.where(u < 0.5, 1.0, -1.0) * foot.velocity[:, 1]
    assert np.all(up > -1e-12 * path.lift * path.frequency)


@given(st.floats(0.0, 1.0), st.floats(0.0, STEEPEST))
def test_arch_is_its_formula(u: float, fall: float) -> None:
    z, dz, _ = pieces(arch(3.0, 5.0, 0.5, 0.25, fall * 0.25), np.array([3.0 + u, 5.0 - u]))
    rise = 0.25 * u**3 * (7.0 - 9.0 * u + 3.0 * u**2)
    slope = 0.75 * u**2 * (1.0 - u) * (7.0 - 5.0 * u)
    assert z[0] - 0.5 == pytest.approx(rise, abs=1e-14)  # rounding of 0.5
    assert dz[0] == pytest.approx(slope, abs=1e-14)
    end = 0.25 * fall * u * (1.0 - u) ** 3 * (1.0 + 3.0 * u)  # what the steep end adds
    assert z[1] - 0.5 == pytest.approx(rise + end, abs=1e-14)


@given(time=st.floats(0.0, 2.0), ramp=st.floats(0.01, 1.0))
def test_ramp_eases_the_stance_and_its_phase(time: float, ramp: float) -> None:
    path = Gait(centre=(0.0, -0.08), stride=0.03, lift=0.02, frequency=1.6, ramp=ramp)
    tau = min(time / ramp, 1.0)
    s = time - 0.5 * ramp if time >= ramp else ramp * (2.5 * tau**4 - 3.0 * tau**5 + tau**6)
    s_dot = 10.0 * tau**3 - 15.0 * tau**4 + 6.0 * tau**5
    cycle = float(path.cycle(time))
    assert abs((cycle - 1.6 * s - 0.25 + 0.5) % 1.0 - 0.5) < 1e-12
    if path.in_stance(time):
        speed = -path.at(time).velocity[0]
        assert speed == pytest.approx(path.stance_speed * s_dot, abs=1e-12)


@given(gaits)
def test_hip_of_a_running_gait_is_carried_by_the_stance_alone(path: Gait) -> None:
    """Newton's law for a trunk on a massless leg: the ground pushes in stance only, by a half sine.

    The push's impulse over a period is that of the weight, so the bounce repeats by itself.
    """
    n = 4000
    cycle = (np.arange(n) + 0.5) / n
    _, rate, acceleration = path.bounce(cycle)
    push = (acceleration + GRAVITY) / GRAVITY  # in weights
    stance = cycle < path.duty
    half_sine = 0.5 * np.pi / path.duty * np.sin(np.pi * cycle / path.duty)
    np.testing.assert_allclose(push[stance], half_sine[stance], atol=1e-12)
    np.testing.assert_array_equal(push[~stance], 0.0)
    assert push.mean() == pytest.approx(1.0, abs=1e-3)  # of a sum over a step at both ends

    ends = path.bounce(np.array([0.0, path.duty, np.nextafter(path.duty, 0.0), 1.0 - 1e-15]))
    flown = 0.5 * GRAVITY * (1.0 - path.duty) * path.period
    np.testing.assert_allclose(ends[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(ends[1], [-flown, flown, flown, -flown], rtol=1e-9)
    assert rate[~stance].max() <= flown


@given(gaits)
def test_running_foot_is_as_high_above_the_ground_as_a_walking_one(path: Gait) -> None:
    time = over_a_period(path, 500)
    running = msgspec.structs.replace(path, running=True)
    bounce = running.bounce(running.cycle(time))
    walk = path.nominal(time)
    run = running.nominal(time)
    for own, level, up in zip(run, walk, bounce, strict=True):
        np.testing.assert_array_equal(own[:, 0], level[:, 0])
        np.testing.assert_allclose(own[:, 1] + up, level[:, 1], rtol=1e-12, atol=1e-12)


def test_rates_of_a_running_gait_are_those_of_its_place() -> None:
    path = msgspec.structs.replace(GAIT, running=True, touchdown=0.0)
    time = np.linspace(0.0, 2.0 * path.period, 801)
    h = 1e-6
    ahead = path.nominal(time + h)
    behind = path.nominal(time + 2.0 * h)
    now = path.nominal(time + h * 1.5)
    np.testing.assert_allclose(
        (behind.position - ahead.position) / h, now.velocity, rtol=0.0, atol=1e-6
    )
    np.testing.assert_allclose(
        (behind.velocity - ahead.velocity) / h, now.acceleration, rtol=0.0, atol=1e-3
    )


# edge


def test_gait_begins_in_mid_stance_and_passes_its_marks() -> None:
    # mid-stance, lift-off, top, touch-down, mid-stance
    time = 0.625 * np.array([0.0, 0.3, 0.5, 0.7, 1.0])
    foot = GAIT.at(time)
    marks = [(0.004, -0.08), (-0.011, -0.08), (0.004, -0.06), (0.019, -0.08), (0.004, -0.08)]
    np.testing.assert_allclose(foot.position, marks, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(GAIT.cycle(time[[0, 2, 4]]), [0.3, 0.8, 0.3], atol=1e-15)
    assert foot.velocity[2, 0] > 0.0
    assert foot.velocity[2, 1] == pytest.approx(0.0, abs=1e-15)


def test_touch_down_is_as_fast_as_asked_and_does_not_slip() -> None:
    before = GAIT.at(LANDING - 1e-9)
    after = GAIT.at(LANDING + 1e-9)
    assert not GAIT.in_stance(LANDING - 1e-9)
    assert GAIT.in_stance(LANDING + 1e-9)
    # 1 ns times 35 m/s^2
    np.testing.assert_allclose(before.velocity, (-GAIT.stance_speed, -0.15), atol=4e-8)
    np.testing.assert_allclose(after.velocity, (-GAIT.stance_speed, 0.0), atol=4e-8)
    np.testing.assert_allclose([before.acceleration, after.acceleration], 0.0, atol=1e-5)


def test_stride_may_be_none_or_negative() -> None:
    time = over_a_period(GAIT)
    keys = {"centre": (0.004, -0.08), "lift": 0.02, "frequency": 1.6, "ramp": 0.0}
    spot, back, forth = (Gait(stride=s, **keys).at(time).position for s in (0.0, -0.03, 0.03))
    np.testing.assert_array_equal(spot[:, 0], 0.004)
    np.testing.assert_allclose(back[:, 0] - 0.004, 0.004 - forth[:, 0], rtol=0.0, atol=1e-16)
    np.testing.assert_array_equal(back[:, 1], forth[:, 1])


def test_fastest_touchdown_is_six_lifts_a_swing() -> None:
    assert GAIT.fastest_touchdown == pytest.approx(6.0 * 0.02 * 1.6 / 0.4, rel=1e-14)


# refusal


def test_times_before_the_start_are_refused() -> None:
    for ask in (GAIT.at, GAIT.nominal, GAIT.cycle, GAIT.in_stance):
        with pytest.raises(ArgumentError, match=r"time must be in \[0, inf\) s, got -1.0 s"):
            ask(-1.0)
