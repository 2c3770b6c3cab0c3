"""Two-link legs: round trips, slopes, virtual work, one leg as the other, edges, refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from poses import BATCHES, length

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, GeometryError, SingularError, UnreachableError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.planar import cross, unit
from fivebar_sim.kinematics.two_link import CrouchingLeg, SerialLeg

EPS = float(np.finfo(float).eps)
LEG = SerialLeg(0.05, 0.07)
EVEN = SerialLeg(0.05, 0.05)
CROUCH = CrouchingLeg(0.05)
RISE = np.linspace(0.001, 0.099, 50)  # [m] heights of CROUCH


def angles(rng: np.random.Generator, batch: tuple[int, ...], knee: int) -> Array:
    """Return (theta_A, theta_B) all round, on one elbow, more than 0.1 rad from singular."""
    theta_A = rng.uniform(-np.pi, np.pi, batch)
    return np.stack([theta_A, -knee * rng.uniform(0.1, np.pi - 0.1, batch)], axis=-1)


# law


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("knee", [-1, 1])
def test_serial_round_trips(rng: np.random.Generator, batch: tuple[int, ...], knee: int) -> None:
    for _ in range(100):
        leg = SerialLeg(*rng.uniform(0.02, 0.1, 2).tolist())
        theta = angles(rng, batch, knee)
        foot = leg.forward(theta)
        again = leg.inverse(foot, knee)
        assert foot.shape == again.shape == (*batch, 2)
        np.testing.assert_allclose(again, theta, rtol=0, atol=1e-12)
        assert (length(leg.forward(again) - foot) <= 1e-12 * (leg.L1 + leg.L2)).all()
        AB = leg.L1 * unit(again[..., 0])
        np.testing.assert_array_equal(np.sign(cross(foot, AB)), knee)
        np.testing.assert_array_equal(again, SerialLeg(leg.L1, leg.L2, knee).inverse(foot))


link = st.floats(0.02, 0.1)


@settings(max_examples=200)
@given(link, link, st.floats(0.0, 1.0), st.floats(-math.pi, math.pi), st.sampled_from([-1, 1]))
def test_serial_foot_comes_back_from_everywhere(
    L1: float, L2: float, stretch: float, direction: float, knee: int
) -> None:
    """Near full stretch and fold theta is known to sqrt(eps), the foot still to some eps."""
    leg = SerialLeg(L1, L2, knee)
    foot = (abs(L1 - L2) + stretch * 2.0 * min(L1, L2)) * unit(direction)
    theta = leg.inverse(foot)
    assert ((-np.pi < theta) & (theta <= np.pi)).all()
    assert length(leg.forward(theta) - foot) <= 1e-14 * (L1 + L2)


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("belt", [False, True])
def test_serial_torques_do_no_virtual_work_with_the_force(
    rng: np.random.Generator, batch: tuple[int, ...], belt: bool
) -> None:
    """With angles that the motors turn: the second is theta_A + theta_B with a belt."""
    theta = angles(rng, batch, 1)
    force = rng.uniform(-10.0, 10.0, (*batch, 2))
    d_theta = rng.uniform(-1.0, 1.0, (*batch, 2))
    tau = LEG.static_torques(theta, force, belt=belt)
    d_motor = np.cumsum(d_theta, axis=-1) if belt else d_theta
    dr = np.einsum("...ij,...j->...i", LEG.jacobian(theta), d_theta)
    work = np.sum(tau * d_motor, axis=-1) + np.sum(force * dr, axis=-1)
    np.testing.assert_allclose(work, np.zeros(batch), rtol=0, atol=1e-14)
    if not belt:
        J_T = np.swapaxes(LEG.jacobian(theta), -1, -2)
        np.testing.assert_allclose(tau, -(J_T @ force[..., None])[..., 0], rtol=0, atol=1e-15)


@pytest.mark.parametrize("knee", [-1, 1])
def test_crouch_round_trips(knee: int) -> None:
    leg = CrouchingLeg(CROUCH.l, knee)
    for batch in ((), (1,), (5, 1, 10)):
        h = RISE[: math.prod(batch)].reshape(batch)
        q = leg.inverse(h)
        assert q.shape == (*batch, 2)
        np.testing.assert_array_equal(q[..., 1], -2.0 * q[..., 0])
        np.testing.assert_array_equal(np.sign(q[..., 0]), knee)
        np.testing.assert_allclose(q[..., 0], knee * np.arccos(h / (2.0 * leg.l)), rtol=1e-13)
        np.testing.assert_allclose(leg.forward(q[..., 0]), h, rtol=0, atol=1e-16)


@pytest.mark.parametrize("knee", [-1, 1])
@pytest.mark.parametrize("belt", [False, True])
def test_crouch_torques_lift_the_load(knee: int, belt: bool) -> None:
    leg = CrouchingLeg(CROUCH.l, knee)
    load = 20.0
    q1 = leg.inverse(RISE)[:, 0]
    tau = leg.static_torques(q1, load, belt=belt)
    rates = leg.rates(q1, 0.3)
    d_motor = np.cumsum(rates, axis=-1) if belt else rates
    np.testing.assert_allclose(np.sum(tau * d_motor, axis=-1), load * 0.3, rtol=1e-13)
    np.testing.assert_allclose(leg.jacobian(q1) * rates[:, 0], 0.3, rtol=1e-14)


# slope


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("knee", [-1, 1])
def test_serial_jacobian_is_the_slope(
    rng: np.random.Generator, batch: tuple[int, ...], knee: int
) -> None:
    theta = angles(rng, batch, knee)
    step = 1e-5
    slopes = [LEG.forward(theta + step * e) - LEG.forward(theta - step * e) for e in np.eye(2)]
    J = LEG.jacobian(theta)
    assert J.shape == (*batch, 2, 2)
    # step^2 / 6 of |J| is 2e-11, eps / step 2e-11
    expected = np.stack(slopes, axis=-1) / (2.0 * step)
    np.testing.assert_allclose(J, expected, rtol=0, atol=1e-9 * np.abs(J).max())
    det = LEG.L1 * LEG.L2 * np.sin(theta[..., 1])
    np.testing.assert_allclose(np.linalg.det(J), det, rtol=1e-12)


def test_crouch_jacobian_and_rates_are_slopes() -> None:
    step = 1e-6
    h = RISE[1:-1]
    q1 = CROUCH.inverse(h)[:, 0]
    slope = (CROUCH.forward(q1 + step) - CROUCH.forward(q1 - step)) / (2.0 * step)
    np.testing.assert_allclose(CROUCH.jacobian(q1), slope, rtol=0, atol=1e-10)
    q_dot = (CROUCH.inverse(h + step) - CROUCH.inverse(h - step)) / (2.0 * step)
    # step^2 q'''/6 where q''' is greatest, 2 mm below full stretch
    np.testing.assert_allclose(CROUCH.rates(q1, 1.0), q_dot, rtol=1e-6)


# oracle


@pytest.mark.parametrize("knee", [-1, 1])
def test_belt_leg_is_a_parallelogram_of_five_bars(rng: np.random.Generator, knee: int) -> None:
    """Coaxial, L3 = L1 and L4 = L2: side E turns L2, so its statics are those of a belt.

    There BD x BC = -AB x BF, so the assembly mode is the sign of the knee.
    """
    bars = FiveBar(LEG.L1, LEG.L2, LEG.L1, LEG.L2, 0.0)
    theta = angles(rng, (40,), knee)
    force = rng.uniform(-10.0, 10.0, (40, 2))
    motors = np.cumsum(theta, axis=-1)
    foot = LEG.forward(theta)
    np.testing.assert_allclose(kinematics.forward(bars, motors, knee), foot, rtol=0, atol=1e-14)
    J_T = np.swapaxes(kinematics.jacobian(bars, motors, knee), -1, -2)
    tau = LEG.static_torques(theta, force, belt=True)
    np.testing.assert_allclose(tau, -(J_T @ force[..., None])[..., 0], rtol=0, atol=1e-13)


@pytest.mark.parametrize("knee", [-1, 1])
@pytest.mark.parametrize("belt", [False, True])
def test_crouching_leg_is_a_serial_leg(knee: int, belt: bool) -> None:
    crouch = CrouchingLeg(0.05, knee)
    serial = SerialLeg(0.05, 0.05, knee)
    q = crouch.inverse(RISE)
    theta = q - [0.5 * np.pi, 0.0]
    foot = np.stack([np.zeros(50), -RISE], axis=-1)
    np.testing.assert_allclose(serial.forward(theta), foot, rtol=0, atol=1e-16)
    np.testing.assert_allclose(serial.inverse(foot), theta, rtol=0, atol=1e-13)
    tau = serial.static_torques(theta, (0.0, 20.0), belt=belt)
    np.testing.assert_allclose(
        crouch.static_torques(q[:, 0], 20.0, belt=belt), tau, rtol=0, atol=1e-15
    )
    # the hip rises as the foot sinks from it: dh = -(J dq)_z, dq = (1, -2) dq1
    dh = -serial.jacobian(theta)[:, 1] @ [1.0, -2.0]
    np.testing.assert_allclose(crouch.jacobian(q[:, 0]), dh, rtol=0, atol=1e-15)


def test_batch_is_a_plain_loop_to_the_last_bit(rng: np.random.Generator) -> None:
    theta = angles(rng, (50,), 1)
    force = rng.uniform(-10.0, 10.0, (50, 2))
    foot = LEG.forward(theta)
    tau = LEG.static_torques(theta, force)
    np.testing.assert_array_equal(foot, [LEG.forward(t) for t in theta])
    np.testing.assert_array_equal(LEG.inverse(foot), [LEG.inverse(f) for f in foot])
    loop = [LEG.static_torques(t, f) for t, f in zip(theta, force, strict=True)]
    np.testing.assert_array_equal(tau, loop)
    np.testing.assert_array_equal(CROUCH.inverse(RISE), [CROUCH.inverse(h) for h in RISE])


# edge


def test_right_angled_knee_by_hand() -> None:
    """Femur level to the front, tibia straight down; 10 N up at the foot."""
    theta = [0.0, -0.5 * np.pi]
    np.testing.assert_allclose(LEG.forward(theta), [0.05, -0.07], rtol=1e-15)
    np.testing.assert_allclose(LEG.inverse([0.05, -0.07]), theta, rtol=0, atol=1e-15)
    np.testing.assert_allclose(LEG.jacobian(theta), [[0.07, 0.07], [0.05, 0.0]], atol=1e-16)
    for force, belt, tau in (
        ([0.0, 10.0], False, [-0.5, 0.0]),
        ([10.0, 0.0], False, [-0.7, -0.7]),
        ([10.0, 0.0], True, [0.0, -0.7]),
    ):
        found = LEG.static_torques(theta, force, belt=belt)
        np.testing.assert_allclose(found, tau, rtol=0, atol=1e-15)


@pytest.mark.parametrize("knee", [-1, 1])
def test_serial_stretched_and_folded(knee: int) -> None:
    np.testing.assert_allclose(LEG.inverse([0.0, -0.12], knee), [-np.pi / 2.0, 0.0], atol=1e-7)
    folded = LEG.inverse([0.02, 0.0], knee)
    np.testing.assert_allclose(np.abs(folded), [np.pi, np.pi], atol=1e-7)
    for zero in (0.0, -0.0):
        np.testing.assert_allclose(EVEN.inverse([-0.1, zero], knee), [np.pi, 0.0], atol=1e-15)
        np.testing.assert_array_equal(EVEN.inverse([zero, zero], knee), [0.0, np.pi])


@pytest.mark.parametrize("knee", [-1, 1])
def test_crouch_at_its_limits(knee: int) -> None:
    leg = CrouchingLeg(0.05, knee)
    q = [[0.0, 0.0], [knee * 0.5 * np.pi, -knee * np.pi]]
    np.testing.assert_array_equal(leg.inverse([0.1, 0.0]), q)
    np.testing.assert_allclose(leg.forward(leg.inverse([0.1, 0.0])[:, 0]), [0.1, 0.0], atol=1e-17)
    np.testing.assert_allclose(leg.jacobian([0.0, 0.5 * np.pi]), [0.0, -0.1], rtol=1e-15)
    np.testing.assert_array_equal(leg.static_torques(0.0, 20.0), [0.0, 0.0])
    np.testing.assert_array_equal(leg.static_torques(0.5 * np.pi, 20.0), [0.0, 1.0])
    np.testing.assert_array_equal(leg.inverse(0.1 * (1.0 + 2.0 * EPS)), leg.inverse(0.1))
    np.testing.assert_array_equal(leg.inverse(-0.1 * EPS), leg.inverse(0.0))


@pytest.mark.parametrize("h_dot", [-1.0, 0.0, 1.0])
def test_no_rate_at_full_stretch(h_dot: float) -> None:
    for q1, index in ((0.0, ()), ([0.3, 0.0], (1,)), ([[0.3], [-1e-9]], (1, 0))):
        with pytest.raises(SingularError, match="the leg is stretched") as error:
            CROUCH.rates(q1, h_dot)
        assert error.value.index == index
        assert str(error.value).endswith(f" at index {index}" if index else "2.4e-07")
    np.testing.assert_allclose(CROUCH.rates(0.5 * np.pi, -0.1), [1.0, -2.0], rtol=1e-15)


# refusal


@pytest.mark.parametrize("r", [0.121, 0.019, 0.0, math.nan, math.inf, 1e200])
def test_serial_out_of_reach(r: float) -> None:
    with pytest.raises(UnreachableError, match=r"the target is out .*\[0.02, 0.12\] m, got") as one:
        LEG.inverse([0.0, r])
    assert one.value.index == ()
    feet = [[[0.1, 0.0]], [[r, 0.0]], [[1.0, 1.0]]]
    with pytest.raises(UnreachableError, match=r"2 of 3 targets .* at index \(1, 0\)") as many:
        LEG.inverse(feet)
    assert many.value.index == (1, 0)


@pytest.mark.parametrize("h", [0.1001, -1e-6, math.nan, math.inf, -math.inf])
def test_crouch_out_of_reach(h: float) -> None:
    with pytest.raises(UnreachableError, match=r"h must be in \[0, 0.1\] m, got") as error:
        CROUCH.inverse([0.05, h])
    assert error.value.index == (1,)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_crouch_is_as_exact_at_its_limits_whatever_its_size(size: float) -> None:
    leg = CrouchingLeg(0.5 * size)
    for part in (0.0, 1.0):
        sign = 1.0 if part else -1.0
        inside = leg.inverse(size * (part + sign * 8.0 * EPS))
        np.testing.assert_array_equal(inside, leg.inverse(size * part))
        with pytest.raises(UnreachableError, match="h must be in"):
            leg.inverse(size * (part + sign * 32.0 * EPS))


@pytest.mark.parametrize("bad", [0.0, -0.1, math.nan, math.inf, "0.1", True])
def test_impossible_lengths_are_refused(bad: Any) -> None:
    for key, build in (
        ("L1", lambda: SerialLeg(bad, 0.1)),
        ("L2", lambda: SerialLeg(0.1, bad)),
        ("l", lambda: CrouchingLeg(bad)),
    ):
        with pytest.raises(GeometryError, match=rf"^{key} must be in \(0, 1000\) m"):
            build()


def test_wrong_arguments_are_refused() -> None:
    two = [0.1, -0.2]
    q = [0.1, 0.2, 0.3]
    for call, message in (
        (lambda: SerialLeg(0.1, 0.1, 0), "knee must be -1 or 1"),
        (lambda: CrouchingLeg(0.1, 2), "knee must be -1 or 1"),
        (lambda: LEG.inverse(two, 0), "knee must be -1 or 1"),
        (lambda: LEG.forward(q), r"theta must have shape \(\.\.\., 2\)"),
        (lambda: LEG.jacobian([0.1, math.inf]), r"theta must be finite at index \(1,\)"),
        (lambda: LEG.static_torques(two, [0.0, math.nan]), "force must be finite"),
        (lambda: LEG.static_torques([two] * 3, [two] * 2), "theta and force must broadcast"),
        (lambda: CROUCH.forward([0.0, 1.6]), r"q1 must be in .* got 1.6 rad at index \(1,\)"),
        (lambda: CROUCH.jacobian(math.nan), "q1 must be in .* got nan rad"),
        (lambda: CROUCH.rates(0.1, math.inf), "h_dot must be finite"),
        (lambda: CROUCH.static_torques(q, two), "q1 and load must broadcast"),
        (lambda: CROUCH.static_torques(0.1, [1.0, math.inf]), r"^load must be finite at index"),
        (lambda: CROUCH.inverse("high"), "h must be numbers"),
    ):
        with pytest.raises((ArgumentError, GeometryError), match=message):
            call()
