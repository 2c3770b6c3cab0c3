"""The control step alone: what sensors show, when a command arrives, and as what."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fivebar_sim.arrays import Array
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Drive, Servo
from fivebar_sim.control.step import ControlStep, check_whole_steps, whole_steps
from fivebar_sim.errors import ArgumentError

H = 1e-3
SMALL = st.integers(0, 12)


def step(
    *,
    servo: Servo | None = None,
    sensors: Sensors | None = None,
    drive: Drive = "position",
    every: int = 1,
    steps: int = 40,
    start: Array | None = None,
    seeds: tuple[int, ...] = (0,),
) -> ControlStep:
    return ControlStep(
        servo or Servo(),
        sensors or Sensors(),
        drive,
        timestep=H,
        every=every,
        steps=steps,
        start=np.tile([0.3, -0.7], (len(seeds), 1)) if start is None else start,
        seeds=seeds,
    )


def moving(steps: int, legs: int = 1) -> tuple[Array, Array]:
    """Return angles and rates at t = 0, h, ... that all differ, from rest, (nsim, N + 1, 2)."""
    theta: Array = np.linspace(0.0, 1.0, legs * (steps + 1) * 2).reshape(legs, steps + 1, 2)
    rate: Array = -theta
    rate[:, 0] = 0.0
    return theta, rate


def observed(control: ControlStep, theta: Array, rate: Array, every: int) -> tuple[Array, Array]:
    """Return what is seen at each control step, (nsim, control steps, 2) each."""
    seen = []
    for k in range(0, theta.shape[1] - 1, every):
        seen.append(control.observe(k))
        rows = slice(k + 1, k + 1 + every)
        control.moved(theta[:, rows], rate[:, rows])
    return np.stack([s.theta for s in seen], 1), np.stack([s.theta_dot for s in seen], 1)


def sent(control: ControlStep, commands: Array, every: int) -> Array:
    """Return what arrives of a table of commands, row k asked at step k every, (nsim, N, 2)."""
    rows = range(commands.shape[1])
    return np.concatenate([control.send(k * every, commands[:, k]) for k in rows], axis=1)


# law


@given(late=st.integers(0, 60), every=st.integers(1, 7))
def test_seen_is_late_by_the_delay(late: int, every: int) -> None:
    steps = 42
    theta, rate = moving(steps, 2)
    control = step(
        sensors=Sensors(delay=late * H), every=every, steps=steps, start=theta[:, 0], seeds=(0, 1)
    )
    k = np.maximum(np.arange(0, steps, every) - late, 0)
    angles, rates = observed(control, theta, rate, every)
    np.testing.assert_array_equal(angles, theta[:, k])
    np.testing.assert_array_equal(rates, rate[:, k])


@given(theta=st.floats(-10.0, 10.0), resolution=st.floats(1e-4, 1.0))
def test_resolution_is_the_nearest_step(theta: float, resolution: float) -> None:
    start = np.array([[theta, -theta]])
    seen = step(sensors=Sensors(resolution=resolution), start=start).observe(0)
    assert np.abs(seen.theta - start).max() <= 0.5 * resolution * (1.0 + 1e-9)
    counts = seen.theta / resolution
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9 * (1.0 + np.abs(counts).max()))


def test_noise_has_its_size_and_is_white() -> None:
    """20,000 numbers of each kind: of 100 legs, so that few steps are taken."""
    sensors = Sensors(noise=0.01, rate_noise=3.0)
    still = np.zeros((100, 201, 2))
    control = step(sensors=sensors, steps=200, start=still[:, 0], seeds=tuple(range(100)))
    angles, rates = observed(control, still, still, 1)
    for values, size in ((angles, 0.01), (rates, 3.0)):
        assert np.abs(values.mean(axis=(0, 1))).max() < 4.0 * size / np.sqrt(20_000)
        np.testing.assert_allclose(values.std(axis=(0, 1)), size, rtol=4.0 / np.sqrt(40_000))
        A, E = np.moveaxis(values, -1, 0)
        assert abs(correlation(A[:, :-1], A[:, 1:])) < 0.03
        assert abs(correlation(A[:-1], A[1:])) < 0.03
        assert abs(correlation(A, E)) < 0.03
    assert abs(correlation(angles[..., 0], rates[..., 0])) < 0.03


def correlation(one: Array, other: Array) -> float:
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


@pytest.mark.parametrize("seeds", [(5,), (5, 7, 9), (9, 7, 5), (5, 5), tuple(range(20))])
def test_noise_depends_on_the_seed_alone(seeds: tuple[int, ...]) -> None:
    sensors = Sensors(noise=0.01, rate_noise=3.0)
    theta, rate = moving(20, len(seeds))
    theta = np.tile(theta[:1], (len(seeds), 1, 1))
    rate = np.tile(rate[:1], (len(seeds), 1, 1))
    control = step(sensors=sensors, start=theta[:, 0], seeds=seeds)
    together = observed(control, theta, rate, 1)
    for row, seed in enumerate(seeds):
        control = step(sensors=sensors, start=theta[:1, 0], seeds=(seed,))
        alone = observed(control, theta[:1], rate[:1], 1)
        for one, every in zip(alone, together, strict=True):
            np.testing.assert_array_equal(every[row], one[0])
    if seeds == (5, 7, 9):
        assert not np.array_equal(together[0][0], together[0][1])


def test_angles_alone_are_as_noisy_without_noisy_rates() -> None:
    """Another rate_noise leaves the angles' noise as it is."""
    seen = [
        step(sensors=Sensors(noise=0.01, rate_noise=size)).observe(0).theta for size in (0.0, 3.0)
    ]
    np.testing.assert_array_equal(seen[0], seen[1])


