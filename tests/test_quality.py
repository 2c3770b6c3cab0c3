"""Ellipses, condition and transmission: against J itself, loops, and poses done by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from poses import BATCHES, RIGHT, RIGID, random_leg, sample

from fivebar_sim import kinematics
from fivebar_sim.analysis import quality
from fivebar_sim.analysis.singularity import distances
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, LoopOpenError, SingularError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.planar import cross, unit

LINE = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)
"""At IN_LINE its B, C and D are in line."""
IN_LINE = (math.pi, 0.0)

STRETCHED = FiveBar(0.25, 0.5, 0.75, 0.375, 0.5)
"""With the foot at (-0.25, -0.75) m, straight below A, its side A is stretched."""


def stretched_pose() -> tuple[Array, int]:
    """Return the angles of STRETCHED's singular pose, and its assembly mode."""
    theta = np.array([-0.5 * np.pi, kinematics.inverse(STRETCHED, (-0.25, -0.75))[1]])
    low = [abs(kinematics.forward(STRETCHED, theta, s)[1] + 0.75) < 1e-12 for s in (-1, 1)]
    return theta, (-1, 1)[low.index(True)]


def lengths(v: Array) -> Array:
    return np.hypot(v[..., 0], v[..., 1])


# law


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("assembly", [-1, 1])
@pytest.mark.parametrize("mode", MODES)
def test_axes_are_orthogonal_and_make_up_J(
    batch: tuple[int, ...], mode: Mode, assembly: int
) -> None:
    theta = sample(RIGID, batch, mode, assembly)[1]
    J = kinematics.jacobian(RIGID, theta, assembly)
    s, u = quality.velocity_ellipse(RIGID, theta, assembly=assembly)
    assert s.shape == (*batch, 2)
    assert u.shape == (*batch, 2, 2)
    assert (s[..., 0] >= s[..., 1]).all()
    gram = np.einsum("...ik,...jk->...ij", u, u)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(2), gram.shape), rtol=0, atol=2e-15)
    JJt = np.einsum("...ik,...jk->...ij", J, J)
    again = np.einsum("...ki,...k,...kj->...ij", u, s**2, u)
    np.testing.assert_allclose(again, JJt, rtol=0, atol=1e-15 * np.abs(JJt).max() * 4)
    det = quality.determinant(RIGID, theta, assembly=assembly)
    np.testing.assert_array_equal(np.sign(det), mode[0] * mode[1] * assembly)
    np.testing.assert_allclose(det, np.linalg.det(J), rtol=1e-12)
    np.testing.assert_allclose(s.prod(axis=-1), np.abs(det), rtol=1e-14)
    np.testing.assert_array_equal(
        quality.manipulability(RIGID, theta, assembly=assembly), np.abs(det)
    )
    np.testing.assert_array_equal(
        quality.condition(RIGID, theta, assembly=assembly), s[..., 0] / s[..., 1]
    )


@pytest.mark.parametrize("batch", BATCHES)
def test_power_makes_the_two_ellipses_reciprocal(batch: tuple[int, ...]) -> None:
    """Along each axis: speed per motor rate times force per torque is 1."""
    theta = sample(RIGID, batch)[1]
    v = quality.velocity_ellipse(RIGID, theta)
    f = quality.force_ellipse(RIGID, theta)
    np.testing.assert_array_equal(v.directions, f.directions)
    np.testing.assert_allclose(v.semi_axes * f.semi_axes, 1.0, rtol=1e-15)


def test_unit_circles_map_onto_the_ellipses() -> None:
    circle = unit(np.linspace(0.0, 2.0 * np.pi, 721))
    theta = sample(RIGID, (20,))[1]
    J = kinematics.jacobian(RIGID, theta)
    v = quality.velocity_ellipse(RIGID, theta)
    f = quality.force_ellipse(RIGID, theta)
    images = (
        (v, np.einsum("nij,kj->nki", J, circle)),
        (
            f,
            np.einsum("nji,kj->nki", np.linalg.inv(J), circle),
        ),
    )
    for ellipse, image in images:
        along = np.einsum("nai,nki->nka", ellipse.directions, image)
        np.testing.assert_allclose(
            np.sum((along / ellipse.semi_axes[:, None, :]) ** 2, axis=-1), 1.0, rtol=1e-12
        )
        # half a degree of circle: the farthest point is short of the axis by 1e-5 at most
        reach = lengths(image).max(axis=1)
        np.testing.assert_allclose(reach, ellipse.semi_axes.max(axis=-1), rtol=1e-5)


