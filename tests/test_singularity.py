"""Signed distances: against determinants, differences of positions, and poses built singular."""

from __future__ import annotations

import math

import numpy as np
import pytest
from poses import BATCHES, RIGHT, RIGID, random_leg, sample

from fivebar_sim import kinematics
from fivebar_sim.analysis.singularity import (
    EDGE,
    Distances,
    distances,
    distances_at,
    distances_of,
    shorter_links,
    signs,
)
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, LoopOpenError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics import Points
from fivebar_sim.kinematics.planar import cross, unit
from fivebar_sim.kinematics.reach import points_at

DYADIC = FiveBar(0.25, 0.5, 0.75, 0.375, 0.5)  # sums and differences of the links are exact
EQUAL = FiveBar(0.25, 0.25, 0.25, 0.25, 0.125)


def random_poses(rng: np.random.Generator, leg: FiveBar, count: int) -> tuple[Array, int]:
    """Return angles (n, 2) of closed poses, and an assembly mode."""
    theta = rng.uniform(-np.pi, np.pi, (count, 2))
    B, D = kinematics.knees(leg, theta)
    d = np.hypot(*(D - B).T)
    return theta[(d > abs(leg.L2 - leg.L3)) & (d < leg.L2 + leg.L3)], int(rng.choice([-1, 1]))


def slope_determinant(leg: FiveBar, theta: Array, assembly: int, h: float = 1e-6) -> Array:
    steps = [kinematics.forward(leg, theta + h * e, assembly) for e in (*np.eye(2), *-np.eye(2))]
    return cross(steps[0] - steps[2], steps[1] - steps[3]) / (2.0 * h) ** 2


def product(leg: FiveBar, d: Distances) -> Array:
    """Return det J by the distances alone: side_A side_E / loop, times the longer links."""
    rho = float(np.hypot(*leg.foot_offset))
    longer = max(leg.L1, rho) * max(leg.L4, leg.L3) / max(leg.L2, leg.L3)
    return d.side_A * d.side_E / d.loop * longer


# law


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("assembly", [-1, 1])
@pytest.mark.parametrize("mode", MODES)
def test_signs_are_the_modes(batch: tuple[int, ...], mode: Mode, assembly: int) -> None:
    foot, theta = sample(RIGID, batch, mode, assembly)
    d = distances(RIGID, theta, assembly=assembly)
    assert all(np.shape(each) == batch for each in d)
    np.testing.assert_array_equal(signs(RIGID, d), np.broadcast_to((*mode, assembly), (*batch, 3)))
    # eps size / sine: the samples' sines are above 0.4
    np.testing.assert_allclose(distances_at(RIGID, foot, mode=mode), d, rtol=0, atol=1e-15)


def test_determinants_of_the_loop_equation(rng: np.random.Generator) -> None:
    """M_x C_dot = M_theta theta_dot, assembled link by link; the foot's as slopes elsewhere."""
    for _ in range(200):
        leg = random_leg(rng)
        theta, assembly = random_poses(rng, leg, 50)
        d = distances(leg, theta, assembly=assembly)
        p = kinematics.closed_points(leg, theta, assembly=assembly)
        A, E = kinematics.bases(leg)
        AB = p.B - A
        ED = p.D - E
        BC = p.C_left - p.B
        DC = p.C_right - p.D
        det_x = np.linalg.det(np.stack([BC, DC], axis=-2))
        rounding = 1e-15 * (leg.size + leg.L5) ** 2
        np.testing.assert_allclose(det_x, d.loop * max(leg.L2, leg.L3), rtol=0, atol=rounding)
        factor = -d.side_E * max(leg.L4, leg.L3)
        np.testing.assert_allclose(cross(ED, DC), factor, rtol=0, atol=rounding)
        if leg.L6 == 0.0:
            factor = -d.side_A * max(leg.L1, leg.L2)
            np.testing.assert_allclose(cross(AB, BC), factor, rtol=0, atol=rounding)


