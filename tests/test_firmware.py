"""The firmware computes what the exact kinematics do: angles, rates, torques, hips, servos, gaits.

That its C code has the same bits is in test_firmware_bits.py, how near it comes in
test_firmware_accuracy.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fivebar_sim import dynamics, firmware, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.control import hobby
from fivebar_sim.firmware import FirmwareServo, Hip, Status
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.kinematics import hip as exact_hip

PRESETS = ("airhockey", "classic", "doggo", "extended", "minitaur", "q8bot")
EACH = pytest.mark.parametrize("name", PRESETS)
DOUBLE = np.float64


def poses(leg: FiveBar, count: int = 400) -> Array:
    """Return angles of closed poses that are well away from singular ones."""
    rng = np.random.default_rng(2)
    rest = kinematics.home(leg)[::2]
    return rest + rng.uniform(-0.2, 0.2, (count, 2))


@EACH
def test_rates_and_torques_are_those_of_the_exact_leg(name: str) -> None:
    leg = FiveBar.load(name)
    theta = poses(leg)
    force = np.random.default_rng(3).normal(size=theta.shape)
    for kind, tolerance in ((np.float32, 2e-5), (DOUBLE, 1e-13)):
        made = firmware.of(leg, kind)
        J, status = firmware.jacobian(made, theta, leg.assembly)
        assert not status.any()
        np.testing.assert_allclose(
            J, kinematics.jacobian(leg, theta), rtol=0, atol=tolerance * leg.size
        )
        tau, status = firmware.torque(made, theta, leg.assembly, force)
        assert not status.any()
        expected = dynamics.statics(leg, theta, force)
        np.testing.assert_allclose(tau, expected, rtol=0, atol=6.0 * tolerance * leg.size)


@EACH
def test_joints_are_those_of_the_exact_leg(name: str) -> None:
    leg = FiveBar.load(name)
    theta = poses(leg)
    made = firmware.of(leg, DOUBLE)
    for assembly in (-1, 1):
        points, status = firmware.joints(made, theta, assembly)
        assert not status.any()
        exact = kinematics.closed_points(leg, theta, assembly=assembly)
        for ours, theirs in zip(points, (exact.B, exact.C_left, exact.D, exact.F), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-14 * leg.size)
    B, D, status = firmware.knees(made, theta)
    assert not status.any()
    np.testing.assert_array_equal(B, points.B)
    np.testing.assert_array_equal(D, points.D)


@EACH
def test_the_nearest_mode_is_the_exact_one(name: str) -> None:
    leg = FiveBar.load(name)
    rng = np.random.default_rng(4)
    foot = kinematics.forward(leg, poses(leg))
    now = rng.uniform(-9.0, 9.0, foot.shape)
    near, status = firmware.inverse_nearest(firmware.of(leg, DOUBLE), foot, now)
    assert not status.any()
    exact = kinematics.inverse_nearest(leg, foot, now)
    np.testing.assert_allclose(near, exact, rtol=0, atol=1e-12)
    assert (np.abs(near - now) <= np.pi + 1e-12).all()


def test_a_motor_beyond_half_a_turn_is_not_unwound() -> None:
    made = firmware.of(FiveBar.load("classic"))
    theta, _ = firmware.inverse(made, (0.01, -0.07), -1, 1)
    for turns in (-3, 1, 5):
        now = theta.astype(float) + turns * 2.0 * np.pi
        near, status = firmware.inverse_nearest(made, (0.01, -0.07), now)
        assert status == Status.OK
        np.testing.assert_allclose(near, now, rtol=0, atol=4e-6)


@pytest.mark.parametrize("kind", [np.float32, DOUBLE])
@pytest.mark.parametrize("steering", [False, True])
@pytest.mark.parametrize("side", [-1, 1])
def test_hips_turn_as_the_exact_ones(steering: bool, side: int, kind: Any) -> None:
    leg = FiveBar.load("extended")
    made = firmware.of(leg, kind)
    exact = (exact_hip.Steering if steering else exact_hip.SideStep)(leg, 0.02, -0.01, side)
    hip = Hip(steering, side, 0.02, -0.01)
    rng = np.random.default_rng(6)
    foot = rng.uniform(-0.15, 0.15, (3000, 3)).astype(kind).astype(float)
    angles, status = firmware.hip_inverse(made, hip, foot, *leg.mode)
    assert set(np.unique(status)) == {Status.OK, Status.UNREACHABLE}
    plane, _, _ = exact_hip._turn_back(exact, foot, None)
    good = status == Status.OK
    # Near the axis phi is uncertain by the rounding of the foot's place, over the distance.
    off = np.abs(np.exp(1j * angles[good, 0]) - np.exp(1j * plane[good]))
    assert off.max() < 4e4 * np.finfo(kind).eps
    assert np.median(off) < 8.0 * np.finfo(kind).eps
    np.testing.assert_allclose(
        angles[good],
        exact_hip.inverse(exact, foot[good]),
        rtol=0,
        atol=1e5 * np.finfo(kind).eps,
    )
    theta = np.concatenate([rng.uniform(-3.0, 3.0, (400, 1)), poses(leg)], axis=-1)
    back, status = firmware.hip_forward(made, hip, theta, leg.assembly)
    assert not status.any()
    tolerance = 50.0 * np.finfo(kind).eps * leg.size
    np.testing.assert_allclose(back, exact_hip.forward(exact, theta), rtol=0, atol=tolerance)


def test_hips_that_are_none_are_refused() -> None:
    made = firmware.of(FiveBar.load("classic"))
    for hip, status in (
        (Hip(True, 0, 0.0, 0.0), Status.BAD_ARGUMENT),
        (Hip(False, 1, np.nan, 0.0), Status.NOT_FINITE),
    ):
        assert firmware.hip_inverse(made, hip, (0.0, 0.0, -0.07), -1, 1)[1] == status
        assert firmware.hip_forward(made, hip, (0.0, -2.3, -0.8), -1)[1] == status


def test_servos_command_what_hobby_servos_do() -> None:
    """In whole degrees, for all angles that are not at a half step."""
    leg = FiveBar.load("classic")
    theta = np.random.default_rng(8).uniform(-7.0, 7.0, (4000, 2))
    degree = np.pi / 180.0
    for side, own in enumerate((hobby.HANGING.A, hobby.HANGING.E)):
        servo = FirmwareServo(own.offset, own.direction, *own.range, 0, 180)
        command, status = firmware.servo_command(servo, theta[:, side], np.float64)
        good = status == Status.OK
        assert set(np.unique(status)) == {Status.OK, Status.OUT_OF_LIMITS}
        pairs = np.where(good[:, None], theta, [-0.75 * np.pi, -0.25 * np.pi])
        pairs[:, 1 - side] = (-0.75 * np.pi, -0.25 * np.pi)[1 - side]
        exact = hobby.servo_angles(leg, pairs)[:, side] / degree
        np.testing.assert_allclose(command[good], exact[good], rtol=0, atol=1e-9)
        back, status = firmware.servo_angle(servo, command[good], np.float64)
        assert not status.any()
        off = np.abs(np.exp(1j * back) - np.exp(1j * theta[good, side]))
        assert off.max() < 0.5 * degree + 1e-9


@pytest.mark.parametrize(
    ("servo", "status"),
    [
        (FirmwareServo(0.0, 1, 1.0, 1.0, 0, 180), Status.BAD_ARGUMENT),
        (FirmwareServo(0.0, 1, 2.0, 1.0, 0, 180), Status.BAD_ARGUMENT),
        (FirmwareServo(0.0, 1, 0.0, 7.0, 0, 180), Status.BAD_ARGUMENT),
        (FirmwareServo(0.0, 0, 0.0, 1.0, 0, 180), Status.BAD_ARGUMENT),
        (FirmwareServo(0.0, 1, 0.0, 1.0, 180, 180), Status.BAD_ARGUMENT),
        (FirmwareServo(np.inf, 1, 0.0, 1.0, 0, 180), Status.NOT_FINITE),
        (FirmwareServo(0.0, 1, 0.0, 1.0, 0, 180), Status.OK),
    ],
)
def test_servos_whose_limits_cross_are_refused(servo: FirmwareServo, status: Status) -> None:
    assert firmware.servo_command(servo, 0.5)[1] == status
    assert firmware.servo_angle(servo, 90)[1] == status


def test_ends_of_a_servo_are_within_it() -> None:
    servo = FirmwareServo(0.5 * np.pi, -1, 0.0, np.pi, 500, 2500)
    theta = np.array([0.5 * np.pi, -0.5 * np.pi, 0.0, 0.5 * np.pi + 0.001, np.nan, 1e9])
    command, status = firmware.servo_command(servo, theta)
    limits = Status.OUT_OF_LIMITS
    assert status.tolist() == [0, 0, 0, limits, Status.NOT_FINITE, limits]
    assert command[:3].tolist() == [500, 2500, 1500]


def test_gaits_go_straight_from_row_to_row() -> None:
    rows = np.array([[0.0, 1.0], [1.0, 3.0], [4.0, 2.0], [2.0, 0.0]])
    for periodic, place in ((True, 4.0), (False, 3.0)):
        at, status = firmware.gait_at(rows, periodic, np.arange(4) / place)
        assert not status.any()
        np.testing.assert_allclose(at, rows, rtol=0, atol=1e-15)
        between, _ = firmware.gait_at(rows, periodic, 1.5 / place)
        np.testing.assert_allclose(between, [2.5, 2.5], rtol=0, atol=1e-14)
    # The last row of a period goes on to the first one, of one that ends nowhere.
    np.testing.assert_allclose(firmware.gait_at(rows, True, 3.5 / 4.0)[0], [1.0, 0.5])
    np.testing.assert_allclose(firmware.gait_at(rows, False, 1.0)[0], rows[-1])
    np.testing.assert_allclose(firmware.gait_at(rows, True, -1.25)[0], rows[3])
    phase = [1.1, -0.1, np.nan]
    limits = Status.OUT_OF_LIMITS
    assert firmware.gait_at(rows, False, phase)[1].tolist() == [limits, limits, Status.NOT_FINITE]
    assert firmware.gait_at(rows[:1], True, 0.5)[1] == Status.BAD_ARGUMENT


def test_every_refusal_has_its_status() -> None:
    leg = FiveBar.load("classic")
    made = firmware.of(leg)
    foot = (0.0, -0.07)
    assert firmware.inverse(made, (0.0, np.nan), -1, 1)[1] == Status.NOT_FINITE
    assert firmware.inverse(made, foot, 0, 1)[1] == Status.BAD_ARGUMENT
    assert firmware.inverse(made, (0.0, -0.2), -1, 1)[1] == Status.UNREACHABLE
    assert firmware.inverse(made, (0.0, -1e30), -1, 1)[1] == Status.UNREACHABLE
    assert firmware.forward(made, (np.inf, 0.0), 1)[1] == Status.NOT_FINITE
    assert firmware.forward(made, (65.0, 0.0), 1)[1] == Status.OUT_OF_LIMITS
    assert firmware.forward(made, (0.0, 0.0), 2)[1] == Status.BAD_ARGUMENT
    assert firmware.reaches(made, foot, 2) == Status.BAD_ARGUMENT
    assert firmware.nearest(made, (1e7, 0.0))[1] == Status.OUT_OF_LIMITS
    assert firmware.torque(made, (-2.0, -1.0), -1, (np.nan, 0.0))[1] == Status.NOT_FINITE
    # Knees farther apart than both lower links; and B on D, which only coaxial legs can do.
    wide = firmware.of(FiveBar(L2=0.03, L3=0.03))
    assert firmware.forward(wide, (np.pi, 0.0), -1)[1] == Status.LOOP_OPEN
    coaxial = firmware.of(FiveBar.load("doggo"))
    assert firmware.forward(coaxial, (0.3, 0.3), -1)[1] == Status.LOOP_OPEN
    # L2 and L3 in line: C is where it is, but its velocity is not.
    straight = firmware.of(FiveBar(L1=0.04, L2=0.05, L3=0.05, L4=0.04, L5=0.02))
    assert firmware.forward(straight, (np.pi, 0.0), -1)[1] == Status.OK
    assert firmware.jacobian(straight, (np.pi, 0.0), -1)[1] == Status.SINGULAR


def test_a_leg_for_every_point_is_as_one_leg() -> None:
    """What tests of many legs rely on: arrays of legs and points broadcast."""
    legs = [FiveBar.load(name) for name in PRESETS]
    keys = ("L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt", "assembly")
    fields: dict[str, Any] = {key: [getattr(leg, key) for leg in legs] for key in keys}
    fields["s_A"] = [leg.mode[0] for leg in legs]
    fields["s_E"] = [leg.mode[1] for leg in legs]
    many, status = firmware.prepare(fields)
    assert not status.any()
    foot = np.array([(0.0, leg.size) for leg in legs]) * 0.7
    theta, each = firmware.inverse_all(many, foot)
    assert each.shape == (len(legs), len(MODES))
    for k, leg in enumerate(legs):
        one, status = firmware.inverse_all(firmware.of(leg), foot[k])
        np.testing.assert_array_equal(one, theta[k])
        np.testing.assert_array_equal(status, each[k])
