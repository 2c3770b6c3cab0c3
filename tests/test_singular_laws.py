"""Where links count as in line, and loops as closed, whatever the leg measures."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fivebar_sim import dynamics, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import LoopOpenError, SingularError, UnreachableError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.rates import SINGULAR
from fivebar_sim.kinematics.reach import points_at

LINE = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)
"""At (pi, 0) its B, C and D are in line; the sine at C is 2^0.5 t at (pi - t, t)."""
SIZES = (2.0**-6, 1.0, 4.0)
H = 1e-3
AHEAD = np.array([1.0, 0.0])


def stretched(size: float, sine: float) -> tuple[FiveBar, Array]:
    """Return LINE times size, and angles where the sine at C is as given."""
    t = sine / math.sqrt(2.0)
    return scaled(LINE, size), np.array([math.pi - t, t])


def scaled(leg: FiveBar, size: float) -> FiveBar:
    """Return a leg of size times the lengths of the links."""
    L1, L2, L3, L4, L5 = (size * L for L in (leg.L1, leg.L2, leg.L3, leg.L4, leg.L5))
    return FiveBar(L1, L2, L3, L4, L5, scale="any")


@pytest.mark.parametrize("size", SIZES)
def test_in_line_is_an_angle_whatever_the_leg_measures(size: float) -> None:
    asks: list[Callable[[FiveBar, Array], Array]] = [
        kinematics.jacobian,
        dynamics.mass_matrix,
        lambda leg, theta: dynamics.step_torques(leg, np.tile(q_of(leg, theta), (2, 1)), H),
    ]
    for ask in asks:
        assert np.isfinite(ask(*stretched(size, 1.3 * SINGULAR))).all()
        with pytest.raises(SingularError, match="B, C and D are in line"):
            ask(*stretched(size, 0.7 * SINGULAR))


def q_of(leg: FiveBar, theta: Array) -> Array:
    knees = kinematics.passive(leg, theta)
    return np.array([theta[0], knees[0], theta[1], knees[1]])


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("side", ["A", "E"])
def test_straight_side_is_an_angle_whatever_the_leg_measures(size: float, side: str) -> None:
    """F at sqrt(L1^2 + L2^2 + 2 L1 L2 cos of the sine's angle) from a motor."""
    leg = scaled(FiveBar(0.25, 0.5, 0.5, 0.375, 0.5), size)
    near, far = (leg.L1, leg.L2) if side == "A" else (leg.L4, leg.L3)
    motor = kinematics.bases(leg)[0 if side == "A" else 1]
    way = np.array([1.0, 0.0]) if side == "A" else np.array([-1.0, 0.0])
    still = np.zeros(2)
    for sine, legal in ((1.4 * SINGULAR, True), (0.6 * SINGULAR, False)):
        d = near + far - near * far * sine**2 / (2.0 * (near + far))
        foot = motor + d * way
        theta = kinematics.inverse(leg, foot)
        points = points_at(leg, foot, theta)
        sign = int(kinematics.branch(leg, points).assembly)
        asks: list[Callable[[], object]] = [
            lambda foot=foot: kinematics.joint_motion(leg, foot, still, still),
            lambda theta=theta, sign=sign: dynamics.reflected_inertia(
                replace(leg, assembly=-sign), theta, assembly=sign
            ),
        ]
        for ask in asks:
            if legal:
                ask()
                continue
            with pytest.raises(SingularError, match="are in line"):
                ask()


def test_pose_in_line_is_told_by_its_place_and_sine() -> None:
    leg = FiveBar(0.25, 0.5, 0.5, 0.375, 0.5)
    theta = kinematics.inverse(leg, [(0.0, -0.5), (0.5, 0.0)])
    sign = int(kinematics.branch(leg, points_at(leg, np.array([0.5, 0.0]), theta[1])).assembly)
    said = "singular: A, B and F are in line, the foot's inertia is infinite"
    legal = r"the sine of the angle there must be above 2\.4e-07, got [\d.]+e-1\d"
    for angles, whole in (
        (theta[1], rf"the pose is {said}; {legal}"),
        (theta, rf"1 of 2 poses are {said}; {legal} at index \(1,\)"),
    ):
        with pytest.raises(SingularError) as info:
            dynamics.reflected_inertia(leg, angles, assembly=sign)
        assert re.fullmatch(whole, str(info.value))

    rest = kinematics.home(leg)
    folded = rest.copy()
    folded[3] = rest[0] + rest[1] - rest[2]  # L3 along L2
    rows = np.stack([rest, rest, folded, rest])
    with pytest.raises(SingularError, match=r"got \d.\de-1\d|got 0.0e\+00") as info:
        dynamics.step_torques(leg, rows, H)
    assert info.value.index == (2,)
    straight = rest.copy()
    straight[3] = 0.0  # L3 along L4
    with pytest.raises(SingularError, match=r"E, D and C are in line: .* got 0.0e.00") as info:
        dynamics.soft_loop(leg, np.tile(straight, (3, 1)), H, 0.0)
    assert info.value.index == (0,)


@pytest.mark.parametrize("size", SIZES)
def test_loop_closes_but_for_rounding_whatever_the_leg_measures(size: float) -> None:
    """At (pi, 0) |BD| is the size; L2 and L3 span it, or miss it by a part of 1e-12."""
    theta = np.array([math.pi, 0.0])
    C = kinematics.closed_points(scaled(LINE, size), theta).C_left
    np.testing.assert_allclose(C, 0.0, rtol=0, atol=1e-7 * size)
    short = scaled(replace(LINE, L2=0.5 * (1.0 - 2e-12)), size)
    with pytest.raises(LoopOpenError):
        kinematics.forward(short, theta)
    near = scaled(FiveBar(0.04, 0.06, 0.06, 0.04, 0.0), size)
    for apart in (1e-8, 1e-11):  # of B and D, in rad about the motors
        p = kinematics.closed_points(near, np.array([0.5, 0.5 + apart]))
        assert np.hypot(*(p.C_left - p.B)) == pytest.approx(near.L2, rel=1e-12)


@pytest.mark.parametrize("size", SIZES)
def test_reach_ends_but_for_rounding_whatever_the_leg_measures(size: float) -> None:
    leg = scaled(LINE, size)
    A = kinematics.bases(leg)[0]
    span = leg.L1 + leg.L2
    assert np.isfinite(kinematics.inverse_within(leg, A + span * AHEAD, [(-4.0, 4.0)] * 2)).all()
    for way in (AHEAD, -AHEAD):
        with pytest.raises(UnreachableError, match=r"\|AF\| must be in"):
            kinematics.inverse(leg, A + span * (1.0 + 1e-12) * way)


def test_signs_of_branches_are_whole_numbers() -> None:
    found = kinematics.branch(LINE, kinematics.closed_points(LINE, np.array([2.5, 0.6])))
    assert [sign.dtype for sign in found] == [np.dtype(int)] * 3