def test_distance_is_shorter_link_times_sine(rng: np.random.Generator) -> None:
    """It is the lesser distance of either far end from the other link's line."""
    for _ in range(50):
        leg = random_leg(rng)
        theta, assembly = random_poses(rng, leg, 20)
        d = distances(leg, theta, assembly=assembly)
        p = kinematics.closed_points(leg, theta, assembly=assembly)
        A, E = kinematics.bases(leg)
        pairs = ((A, p.B, p.F), (E, p.D, p.C_right), (p.B, p.C_left, p.D))
        for each, (start, knee, end) in zip(d, pairs, strict=True):
            a = start - knee
            b = end - knee
            lines = [np.abs(cross(a, b)) / np.hypot(*v.T) for v in (a, b)]
            np.testing.assert_allclose(np.abs(each), np.min(lines, axis=0), rtol=0, atol=1e-15)


# slope


@pytest.mark.parametrize("assembly", [-1, 1])
@pytest.mark.parametrize("mode", MODES)
def test_determinant_of_slopes_is_product_of_distances(mode: Mode, assembly: int) -> None:
    theta = sample(RIGID, (30,), mode, assembly)[1]
    det = product(RIGID, distances(RIGID, theta, assembly=assembly))
    slopes = slope_determinant(RIGID, theta, assembly)
    # rounding eps size / h is 1e-11 of J ~ 0.1; h^2 C''' is less
    np.testing.assert_allclose(slopes, det, rtol=0, atol=1e-9 * np.abs(det).max())


def test_signs_change_where_the_determinant_of_slopes_does(rng: np.random.Generator) -> None:
    """Along random curves of the motors: J's sign by differences is s_A s_E assembly throughout."""
    changes = 0
    for _ in range(100):
        leg = random_leg(rng)
        theta, assembly = random_poses(rng, leg, 1)
        if not len(theta):
            continue
        t = np.linspace(0.0, 1.5, 400)[:, None]
        path = theta[0] + rng.uniform(-1.0, 1.0, 2) * t + rng.uniform(-1.0, 1.0, 2) * t**2
        B, D = kinematics.knees(leg, path)
        gap = np.hypot(*(D - B).T)
        path = path[(gap > abs(leg.L2 - leg.L3) + 1e-4) & (gap < leg.L2 + leg.L3 - 1e-4)]
        d = distances(leg, path, assembly=assembly)
        clear = (np.abs(d) > 1e-3 * np.array(shorter_links(leg))[:, None]).all(axis=0)
        sign = signs(leg, d).prod(axis=-1)[clear]
        np.testing.assert_array_equal(
            sign, np.sign(slope_determinant(leg, path[clear], assembly, 1e-7))
        )
        changes += np.count_nonzero(np.diff(sign))
    assert changes > 40


@pytest.mark.parametrize("turn", [0.0, math.pi])
@pytest.mark.parametrize("leg", [RIGID, DYADIC, FiveBar(0.06, 0.03, 0.05, 0.02, 0.03)])
def test_slope_at_zero_is_the_shorter_link(leg: FiveBar, turn: float) -> None:
    """With the angle past straight (turn 0) or folded (turn pi) as the parameter."""
    h = 1e-5
    bend = float(np.angle(complex(*leg.foot_offset)))

    def at(angle: float) -> Distances:
        knees = np.array([0.4, turn + angle - bend, 1.0, turn + angle])
        p = kinematics.chain_points(leg, knees)
        D = p.C_left - leg.L3 * unit(0.4 + knees[1] + turn + angle)
        across = distances_of(leg, Points(p.B, p.C_left, p.C_left, D, p.F))
        sides = distances_of(leg, p)
        return Distances(sides.side_A, sides.side_E, across.loop)

    zero = at(0.0)
    rho = float(np.hypot(*leg.foot_offset))
    sign = math.cos(turn) * np.array([-1.0, -1.0, 1.0])  # loop = BC x DC, the sides' opposite
    expected = sign * [min(leg.L1, rho), min(leg.L4, leg.L3), min(leg.L2, leg.L3)]
    slope = (np.array(at(h)) - np.array(at(-h))) / (2.0 * h)
    np.testing.assert_allclose(zero, 0.0, atol=1e-15)
    np.testing.assert_allclose(slope, expected, rtol=1e-9)  # h^2 / 6, and eps size / h


