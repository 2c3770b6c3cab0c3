"""The leg in space: full circles of the hip, slopes, rotations, special points, refusals."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import pytest
from poses import BATCHES, LINE, RIGHT, RIGID, pose, random_leg, sample, sine

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import (
    ArgumentError,
    GeometryError,
    LoopOpenError,
    SingularError,
    UnreachableError,
)
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics import hip
from fivebar_sim.kinematics.hip import Hip, SideStep, Steering
from fivebar_sim.kinematics.planar import unit, wrap

EPS = float(np.finfo(float).eps)
OFFSETS = [(0.0, 0.0), (0.02, 0.0), (-0.02, 0.0), (0.013, 0.008), (-0.017, -0.011)]
DOWN = kinematics.inverse(RIGHT, (0.0, -0.04))
HIPS = [kind(RIGID, *offset) for kind in (SideStep, Steering) for offset in OFFSETS]


def in_plane(h: Hip, foot: Array) -> Array:
    """Return planar feet in the body frame, phi = 0."""
    x = foot[..., 0]
    z = foot[..., 1]
    if isinstance(h, SideStep):
        return np.stack([x, np.full_like(x, h.across), z + h.along], axis=-1)
    return np.stack([x + h.along, np.full_like(x, h.across), z], axis=-1)


def rotated(h: Hip, points: Array, phi: Array) -> Array:
    """Return points turned by SciPy's rotation about the hip's axis."""
    from scipy.spatial.transform import Rotation

    axis = np.array([1.0, 0.0, 0.0] if isinstance(h, SideStep) else [0.0, 0.0, 1.0])
    R = Rotation.from_rotvec(phi.reshape(-1, 1) * axis)
    return R.apply(points.reshape(-1, 3)).reshape(points.shape)


def stretched(h: Hip, foot: Array) -> Array:
    """Return u, the coordinate of planar feet that the hip swings round."""
    return foot[..., 1 if isinstance(h, SideStep) else 0] + h.along


def full_circle(*batch: int) -> Array:
    """Return hip angles all round, from pi itself down to above -pi."""
    return np.linspace(np.pi, -np.pi, math.prod(batch), endpoint=False).reshape(batch)


# law


def check_round_trip(h: Hip, theta: Array, u: Array, mode: Mode, signs: tuple[int, int]) -> None:
    """Go round the circle of each foot and back, and assert that the angles are the same."""
    assembly, side = signs
    theta3 = np.column_stack([full_circle(len(theta)), theta])
    foot = hip.forward(h, theta3, assembly=assembly)
    again = hip.inverse(h, foot, mode=mode, side=side)
    error = np.abs(wrap(again - theta3))
    assert ((-np.pi < again) & (again <= np.pi)).all()
    assert (error[:, 0] <= 8.0 * EPS * (1.0 + abs(h.across) / u)).all()
    assert (error[u > 0.05 * h.leg.size] <= 1e-12).all()
    drift = np.linalg.norm(hip.forward(h, again, assembly=assembly) - foot, axis=-1)
    assert (drift <= 1e-12 * h.leg.size).all()


@pytest.mark.parametrize("legs", [15, pytest.param(100, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", [SideStep, Steering])
def test_round_trips_over_full_circles(kind: type[SideStep] | type[Steering], legs: int) -> None:
    """Random legs, four modes, both assemblies, offsets of both signs, both sides of the axis.

    The foot comes back from everywhere on the circle; the hip angle to eps across / u, and all
    angles to 1e-12 away from u = 0.
    """
    rng = np.random.default_rng(3)
    seen = np.zeros((4, 2, 2), dtype=int)
    signs = (-1, 1)
    for k in range(legs):
        leg = random_leg(rng)
        h = kind(leg, *(rng.uniform(-0.03, 0.03, 2) * (k % 3 > 0)).tolist())
        planar = rng.uniform(-1.0, 1.0, (400, 2)) * leg.size
        every = kinematics.inverse_all(leg, planar)
        for j, mode in enumerate(MODES):
            found = np.isfinite(every[:, j, 0])
            F = planar[found]
            theta = every[found, j]
            p = pose(leg, F, theta)
            A, E = kinematics.bases(leg)
            BC = p.C_left - p.B
            DC = p.C_right - p.D
            good = np.min([sine(BC, DC), sine(p.B - A, F - p.B), sine(p.D - E, DC)], axis=0) > 0.05
            u = stretched(h, F)
            assembly = kinematics.branch(leg, p).assembly
            for a, s in np.ndindex(2, 2):
                this = good & (assembly == signs[a]) & (np.sign(u) == signs[s])
                check_round_trip(h, theta[this], np.abs(u[this]), mode, (signs[a], signs[s]))
                seen[j, a, s] += this.sum()
    assert seen.min() > 2 * legs


@pytest.mark.parametrize("h", HIPS)
@pytest.mark.parametrize("batch", BATCHES)
def test_both_sides_reach_the_same_point(h: Hip, batch: tuple[int, ...]) -> None:
    """The planar feet of the two hip solutions stretch to u and to -u."""
    foot = sample(RIGID, batch)[0]
    P = rotated(h, in_plane(h, foot), full_circle(*batch))
    planes = [hip.leg_plane(h, P, side) for side in (-1, 1)]
    below, above = (stretched(h, each.foot) for each in planes)
    np.testing.assert_allclose(below, -above, rtol=0, atol=1e-16)
    assert (below <= 0.0).all()
    for each in planes:
        assert each.phi.shape == batch
        back = rotated(h, in_plane(h, each.foot), each.phi)
        np.testing.assert_allclose(back, P, rtol=0, atol=1e-15)


@pytest.mark.parametrize("h", HIPS)
def test_hip_is_singular_where_the_foot_is_on_its_cylinder(h: Hip) -> None:
    foot, theta = sample(RIGID, (50,))
    theta3 = np.column_stack([full_circle(50), theta])
    u = stretched(h, foot) * (1.0 if isinstance(h, SideStep) else -1.0)
    det = u * np.linalg.det(kinematics.jacobian(RIGID, theta))
    np.testing.assert_allclose(np.linalg.det(hip.jacobian(h, theta3)), det, rtol=0, atol=1e-17)


# slope


@pytest.mark.parametrize("h", HIPS)
@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("assembly", [-1, 1])
def test_jacobian_is_the_slope_of_forward(h: Hip, batch: tuple[int, ...], assembly: int) -> None:
    theta = sample(RIGID, batch, (-1, 1), assembly)[1]
    step = 3e-6
    theta3 = np.concatenate([full_circle(*batch)[..., None], theta], axis=-1)
    slopes = [
        hip.forward(h, theta3 + step * e, assembly=assembly)
        - hip.forward(h, theta3 - step * e, assembly=assembly)
        for e in np.eye(3)
    ]
    J = hip.jacobian(h, theta3, assembly=assembly)
    assert J.shape == (*batch, 3, 3)
    # step^2 F'''/6 with F''' below 6000 |J| this far from singular; eps size / step is 1e-11
    expected = np.stack(slopes, axis=-1) / (2.0 * step)
    np.testing.assert_allclose(J, expected, rtol=0, atol=1e-8 * np.abs(J).max())


# oracle


@pytest.mark.parametrize("h", HIPS)
@pytest.mark.parametrize("batch", BATCHES)
def test_forward_is_a_rotation_of_the_planar_leg(h: Hip, batch: tuple[int, ...]) -> None:
    foot, theta = sample(RIGID, batch)
    phi = full_circle(*batch)
    theta3 = np.concatenate([phi[..., None], theta], axis=-1)
    expected = rotated(h, in_plane(h, foot), phi)
    np.testing.assert_allclose(hip.forward(h, theta3), expected, rtol=0, atol=1e-15)


def test_batch_is_a_plain_loop_to_the_last_bit() -> None:
    foot, theta = sample(RIGID, (24,))
    theta3 = np.column_stack([full_circle(24), theta])
    for h in HIPS:
        P = hip.forward(h, theta3)
        side = np.where(stretched(h, foot) < 0.0, -1, 1)
        loops = [
            (hip.forward(h, t), hip.jacobian(h, t), hip.inverse(h, p, side=s))
            for t, p, s in zip(theta3, P, side, strict=True)
        ]
        batch = P, hip.jacobian(h, theta3), hip.inverse(h, P, side=side)
        for whole, rows in zip(batch, zip(*loops, strict=True), strict=True):
            np.testing.assert_array_equal(whole, rows)


# edge


def test_poses_by_hand() -> None:
    """The foot 40 mm below O, the plane 30 mm off the axis: a 3-4-5 triangle, turned by 90 deg."""
    for h, phi, P in (
        (SideStep(RIGHT, 0.03), 0.0, (0.0, 0.03, -0.04)),
        (SideStep(RIGHT, 0.03), np.pi / 2.0, (0.0, 0.04, 0.03)),
        (SideStep(RIGHT, -0.03), np.pi, (0.0, 0.03, 0.04)),
        (SideStep(RIGHT, 0.03, -0.04), -np.pi / 2.0, (0.0, -0.08, -0.03)),
        (Steering(RIGHT, 0.03, 0.05), np.pi / 2.0, (-0.03, 0.05, -0.04)),
        (Steering(RIGHT, -0.03, 0.05), np.pi, (-0.05, 0.03, -0.04)),
    ):
        theta3 = [phi, *DOWN]
        np.testing.assert_allclose(hip.forward(h, theta3), P, rtol=0, atol=1e-16)
        np.testing.assert_allclose(hip.inverse(h, P), theta3, rtol=0, atol=1e-14)


def test_third_angle_knows_its_quadrant() -> None:
    """The foot below the axis to either side, where z / y differs by its sign only."""
    P = [(0.0, 0.04, -0.04), (0.0, -0.04, -0.04)]
    phi = hip.leg_plane(SideStep(RIGHT), P).phi
    np.testing.assert_allclose(phi, [np.pi / 4.0, -np.pi / 4.0], rtol=1e-15)


@pytest.mark.parametrize("zero", [0.0, -0.0])
@pytest.mark.parametrize("side", [-1, 1])
def test_foot_on_the_axis_has_hip_angle_zero(zero: float, side: int) -> None:
    hips = SideStep(RIGHT, along=0.04), Steering(RIGHT)
    for h, P in zip(hips, ((0.0, zero, -zero), (zero, zero, -0.04)), strict=True):
        np.testing.assert_array_equal(hip.inverse(h, P, side=side), [0.0, *DOWN])


@pytest.mark.parametrize("across", [-0.05, 0.05])
def test_foot_on_the_cylinder_has_one_solution(across: float) -> None:
    """There u = 0 and the leg plane touches the cylinder, also from a rounding inside it."""
    for r in (0.05, np.nextafter(0.05, 0.0), np.nextafter(0.05, 1.0)):
        for angle in np.linspace(-3.0, 3.0, 7):
            y, z = r * unit(angle)
            h = SideStep(RIGHT, across, 0.04)
            one, other = (hip.inverse(h, (0.0, y, z), side=side) for side in (-1, 1))
            # u = sqrt(r^2 - across^2) with a rounding in r, and phi off by u / r
            np.testing.assert_allclose(wrap(one - other), 0.0, atol=4.0 * math.sqrt(EPS))
            across_at = math.copysign(1.0, across) * unit(one[0])
            np.testing.assert_allclose(across_at, unit(angle), atol=2.0 * math.sqrt(EPS))


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_half_a_turn_is_plus_pi(zero: float) -> None:
    above = (0.0, zero, 0.04)
    rounded = (0.0, -1e-20, 0.04)
    np.testing.assert_array_equal(hip.leg_plane(SideStep(RIGHT), [above, rounded]).phi, np.pi)
    assert hip.inverse(Steering(RIGHT, along=0.05), (-0.05, zero, -0.04))[0] == np.pi
    coaxial = SideStep(FiveBar(0.25, 0.5, 0.5, 0.25, 0.0))  # stretched to the back
    np.testing.assert_array_equal(hip.inverse(coaxial, (-0.75, 0.0, -1e-20)), [0.0, np.pi, np.pi])


def test_side_may_differ_from_point_to_point() -> None:
    """A leg that steps through under its steering axis stays ahead: phi is 0 all along."""
    P = np.stack([x := np.linspace(-0.02, 0.02, 8), np.zeros(8), np.full(8, -0.04)], axis=-1)
    theta3 = hip.inverse(Steering(RIGHT), P, side=np.where(x < 0.0, -1, 1))
    np.testing.assert_array_equal(theta3[:, 0], np.zeros(8))
    np.testing.assert_array_equal(theta3[:, 1:], kinematics.inverse(RIGHT, P[:, ::2]))
    np.testing.assert_array_equal(hip.inverse(Steering(RIGHT, side=-1), P[:4]), theta3[:4])


# refusal


@pytest.mark.parametrize(
    ("P", "message"),
    [
        ((0.0, 0.02, 0.02), r"at least 0.03 m from the hip's axis, got 0.0282843 m"),
        ((0.0, 0.0, 0.0), "got 0 m"),
        ((0.001, 0.003, 0.004), r"got 0.005 m for the foot at \(0.001, 0.003, 0.004\) m"),
        ((0.0, math.nan, -0.04), "must be finite"),
        ((math.inf, 0.03, -0.04), "must be finite"),
        ((0.0, 0.03, -0.2), r"in the leg plane .*\|AF\| must be in"),
        ((1e200, 1.7e308, 1.7e308), r"in the leg plane .*\|AF\| must be in"),
    ],
)
def test_out_of_reach(P: tuple[float, float, float], message: str) -> None:
    h = SideStep(RIGHT, -0.03)
    good = (0.0, -0.03, -0.04)
    with pytest.raises(UnreachableError, match=message):
        hip.inverse(h, P)
    batch = np.array([[good, good], [good, P], [(0.0, 0.0, 0.0), (0.0, 0.0, -9.0)]])
    with pytest.raises(UnreachableError, match=r"of 6 points are .*at index \(1, 1\)") as many:
        hip.inverse(h, batch)
    assert many.value.index == (1, 1)


def test_leg_plane_refuses_the_cylinder_only() -> None:
    h = Steering(RIGHT, 0.03)
    assert hip.leg_plane(h, (9.0, 0.0, 9.0)).foot[1] == 9.0
    with pytest.raises(UnreachableError, match="2 of 3 points are out of the hip's reach") as error:
        hip.leg_plane(h, [(9.0, 0.0, 9.0), (0.02, 0.0, 9.0), (math.nan, 1.0, 1.0)])
    assert error.value.index == (1,)


def test_open_and_singular_poses_are_named() -> None:
    with pytest.raises(SingularError) as singular:
        hip.jacobian(SideStep(LINE), [[(0.3, -2.0, -1.0)], [(0.3, math.pi, 0.0)]])
    assert singular.value.index == (1, 0)
    with pytest.raises(LoopOpenError) as is_open:
        hip.forward(Steering(RIGHT), [(0.3, *DOWN), (0.3, math.pi, 0.0)])
    assert is_open.value.index == (1,)


@pytest.mark.parametrize("bad", [np.zeros(2), 1.0, [0.0, "x", 0.0]])
def test_wrong_shapes_are_refused(bad: Any) -> None:
    for function in (hip.forward, hip.jacobian, hip.inverse, hip.leg_plane):
        with pytest.raises(ArgumentError, match=r"shape \(\.\.\., 3\)"):
            function(SideStep(RIGHT), bad)


def test_wrong_arguments_are_refused() -> None:
    h = SideStep(RIGHT)
    P = (0.0, 0.0, -0.04)
    for side in (0, 2, math.nan, "left", [1, -1]):
        with pytest.raises(ArgumentError, match="side must be -1 or 1"):
            hip.inverse(h, P, side=cast(Any, side))
    with pytest.raises(ArgumentError, match="mode must be one of"):
        hip.inverse(h, P, mode=(1, 2))
    for bad in (math.nan, math.inf):
        for function in (hip.forward, hip.jacobian):
            with pytest.raises(ArgumentError, match="theta3 must be finite"):
                function(h, (bad, -2.0, -1.0))


@pytest.mark.parametrize("kind", [SideStep, Steering])
@pytest.mark.parametrize("bad", [math.nan, math.inf, "0.1", True])
def test_impossible_hips_are_refused(kind: type[SideStep] | type[Steering], bad: Any) -> None:
    for key in ("across", "along"):
        with pytest.raises(GeometryError, match=f"{key} must be in"):
            kind(RIGHT, **{key: bad})
    with pytest.raises(GeometryError, match="side must be -1 or 1"):
        kind(RIGHT, side=0)
