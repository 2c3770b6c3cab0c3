"""What float costs at the foot: within the derived bound, and 1e-6 of the leg away from edges."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from extended_legs import Draw, any_leg, coaxial, containing, multiples, narrow, no_hole

from fivebar_sim import firmware, kinematics, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.firmware.accuracy import forward_bound, inverse_bound
from fivebar_sim.firmware.elementary import direction, unit
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.planar import cross
from fivebar_sim.kinematics.reach import points_at

LENGTHS = ("L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt")
PRESETS = ("airhockey", "classic", "doggo", "extended", "minitaur", "q8bot")
KINDS = (np.float32, np.float64)

FEW = 3_000
MANY = 1_000_000

INLINE = 0.02
"""Sine of the angle at C from which the bound's first order is all of it."""

MIDST = 0.3
"""Sine of the angle at C of a pose that counts as away from the edge."""


def as_float(leg: FiveBar) -> FiveBar:
    """Return a leg whose lengths a float holds: the firmware's is the same one."""
    L1, L2, L3, L4, L5, L6, bend, tilt = (float(np.float32(getattr(leg, k))) for k in LENGTHS)
    return FiveBar(L1, L2, L3, L4, L5, L6, bend, tilt)


def drawn_poses(leg: FiveBar, count: int, kind: Any) -> tuple[Array, Array, Array]:
    """Return feet on the leg's branch, a tenth of them at the edge of reach; angles; sines at C."""
    rng = np.random.default_rng(5)
    foot = rng.uniform(-1.0, 1.0, (count, 2)) * (leg.size + leg.L5)
    edge = count // 10
    foot[:edge] = workspace.nearest(leg, foot[:edge], mode=leg.mode)
    # Some within, some beyond, and as the firmware can hold them.
    foot[:edge] += rng.uniform(-1e-7, 1e-7, (edge, 2)) * leg.size
    foot = foot.astype(kind).astype(float)
    foot = foot[workspace.reachable(leg, foot, mode=leg.mode)]
    theta = kinematics.inverse(leg, foot)
    p = points_at(leg, foot, theta)
    sine = cross(p.C_left - p.B, p.C_left - p.D) / (leg.L2 * leg.L3)
    own = leg.assembly * sine > INLINE
    return foot[own], theta[own], np.abs(sine[own])


def check_inverse(leg: FiveBar, count: int, kind: Any) -> tuple[float, float]:
    """Compare angles with their bound; return the worst part of it, and the worst in the midst."""
    foot, exact, sine = drawn_poses(leg, count, kind)
    theta, status = firmware.inverse(firmware.of(leg, kind), foot, *leg.mode)
    assert not status.any()
    # What exact links do at the firmware's angles.
    off = np.hypot(*(kinematics.forward(leg, theta.astype(float)) - foot).T)
    worst = float((off / inverse_bound(leg, exact, kind)).max())
    return worst, float(off[sine > MIDST].max())


def check_forward(leg: FiveBar, count: int, kind: Any) -> tuple[float, float]:
    """Compare feet with their bound, at angles that the firmware can hold."""
    _, theta, sine = drawn_poses(leg, count, kind)
    theta = theta.astype(kind).astype(float)
    foot, status = firmware.forward(firmware.of(leg, kind), theta, leg.assembly)
    assert not status.any()
    off = np.hypot(*(foot - kinematics.forward(leg, theta)).T)
    worst = float((off / forward_bound(leg, theta, kind)).max())
    return worst, float(off[sine > MIDST].max())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", PRESETS)
def test_rounding_at_the_foot_is_within_its_bound(name: str, kind: Any) -> None:
    leg = FiveBar.load(name)
    for check in (check_inverse, check_forward):
        worst, midst = check(leg, FEW, kind)
        # A bound that is a hundred times what happens would say nothing.
        assert 0.01 < worst < 1.0, check
        assert midst < 8.4 * np.finfo(kind).eps * leg.size, check  # 1e-6 in float


@pytest.mark.long
@pytest.mark.parametrize("name", PRESETS)
def test_rounding_of_a_million_poses_is_within_its_bound(name: str) -> None:
    leg = FiveBar.load(name)
    for check in (check_inverse, check_forward):
        worst, midst = check(leg, MANY, np.float32)
        assert worst < 1.0, check
        assert midst < 1e-6 * leg.size, check