def test_transmission_angles_make_up_the_determinant(rng: np.random.Generator) -> None:
    for _ in range(100):
        leg = random_leg(rng)
        theta = rng.uniform(-np.pi, np.pi, (40, 2))
        B, D = kinematics.knees(leg, theta)
        d = lengths(D - B)
        theta = theta[(d > 1.01 * abs(leg.L2 - leg.L3)) & (d < 0.99 * (leg.L2 + leg.L3))]
        mu = quality.transmission_angles(leg, theta, assembly=1)
        rho = np.hypot(*leg.foot_offset)
        sines = np.sin(mu.B) * np.sin(mu.D) / np.sin(mu.C)
        det = quality.manipulability(leg, theta, assembly=1)
        np.testing.assert_allclose(
            det, leg.L1 * leg.L4 * rho / leg.L2 * sines, rtol=1e-10, atol=1e-16
        )
        sines = [np.sin(mu.B), np.sin(mu.D), np.sin(mu.C)]
        shorter = [min(leg.L1, rho), min(leg.L4, leg.L3), min(leg.L2, leg.L3)]
        expected = np.abs(distances(leg, theta, assembly=1))
        np.testing.assert_allclose(np.array(sines).T * shorter, expected.T, rtol=0, atol=1e-15)


def test_transmission_angles_are_those_of_the_triangles() -> None:
    """By the law of cosines, from the lengths of AF, EC and BD."""
    theta = sample(RIGID, (50,))[1]
    A, E = kinematics.bases(RIGID)
    p = kinematics.closed_points(RIGID, theta)
    mu = quality.transmission_angles(RIGID, theta)
    rho = float(np.hypot(*RIGID.foot_offset))
    triangles = (
        (mu.B, RIGID.L1, rho, p.F - A),
        (mu.C, RIGID.L2, RIGID.L3, p.D - p.B),
        (mu.D, RIGID.L4, RIGID.L3, p.C_right - E),
    )
    for angle, a, b, across in triangles:
        cosine = (a**2 + b**2 - lengths(across) ** 2) / (2.0 * a * b)
        np.testing.assert_allclose(np.cos(angle), cosine, rtol=0, atol=1e-14)


# slope


@pytest.mark.parametrize("assembly", [-1, 1])
@pytest.mark.parametrize("mode", MODES)
def test_determinant_is_that_of_the_slopes(mode: Mode, assembly: int) -> None:
    theta = sample(RIGID, (30,), mode, assembly)[1]
    h = 1e-6
    steps = [kinematics.forward(RIGID, theta + h * e, assembly) for e in (*np.eye(2), *-np.eye(2))]
    slopes = cross(steps[0] - steps[2], steps[1] - steps[3]) / (2.0 * h) ** 2
    det = quality.determinant(RIGID, theta, assembly=assembly)
    # rounding eps size / h is 1e-11 of J ~ 0.1; h^2 C''' is less
    np.testing.assert_allclose(slopes, det, rtol=0, atol=1e-9 * np.abs(det).max())


# oracle


def test_batch_is_a_plain_loop_to_the_last_bit() -> None:
    theta = sample(RIGID, (50,))[1]
    for function in (quality.velocity_ellipse, quality.force_ellipse, quality.transmission_angles):
        rows = [function(RIGID, row) for row in theta]
        for batch, loop in zip(function(RIGID, theta), zip(*rows, strict=True), strict=True):
            np.testing.assert_array_equal(batch, loop)
    for function in (quality.determinant, quality.manipulability, quality.condition):
        rows = [function(RIGID, row) for row in theta]
        np.testing.assert_array_equal(function(RIGID, theta), rows)


def test_near_the_flat_loop_the_small_axis_keeps_its_digits() -> None:
    """J's own rounding is 1e-8 of s_2 there; J^-1, link by link, has no large number in it."""
    leg = FiveBar(0.25, 0.5, 0.625, 0.375, 0.75)
    # -theta_E: |BD| falls from 1.33 m to 1.09 m
    far = 0.0
    near = 0.5 * np.pi
    for _ in range(60):
        middle = 0.5 * (far + near)
        B, D = kinematics.knees(leg, np.array([2.5, -middle]))
        far, near = (middle, near) if lengths(D - B) > 1.125 * (1.0 - 1e-14) else (far, middle)
    theta = np.array([2.5, -near])
    s = quality.velocity_ellipse(leg, theta).semi_axes
    assert s[0] > 1e6
    A, E = kinematics.bases(leg)
    p = kinematics.closed_points(leg, theta)
    BC = p.C_left - p.B
    DC = p.C_right - p.D
    inverse = np.stack([BC / cross(p.B - A, BC), DC / cross(p.D - E, DC)])
    largest = np.linalg.svd(inverse, compute_uv=False)[0]
    np.testing.assert_allclose(s[1], 1.0 / largest, rtol=1e-13)


# edge


def test_right_angled_pose_by_hand() -> None:
    """J = [[1/64, 1/64], [-3/56, 3/56]]: rows at right angles, so the axes are x and z."""
    theta = kinematics.inverse(RIGHT, (0.0, -0.04))
    root = math.sqrt(2.0)
    s, u = quality.velocity_ellipse(RIGHT, theta)
    np.testing.assert_allclose(s, (3.0 / 56.0 * root, root / 64.0), rtol=1e-14)
    np.testing.assert_allclose(np.abs(u), [(0.0, 1.0), (1.0, 0.0)], rtol=0, atol=1e-14)
    f = quality.force_ellipse(RIGHT, theta)
    np.testing.assert_allclose(f.semi_axes, (56.0 / 3.0 / root, 64.0 / root), rtol=1e-14)
    assert quality.determinant(RIGHT, theta) == pytest.approx(3.0 / 1792.0, rel=1e-13)
    assert quality.condition(RIGHT, theta) == pytest.approx(24.0 / 7.0, rel=1e-13)
    mu = quality.transmission_angles(RIGHT, theta)
    np.testing.assert_allclose((mu.B, mu.D), 0.5 * np.pi, rtol=1e-14)
    assert mu.C == pytest.approx(2.0 * math.asin(0.0384 / 0.04), rel=1e-14)
    assert [float(each) for each in mu.deviation] == pytest.approx(
        [0.0, abs(float(mu.C) - np.pi / 2.0), 0.0], abs=1e-14
    )