# oracle


def test_batch_is_a_plain_loop_to_the_last_bit() -> None:
    foot, theta = sample(RIGID, (100,))
    for batch, loop in (
        (distances(RIGID, theta), [distances(RIGID, row) for row in theta]),
        (distances_at(RIGID, foot), [distances_at(RIGID, row) for row in foot]),
    ):
        np.testing.assert_array_equal(np.transpose(batch), loop)


# edge


@pytest.mark.parametrize(
    ("mode", "foot", "zero"),
    [
        ((1, 1), (-0.25, -0.75), "side_A"),  # |AF| = 0.75, stretched
        ((-1, 1), (-0.25, 0.25), "side_A"),  # |AF| = 0.25, folded
        ((1, 1), (-0.875, 0.0), "side_E"),  # |EF| = 1.125, stretched
        ((1, -1), (0.25, 0.375), "side_E"),  # |EF| = 0.375, folded
    ],
)
def test_stretched_and_folded_sides(mode: Mode, foot: tuple[float, float], zero: str) -> None:
    d = distances_at(DYADIC, foot, mode=mode)
    expected = [s * (name != zero) for s, name in zip(np.sign(d), d._fields, strict=True)]
    assert signs(DYADIC, d).tolist() == expected
    assert abs(getattr(d, zero)) < 1e-15


def test_stretched_side_by_its_angles() -> None:
    """A, B, C in line, down: J's columns are parallel, and not so in the other assembly mode."""
    theta = np.array([-0.5 * np.pi, kinematics.inverse(DYADIC, (-0.25, -0.75))[1]])
    found = []
    for assembly in (-1, 1):
        on = abs(kinematics.forward(DYADIC, theta, assembly)[1] + 0.75) < 1e-15
        assert (abs(distances(DYADIC, theta, assembly=assembly).side_A) < 1e-15) == on
        assert (abs(slope_determinant(DYADIC, theta, assembly)) < 1e-9) == on
        found.append(on)
    assert sorted(found) == [False, True]


@pytest.mark.parametrize("assembly", [-1, 1])
def test_flat_loop_stretched_and_folded(assembly: int) -> None:
    line = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)  # at (pi, 0) |BD| = 1 m = L2 + L3
    assert distances(line, (math.pi, 0.0), assembly=assembly).loop == pytest.approx(0.0, abs=1e-16)
    folded = FiveBar(0.125, 0.75, 0.5, 0.125, 0.5)  # at (0, pi) |BD| = 0.25 m = L2 - L3
    d = distances(folded, (0.0, math.pi), assembly=assembly)
    assert d.loop == pytest.approx(0.0, abs=1e-16)
    assert signs(folded, d)[2] == 0


def test_B_on_D_is_singular_wherever_C_is() -> None:
    """The height of C over BD would be a link long; the determinant and the distance are zero."""
    leg = FiveBar(0.25, 0.25, 0.25, 0.25, 0.0)
    foot = [(0.0, -0.25), (0.2, 0.1)]
    d = distances_at(leg, foot, mode=(1, 1))
    np.testing.assert_array_equal(d.loop, 0.0)
    np.testing.assert_array_equal(d.side_A, d.side_E)
    assert (d.side_A > 0.02).all()
    foot = kinematics.bases(EQUAL)[0] + 0.25 * unit(1.3) + 0.25 * unit([0.1, 2.9])
    B = kinematics.bases(EQUAL)[0] + 0.25 * unit(1.3)
    p = Points(*(np.broadcast_to(each, (2, 2)) for each in (B, foot, foot, B, foot)))
    np.testing.assert_array_equal(distances_of(EQUAL, p).loop, 0.0)
    assert (np.abs(distances_of(EQUAL, p).side_A) > 0.02).all()


