"""Rates: the Jacobian and joint motion against differences of positions, and singular poses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from poses import BATCHES, RIGHT, RIGID, sample

from fivebar_sim import kinematics
from fivebar_sim.errors import ArgumentError, LoopOpenError, SingularError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.planar import wrap

LINE = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)
"""At IN_LINE its B, C and D are in line, and |BD| = L2 + L3 to the last bit."""
IN_LINE = (math.pi, 0.0)


# slope


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("assembly", [-1, 1])
@pytest.mark.parametrize("mode", MODES)
def test_jacobian_is_the_slope_of_forward(
    batch: tuple[int, ...], mode: Mode, assembly: int
) -> None:
    theta = sample(RIGID, batch, mode, assembly)[1]
    h = 3e-6
    steps = [kinematics.forward(RIGID, theta + h * e, assembly) for e in (*np.eye(2), *-np.eye(2))]
    slopes = np.stack([(steps[0] - steps[2]), (steps[1] - steps[3])], axis=-1) / (2.0 * h)
    J = kinematics.jacobian(RIGID, theta, assembly)
    # h^2 C'''/6 with C''' below 6000 |J| this far from singular; eps size / h is 1e-11
    np.testing.assert_allclose(J, slopes, rtol=0, atol=1e-8 * np.abs(J).max())


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("mode", MODES)
def test_joint_motion_is_the_slope_of_inverse(batch: tuple[int, ...], mode: Mode) -> None:
    foot, theta = sample(RIGID, batch, mode)
    h = 1e-5
    v, a = np.random.default_rng(8).uniform(-0.1, 0.1, (2, *foot.shape))
    now, after, before = (
        kinematics.joint_motion(RIGID, foot + v * t + a * t**2 / 2, v + a * t, a, mode=mode)
        for t in (0.0, h, -h)
    )
    knees = kinematics.passive(RIGID, theta)
    q = np.stack([theta[..., 0], knees[..., 0], theta[..., 1], knees[..., 1]], axis=-1)
    np.testing.assert_allclose(now.q, q, rtol=0, atol=1e-13)
    rates = wrap(after.q - before.q) / (2.0 * h)
    np.testing.assert_allclose(now.q_dot, rates, rtol=0, atol=1e-7)
    accelerations = (after.q_dot - before.q_dot) / (2.0 * h)
    np.testing.assert_allclose(now.q_ddot, accelerations, rtol=0, atol=1e-6)
    J_rate = np.einsum("...ij,...j->...i", kinematics.jacobian(RIGID, theta), now.q_dot[..., ::2])
    np.testing.assert_allclose(J_rate, v, rtol=0, atol=1e-14)


# oracle


def test_batch_is_a_plain_loop_to_the_last_bit() -> None:
    foot, theta = sample(RIGID, (100,))
    v, a = np.random.default_rng(8).uniform(-0.1, 0.1, (2, 100, 2))
    J = [kinematics.jacobian(RIGID, row) for row in theta]
    np.testing.assert_array_equal(kinematics.jacobian(RIGID, theta), J)
    rows = [kinematics.joint_motion(RIGID, *row) for row in zip(foot, v, a, strict=True)]
    for batch, loop in zip(
        kinematics.joint_motion(RIGID, foot, v, a), zip(*rows, strict=True), strict=True
    ):
        np.testing.assert_array_equal(batch, loop)


@pytest.mark.parametrize("leg", [RIGID, RIGHT], ids=["with L6", "without"])
def test_pose_alone_is_one_of_many_to_the_last_bit(leg: FiveBar) -> None:
    theta = sample(leg, (100,))[1]
    feet, J = kinematics.foot_and_jacobian(leg, theta)
    points = kinematics.closed_points(leg, theta)
    for k, row in enumerate(theta):
        for shape in ((2,), (1, 2)):
            one = row.reshape(shape)
            foot, slope = kinematics.foot_and_jacobian(leg, one)
            assert (foot.shape, slope.shape) == (shape, (*shape, 2))
            np.testing.assert_array_equal(foot.ravel(), feet[k])
            np.testing.assert_array_equal(slope.ravel(), J[k].ravel())
            for alone, many in zip(kinematics.closed_points(leg, one), points, strict=True):
                assert alone.shape == shape
                np.testing.assert_array_equal(alone.ravel(), many[k])


# edge


def test_right_angled_pose_by_hand() -> None:
    """Knees at (-+38.4, -28.8) mm: AB x BC = 1200 mm^2, BC x DC = -860.16 mm^2."""
    theta = kinematics.inverse(RIGHT, (0.0, -0.04))
    J = [[1.0 / 64.0, 1.0 / 64.0], [-3.0 / 56.0, 3.0 / 56.0]]
    np.testing.assert_allclose(kinematics.jacobian(RIGHT, theta), J, rtol=1e-14)
    # straight up at 1 m/s: theta_dot = -+28/3 rad/s, psi_2 = -psi_3 from the legs of the triangles
    motion = kinematics.joint_motion(RIGHT, (0.0, -0.04), (0.0, 1.0), (0.0, 0.0))
    np.testing.assert_allclose(motion.q_dot[::2], (-28.0 / 3.0, 28.0 / 3.0), rtol=1e-14)
    np.testing.assert_allclose(motion.q_dot[1::2], (100.0 / 3.0, -100.0 / 3.0), rtol=1e-13)


def test_rest_and_still_foot_do_not_move() -> None:
    motion = kinematics.joint_motion(
        RIGID, sample(RIGID, (5,))[0], np.zeros((5, 2)), np.zeros((5, 2))
    )
    assert not motion.q_dot.any()
    assert not motion.q_ddot.any()


# refusal


def test_singular_poses_name_the_first_index() -> None:
    theta = [(math.pi - 0.5, 0.5), IN_LINE]
    with pytest.raises(
        SingularError, match=r"1 of 2 poses are singular: B, C and D are in line"
    ) as info:
        kinematics.jacobian(LINE, theta)
    assert info.value.index == (1,)
    with pytest.raises(
        SingularError, match=r"the pose is singular: B, C .* above 2\.4e-07, got \S+$"
    ):
        kinematics.jacobian(LINE, IN_LINE)
    with pytest.raises(SingularError, match=r"1 of 1 poses are singular") as info:
        kinematics.jacobian(LINE, [IN_LINE])
    assert info.value.index == (0,)

    leg = FiveBar(0.25, 0.5, 0.5, 0.375, 0.5)
    still = np.zeros(2)
    for x_F, chain in ((0.5, "A, B and F"), (-0.625, "E, D and C")):  # stretched to the last bit
        foot = [(0.0, -0.5), (x_F, 0.0)]
        with pytest.raises(SingularError, match=f"{chain} are in line") as info:
            kinematics.joint_motion(leg, foot, still, still)
        assert info.value.index == (1,)


def test_open_and_unreachable_and_wrong_shapes_are_refused() -> None:
    for theta, count, index in (
        ((math.pi, 0.0), "here", ()),
        ([(math.pi, 0.0)], "in 1 of 1", (0,)),
    ):
        with pytest.raises(LoopOpenError, match=f"the loop is open {count}") as info:
            kinematics.jacobian(RIGHT, theta)
        assert info.value.index == index
    with pytest.raises(UnreachableError):
        kinematics.joint_motion(RIGHT, (0.0, -0.5), (0.0, 0.0), (0.0, 0.0))
    with pytest.raises(ArgumentError, match="assembly must be -1 or 1, got 2"):
        kinematics.jacobian(RIGHT, (-1.85, -1.28), 2)
    pair = (0.0, -0.04)
    three = (0.0, 0.0, 0.0)
    with pytest.raises(ArgumentError, match=r"foot_dot must have shape"):
        kinematics.joint_motion(RIGHT, pair, three, pair)
    with pytest.raises(ArgumentError, match=r"foot_ddot must have shape"):
        kinematics.joint_motion(RIGHT, pair, pair, three)
    with pytest.raises(ArgumentError, match=r"theta must have shape"):
        kinematics.jacobian(RIGHT, three)