def test_stretched_side_has_an_infinite_force() -> None:
    theta, assembly = stretched_pose()
    s, u = quality.velocity_ellipse(STRETCHED, theta, assembly=assembly)
    assert s[1] == 0.0 < s[0]
    np.testing.assert_allclose(np.abs(u[1]), (0.0, 1.0), rtol=0, atol=1e-14)  # along A, B, C
    f = quality.force_ellipse(STRETCHED, theta, assembly=assembly)
    assert f.semi_axes.tolist() == [1.0 / s[0], math.inf]
    assert quality.condition(STRETCHED, theta, assembly=assembly) == math.inf
    assert quality.manipulability(STRETCHED, theta, assembly=assembly) < 1e-15
    mu = quality.transmission_angles(STRETCHED, theta, assembly=assembly)
    assert mu.B == pytest.approx(np.pi, abs=1e-14)
    assert mu.deviation.B == pytest.approx(np.pi / 2.0, abs=1e-14)


def test_folded_side_has_an_infinite_force() -> None:
    leg = FiveBar(0.25, 0.5, 0.75, 0.375, 0.5)
    theta = kinematics.inverse(leg, (-0.25, 0.25))  # |AF| = L2 - L1 to the last bit
    theta = np.array([-0.5 * np.pi, theta[1]])
    feet = np.array([kinematics.forward(leg, theta, s) for s in (-1, 1)])
    assembly = (-1, 1)[int(np.argmin(lengths(feet - (-0.25, 0.25))))]
    assert quality.condition(leg, theta, assembly=assembly) == math.inf
    assert quality.transmission_angles(leg, theta, assembly=assembly).B == pytest.approx(
        0.0, abs=1e-14
    )


def test_both_sides_stretched_has_no_velocity() -> None:
    """J is zero but for rounding: nothing moves the foot, and everything holds it."""
    leg = FiveBar(0.1, 0.2, 0.2, 0.1, 0.3)  # C at the apex of an equilateral triangle
    theta = np.array([-np.pi / 3.0, -2.0 * np.pi / 3.0])
    s = quality.velocity_ellipse(leg, theta, assembly=-1).semi_axes
    np.testing.assert_array_equal(s, 0.0)
    np.testing.assert_array_equal(quality.force_ellipse(leg, theta, assembly=-1).semi_axes, np.inf)
    assert quality.condition(leg, theta, assembly=-1) == math.inf


def test_flat_loop_has_transmission_angles_and_nothing_else() -> None:
    mu = quality.transmission_angles(LINE, IN_LINE)
    assert mu.C == pytest.approx(np.pi, abs=1e-15)
    np.testing.assert_allclose(mu.deviation.C, np.pi / 2.0)
    for function in (
        quality.determinant,
        quality.manipulability,
        quality.condition,
        quality.velocity_ellipse,
        quality.force_ellipse,
    ):
        with pytest.raises(SingularError, match="B, C and D are in line") as info:
            function(LINE, [(math.pi - 0.5, 0.5), IN_LINE])
        assert info.value.index == (1,)


def test_nothing_is_ever_nan(rng: np.random.Generator) -> None:
    theta = np.array([stretched_pose()[0], (0.3, 0.4), (-1.0, 2.0)])
    for function in (quality.condition, quality.determinant):
        assert not np.isnan(function(STRETCHED, theta, assembly=-1)).any()
    for function in (quality.velocity_ellipse, quality.force_ellipse):
        assert not any(np.isnan(each).any() for each in function(STRETCHED, theta, assembly=-1))


# refusal


def test_open_loops_and_wrong_arguments_are_refused() -> None:
    for function in (quality.condition, quality.velocity_ellipse, quality.transmission_angles):
        with pytest.raises(LoopOpenError):
            function(RIGHT, (math.pi, 0.0))
        with pytest.raises(LoopOpenError):
            function(RIGHT, (math.nan, 0.0))
        with pytest.raises(ArgumentError, match="assembly must be -1 or 1, got 2"):
            function(RIGHT, (-1.85, -1.28), assembly=2)
        with pytest.raises(ArgumentError, match="theta must have shape"):
            function(RIGHT, 1.0)
    coaxial = FiveBar(0.25, 0.25, 0.25, 0.25, 0.0)
    with pytest.raises(LoopOpenError, match="must be above 0"):
        quality.transmission_angles(coaxial, (0.5, 0.5))