def test_foot_on_a_motor_is_singular_where_links_are_equal() -> None:
    """The height of B over AF would be undefined; side A folds onto itself."""
    A, E = kinematics.bases(EQUAL)
    assert distances_at(EQUAL, A).side_A == 0.0
    assert distances_at(EQUAL, E).side_E == 0.0
    assert abs(distances_at(EQUAL, A).side_E) > 0.1


def test_knee_in_line_is_no_singularity_of_an_extended_foot() -> None:
    """A, B, C in line with L6 > 0 and a bend: C's Jacobian loses rank, F's does not."""
    leg = FiveBar(0.05, 0.04, 0.05, 0.07, 0.09, 0.03, 1.2)
    bare = FiveBar(0.05, 0.04, 0.05, 0.07, 0.09)
    C = kinematics.bases(bare)[0] + 0.09 * unit(-0.6)  # |AC| = L1 + L2
    theta = kinematics.inverse(bare, C, (1, 1))
    assembly = int(kinematics.branch(bare, points_at(bare, C, theta)).assembly)
    d = distances(leg, theta, assembly=assembly)
    d_bare = distances(bare, theta, assembly=assembly)
    assert abs(d_bare.side_A) < 1e-7 < 0.01 < abs(d.side_A)
    assert abs(slope_determinant(bare, theta, assembly)) < 1e-8
    det = product(leg, d)
    assert abs(det) > 1e-4
    np.testing.assert_allclose(slope_determinant(leg, theta, assembly), det, rtol=1e-8)


def test_shorter_links_by_hand() -> None:
    assert shorter_links(DYADIC) == (0.25, 0.375, 0.5)
    assert shorter_links(FiveBar(0.09, 0.04, 0.05, 0.07, 0.09, 0.03)) == pytest.approx(
        (0.07, 0.05, 0.04)
    )


def test_right_angled_pose_by_hand() -> None:
    """AB x BC = 1200 mm^2 over 40 mm; BC x DC = -860.16 mm^2 over 40 mm."""
    d = distances_at(RIGHT, (0.0, -0.04))
    np.testing.assert_allclose(d, (-0.03, 0.03, -0.021504), rtol=1e-14)


def test_signs_of_singular_poses_are_zero() -> None:
    d = Distances(*(np.array([0.0, 0.9, 1.1]) * EDGE * s for s in shorter_links(RIGID)))
    np.testing.assert_array_equal(signs(RIGID, d), [[0, 0, 0], [0, 0, 0], [1, 1, 1]])


# refusal


def test_open_unreachable_and_wrong_arguments_are_refused() -> None:
    with pytest.raises(LoopOpenError) as open_loop:
        distances(RIGHT, [(-1.85, -1.28), (math.pi, 0.0)])
    assert open_loop.value.index == (1,)
    coaxial = FiveBar(0.25, 0.25, 0.25, 0.25, 0.0)
    with pytest.raises(LoopOpenError, match="must be above 0"):
        distances(coaxial, (0.5, 0.5))
    with pytest.raises(LoopOpenError):
        distances(RIGHT, (math.nan, 0.0))
    with pytest.raises(UnreachableError) as unreachable:
        distances_at(RIGHT, [(0.0, -0.04), (0.0, math.nan)])
    assert unreachable.value.index == (1,)
    with pytest.raises(ArgumentError, match="mode must be one of"):
        distances_at(RIGHT, (0.0, -0.04), mode=(0, 1))
    with pytest.raises(ArgumentError, match="assembly must be -1 or 1, got 0"):
        distances(RIGHT, (-1.85, -1.28), assembly=0)
    with pytest.raises(ArgumentError, match=r"foot must have shape \(\.\.\., 2\)"):
        distances_at(RIGHT, (0.0, 0.0, 0.0))