@pytest.mark.parametrize("kind", KINDS)
def test_elementary_functions_are_within_their_roundings(kind: Any) -> None:
    rng = np.random.default_rng(3)
    unit_roundoff = 0.5 * float(np.finfo(kind).eps)
    angle = rng.uniform(-64.0, 64.0, 20_000).astype(kind)
    e = unit(angle).astype(np.longdouble)
    exact = angle.astype(np.longdouble)
    # Per part: the reduction 1, the polynomial's terms 0.4, the last sum 0.7, of sine or cosine.
    off = np.abs(e - np.stack([np.cos(exact), np.sin(exact)], axis=-1)).max()
    assert off < 2.1 * unit_roundoff

    x, z = rng.normal(size=(2, 20_000)).astype(kind)
    angle = direction(z, x)
    exact = np.arctan2(z.astype(np.longdouble), x.astype(np.longdouble))
    # The quotient 1.3, the polynomial 0.7, and a rounding at each of pi / 4, pi / 2 and pi, 5.
    assert np.abs(angle - exact).max() < 7.0 * unit_roundoff
    assert (np.abs(angle) <= kind(np.pi)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_directions_on_the_axes_are_exact(kind: Any) -> None:
    z = np.array([0.0, 1.0, 0.0, -1.0, -0.0, -1e-30, 0.0, -0.0, 2.0, -2.0], dtype=kind)
    x = np.array([1.0, 0.0, -1.0, 0.0, -1.0, -1.0, 0.0, -0.0, 2.0, -2.0], dtype=kind)
    half = np.pi / 2.0
    expected = [0.0, half, np.pi, -half, np.pi, np.pi, 0.0, 0.0, np.pi / 4.0, -3.0 * np.pi / 4.0]
    angle = direction(z, x)
    np.testing.assert_array_equal(angle, np.array(expected).astype(kind))


@pytest.mark.parametrize("name", PRESETS)
def test_statuses_are_those_of_the_exact_kinematics(name: str) -> None:
    """But where a point is nearer to the edge of reach than the slack."""
    leg = FiveBar.load(name)
    rng = np.random.default_rng(7)
    foot = rng.uniform(-1.1, 1.1, (4_000, 2)) * (leg.size + leg.L5)
    made = firmware.of(leg)
    far = np.abs(workspace.distance(leg, foot)) > 1e-5 * leg.size
    theta, status = firmware.inverse_all(made, foot)
    exact = kinematics.inverse_all(leg, foot)
    reached = np.isfinite(exact[..., 0])
    np.testing.assert_array_equal((status == firmware.Status.OK)[far], reached[far])
    assert set(np.unique(status)) == {firmware.Status.OK, firmware.Status.UNREACHABLE}
    assert np.isnan(theta[status != firmware.Status.OK]).all()


def check_nearest(leg: FiveBar, foot: Array, kind: Any) -> float:
    """Return how far distances to the nearest points are off, at most, over size and L5."""
    made = firmware.of(leg, kind)
    foot = foot.astype(kind).astype(float)
    found, status = firmware.nearest(made, foot)
    assert not status.any()
    assert not firmware.reaches(made, found).any()
    gap = np.hypot(*(found - foot).T)
    least = np.hypot(*(workspace.nearest(leg, foot) - foot).T)
    # A float counts as in reach what is beyond it by its rounding.
    outside = firmware.reaches(made, foot) != firmware.Status.OK
    return float(np.abs(gap - least)[outside].max(initial=0.0) / (leg.size + leg.L5))


@pytest.mark.parametrize("name", PRESETS)
def test_nearest_points_are_those_of_the_workspace(name: str) -> None:
    leg = FiveBar.load(name)
    rng = np.random.default_rng(11)
    foot = rng.uniform(-2.0, 2.0, (200, 2)) * leg.size
    assert check_nearest(leg, foot, np.float32) < 1e-6
    assert check_nearest(leg, foot, np.float64) < 1e-14


@pytest.mark.parametrize("draw", [any_leg, coaxial, no_hole, containing, narrow])
@pytest.mark.parametrize("count", [2, pytest.param(300, marks=pytest.mark.long)])
def test_nearest_points_of_extended_legs(draw: Draw, count: int) -> None:
    rng = np.random.default_rng(3)
    for _ in range(count):
        leg = as_float(draw(rng))
        foot = rng.uniform(-1.5, 1.5, (12, 2)) * leg.size * rng.choice([0.3, 1.0], (12, 1))
        assert check_nearest(leg, foot, np.float32) < 1e-6
        assert check_nearest(leg, foot, np.float64) < 1e-14


@pytest.mark.parametrize("count", [2, pytest.param(300, marks=pytest.mark.long)])
def test_nearest_points_where_branches_cross(count: int) -> None:
    """Links that are multiples of one length, so that the four-bar can often lie flat.

    There two branches of its curve cross. A minimum just beside the crossing lies within the one
    interval that straddles it, and the next best one is taken.
    """
    rng = np.random.default_rng(3)
    off = []
    for _ in range(count):
        leg = as_float(multiples(rng))
        foot = rng.uniform(-1.5, 1.5, (12, 2)) * leg.size * rng.choice([0.3, 1.0], (12, 1))
        off.append(check_nearest(leg, foot, np.float32))
    assert max(off) < 1e-3
    assert np.mean(np.array(off) > 1e-6) < 0.02


def test_branches_that_cross_hide_no_minimum() -> None:
    """L1 = L2 and L3 + L4 = L5: near the crossing C moves many times as fast as the crank."""
    leg = FiveBar(0.125, 0.125, 0.0625, 0.046875, 0.109375, 0.0390625)
    foot = np.array([[-0.10321482, 0.04628612], [-0.09179764, 0.11424068]])
    assert check_nearest(leg, foot, np.float32) < 1e-6