@given(
    every=st.integers(1, 6),
    hold=st.integers(1, 7),
    late=SMALL,
    drive=st.sampled_from(["position", "torque"]),
)
def test_commands_arrive_as_the_servo_says(every: int, hold: int, late: int, drive: Drive) -> None:
    """What arrives is the row that `Servo.latched` names, of rows that hold for a period."""
    steps = 40
    servo = Servo(rate=1.0 / (hold * H), delay=late * H, resolution=0.02)
    control = step(servo=servo, drive=drive, every=every, steps=steps, seeds=(0, 1))
    count = -(-steps // every)
    commands = np.random.default_rng(3).normal(size=(2, count, 2))
    rest = np.tile([0.3, -0.7], (2, 1)) if drive == "position" else np.zeros((2, 2))
    table = np.repeat(commands, every, axis=1)[:, :steps]
    ours = sent(control, commands, every)
    assert ours.shape == (2, steps, 2)
    row = servo.latched(steps, H)
    acting = np.where(row[:, None] < 0, rest[:, None], table[:, np.maximum(row, 0)])
    expected = servo.rounded(acting) if drive == "position" else acting
    np.testing.assert_array_equal(ours, expected)


def test_torque_is_not_rounded_and_makes_up_for_the_back_emf() -> None:
    servo = Servo(limit=0.2, speed=40.0, resolution=0.1)
    control = step(servo=servo, drive="torque")
    command = np.array([[0.013, -0.027]])
    np.testing.assert_array_equal(control.send(0, command), command[:, None])
    rate = np.array([[3.0, -5.0]])
    control.moved(np.zeros((1, 1, 2)), rate[:, None])
    np.testing.assert_allclose(control.send(1, command)[:, 0], command + 0.2 / 40.0 * rate)


def test_back_emf_is_that_of_the_motor_not_of_late_sensors() -> None:
    servo = Servo(limit=0.2, speed=40.0)
    control = step(servo=servo, drive="torque", sensors=Sensors(delay=5 * H, rate_noise=9.0))
    theta, rate = moving(3)
    control.moved(theta[:, 1:], rate[:, 1:])
    command = np.zeros((1, 2))
    np.testing.assert_allclose(control.send(3, command)[:, 0], 0.2 / 40.0 * rate[:, 3])


def test_position_of_a_servo_with_a_speed_stays_an_angle() -> None:
    servo = Servo(limit=0.2, speed=40.0)
    control = step(servo=servo)
    theta, rate = moving(1)
    control.moved(theta[:, 1:], rate[:, 1:] + 9.0)
    command = np.array([[0.1, 0.2]])
    np.testing.assert_array_equal(control.send(1, command), command[:, None])


# edge


def test_last_period_is_cut_off() -> None:
    control = step(every=7, steps=10)
    assert control.send(0, np.ones((1, 2))).shape == (1, 7, 2)
    assert control.send(7, np.ones((1, 2))).shape == (1, 3, 2)


@given(late=st.integers(0, 30), part=st.floats(0.01, 0.99), every=st.integers(1, 7))
def test_a_delay_within_a_step_is_seen_on_the_line_between_its_ends(
    late: int, part: float, every: int
) -> None:
    steps = 42
    theta, rate = moving(steps, 2)
    sensors = Sensors(delay=(late + part) * H)
    control = step(sensors=sensors, every=every, steps=steps, start=theta[:, 0], seeds=(0, 1))
    k = np.arange(0, steps, every) - late
    newer = np.maximum(k, 0)
    older = np.maximum(k - 1, 0)
    for seen, true in zip(observed(control, theta, rate, every), (theta, rate), strict=True):
        line = (1.0 - part) * true[:, newer] + part * true[:, older]
        np.testing.assert_allclose(seen, line, rtol=0.0, atol=1e-12)


def test_exact_sensors_show_what_is_there() -> None:
    theta, rate = moving(10)
    angles, rates = observed(step(start=theta[:, 0]), theta, rate, 1)
    np.testing.assert_array_equal(angles, theta[:, :-1])
    np.testing.assert_array_equal(rates, rate[:, :-1])


def test_a_delay_longer_than_the_run_shows_the_start() -> None:
    control = step(sensors=Sensors(delay=10.0), steps=5)
    theta, rate = moving(5)
    angles, _ = observed(control, theta, rate, 1)
    np.testing.assert_array_equal(angles, np.tile([0.3, -0.7], (1, 5, 1)))


@pytest.mark.parametrize(
    ("seconds", "steps"), [(0.001, 1), (0.01, 10), (0.003, 3), (0.1 + 0.2, 300), (1e300, None)]
)
def test_whole_steps(seconds: float, steps: int | None) -> None:
    found = whole_steps("period", seconds, H)
    assert found == steps if steps else found > 10**300


# refusal


@pytest.mark.parametrize("seconds", [0.0015, 0.0004, 1e-12, 0.00100001, 1e308])
def test_refusal_of_a_part_of_a_timestep(seconds: float) -> None:
    with pytest.raises(
        ArgumentError, match=r"^period must be a whole number of timesteps of 0.001"
    ):
        whole_steps("period", seconds, H)
    with pytest.raises(ArgumentError, match="whole number of timesteps"):
        check_whole_steps("period", seconds, H)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf"), True, "1"])
def test_refusal_of_what_is_no_time(seconds: float) -> None:
    with pytest.raises(ArgumentError, match=r"^period must be in \(0, inf\) s, got"):
        whole_steps("period", seconds, H)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"delay": -1.0}, r"delay must be in \[0, 10\] s, got -1.0"),
        ({"delay": 11.0}, r"delay must be in \[0, 10\] s, got 11.0"),
        ({"noise": -1.0}, r"noise must be in \[0, 10\] rad, got -1.0"),
        ({"rate_noise": float("nan")}, r"rate_noise must be in \[0, 1e\+06\] rad/s, got nan"),
        ({"resolution": 2.0}, r"resolution must be in \[0, 1\] rad, got 2.0"),
    ],
)
def test_refusal_of_sensors(keys: dict[str, float], message: str) -> None:
    with pytest.raises(ArgumentError, match=f"^{message}"):
        Sensors(**keys)


def test_refusal_of_a_bus_faster_than_the_steps() -> None:
    with pytest.raises(ArgumentError, match=r"rate must be in \(0, 1000\] Hz"):
        step(servo=Servo(rate=2000.0))
