"""Positions and angles: laws over random legs, a plain loop, special poses, refusals."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from poses import BATCHES, RIGHT, RIGID, length, pose, random_leg, sample, sine

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, LoopOpenError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.planar import turned, unit, wrap

EPS = float(np.finfo(float).eps)
BENCH = Path(__file__).parents[1] / "scripts" / "bench_kinematics.py"


# law


@pytest.mark.parametrize("legs", [100, pytest.param(500, marks=pytest.mark.long)])
def test_forward_of_inverse_is_identity(legs: int) -> None:
    """400 points of each leg, four modes, both assemblies.

    Crossing circles place C to rounding / sin(angle at C), down to sqrt(rounding).
    """
    rng = np.random.default_rng(2)
    seen = np.zeros((4, 2), dtype=int)
    for _ in range(legs):
        leg = random_leg(rng)
        foot = rng.uniform(-1.0, 1.0, (400, 2)) * leg.size
        every = kinematics.inverse_all(leg, foot)
        for k, mode in enumerate(MODES):
            ok = np.isfinite(every[:, k, 0])
            p = foot[ok]
            theta = kinematics.inverse(leg, foot[ok], mode)
            np.testing.assert_array_equal(theta, every[ok, k])
            assert ((-np.pi < theta) & (theta <= np.pi)).all()
            points = pose(leg, p, theta)
            found = kinematics.branch(leg, points)
            s = sine(points.C_left - points.B, points.C_right - points.D)
            assert (found.s_A == mode[0]).all()
            assert (found.s_E == mode[1]).all()
            for column, assembly in enumerate((-1, 1)):
                this = found.assembly == assembly
                error = length(kinematics.forward(leg, theta[this], assembly) - p[this]) / leg.size
                assert (error <= 16 * EPS / np.maximum(s[this], np.sqrt(EPS))).all()
                assert (error[s[this] > math.sin(math.radians(3.0))] <= 1e-12).all()
                seen[k, column] += this.sum()
    assert seen.min() > 2 * legs
    assert seen.sum() > 200 * legs


def in_line(leg: FiveBar, B: Array, outer: bool) -> tuple[Array, Array, float] | None:
    """Return C, D and |BD| with B, C, D in line: C between B and D (outer) or beyond one."""
    E = kinematics.bases(leg)[1]
    L2 = leg.L2
    L3 = leg.L3
    d = L2 + L3 if outer else abs(L2 - L3)
    e = float(length(E - B))
    cosine = (e * e + d * d - leg.L4**2) / (2.0 * d * e)
    if abs(cosine) > 1.0:
        return None
    u = turned((E - B) / e, math.acos(cosine))  # along BD, so that |ED| = L4
    return B + (L2 if outer or L2 > L3 else -L2) * u, B + d * u, d


def test_forward_of_inverse_with_B_C_D_in_line() -> None:
    """There h of `loop_joint` is the root of rounding: size sqrt(eps size / |BD|)."""
    rng = np.random.default_rng(4)
    seen = 0
    for k in range(1000):
        leg = random_leg(rng)
        B = kinematics.bases(leg)[0] + leg.L1 * unit(rng.uniform(-3.0, 3.0))
        found = in_line(leg, B, outer=k % 2 == 0)
        if found is None or leg.L6 > 0.0 or leg.L1 + leg.L4 + leg.L5 > 3.0 * (leg.L2 + leg.L3):
            continue
        C, D, d = found
        every = kinematics.inverse_all(leg, C)
        gap = [length(np.stack(kinematics.knees(leg, row)) - [B, D]).sum() for row in every]
        theta = every[int(np.nanargmin(gap))]
        error = length(kinematics.forward(leg, theta) - C) / leg.size
        assert error <= 16 * np.sqrt(EPS * leg.size / d)
        seen += 1
    assert seen > 100


def test_forward_of_inverse_in_line_with_short_outer_links() -> None:
    leg = FiveBar(0.096, 0.005, 0.007, 0.078, 0.052)
    for angle in np.linspace(0.3, 1.2, 500):
        found = in_line(leg, kinematics.bases(leg)[0] + leg.L1 * unit(angle), outer=True)
        for theta in kinematics.inverse_all(leg, found[0]) if found else ():
            if length(np.subtract(*kinematics.knees(leg, theta))) > leg.L2 + leg.L3 - 1e-9:
                kinematics.forward(leg, theta)


link = st.floats(0.02, 0.1)
turn = st.floats(-math.pi, math.pi)


@given(
    st.tuples(link, link, link, link, st.floats(0.0, 0.1), st.floats(0.0, 0.05), turn, turn),
    st.tuples(st.floats(0.0, 1.0), turn),
    st.sampled_from(MODES),
)
def test_round_trip(numbers: tuple[float, ...], foot: tuple[float, float], mode: Mode) -> None:
    assume(2.0 * max(numbers[:5]) < sum(numbers[:5]))
    assume(abs(numbers[1] + numbers[5] * np.exp(1j * numbers[6])) > 1e-3)  # F apart from B
    leg = FiveBar(
        **dict(zip(("L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt"), numbers, strict=True))
    )
    near = leg.L1
    far = math.hypot(*leg.foot_offset)
    r = abs(near - far) + foot[0] * 2.0 * min(near, far)
    p = kinematics.bases(leg)[0] + r * unit(foot[1])
    theta = kinematics.inverse_all(leg, p)[MODES.index(mode)]
    assume(np.isfinite(theta).all())
    points = pose(leg, p, theta)
    assume(sine(points.C_left - points.B, points.C_right - points.D) > 0.05)
    assembly = int(kinematics.branch(leg, points).assembly)
    assert length(kinematics.forward(leg, theta, assembly) - p) <= 1e-12 * leg.size


@pytest.mark.parametrize("batch", BATCHES)
def test_passive_angles_close_the_loop(batch: tuple[int, ...]) -> None:
    foot, theta = sample(RIGID, batch)
    knees = kinematics.passive(RIGID, theta)
    q = np.stack([theta[..., 0], knees[..., 0], theta[..., 1], knees[..., 1]], axis=-1)
    p = kinematics.chain_points(RIGID, q)
    for end, goal in ((p.C_left, p.C_right), (p.F, foot), (p.F, kinematics.forward(RIGID, theta))):
        np.testing.assert_allclose(end, goal, rtol=0, atol=1e-15)  # some roundings of 0.1 m
        assert end.shape == (*batch, 2)


def test_inverse_nearest_is_the_nearest_of_all_solutions_in_all_turns() -> None:
    foot = sample(RIGID, (200,))[0]
    now = np.random.default_rng(6).uniform(-20.0, 20.0, (200, 2))
    near = kinematics.inverse_nearest(RIGID, foot, now)
    every = kinematics.inverse_all(RIGID, foot)
    n = 2.0 * np.pi * np.arange(-4, 5)
    turns = np.stack(np.meshgrid(n, n), axis=-1).reshape(-1, 1, 1, 2)
    cost = np.sum((every + turns - now[:, None, :]) ** 2, axis=-1)
    np.testing.assert_allclose(np.sum((near - now) ** 2, axis=-1), np.nanmin(cost, axis=(0, 2)))
    assert (np.nanmin(np.abs(wrap(near[:, None, :] - every)).max(-1), axis=-1) < 1e-13).all()


def test_inverse_nearest_is_continuous_along_a_path_through_half_a_turn() -> None:
    leg = FiveBar(0.03, 0.05, 0.055, 0.035, 0.0)  # coaxial: the foot can circle the motors
    path = 0.05 * unit(np.linspace(0.0, 4.0 * np.pi, 800))
    now = kinematics.inverse(leg, path[0]) + 2.0 * np.pi
    angles = []
    for foot in path:
        now = kinematics.inverse_nearest(leg, foot, now)
        angles.append(now)
    assert np.abs(np.diff(angles, axis=0)).max() < 0.02  # 4 pi / 799 = 0.016
    np.testing.assert_allclose(angles[-1] - angles[0], 4.0 * np.pi, rtol=1e-12)


# oracle


def test_batch_is_a_plain_loop_to_the_last_bit() -> None:
    foot = np.tile(sample(RIGID, (100,))[0], (60, 1))  # more than one block
    for f in (kinematics.inverse, kinematics.inverse_all):
        rows = np.stack([f(RIGID, row) for row in foot[:100]])
        np.testing.assert_array_equal(f(RIGID, foot), np.concatenate([rows] * 60))


def test_array_is_the_loop_that_the_benchmark_times() -> None:
    bench = runpy.run_path(str(BENCH))
    leg = FiveBar()
    points = bench["random_points"](leg, 20_000)
    theta = np.array(bench["inverse_loop"](leg, points.tolist()))
    np.testing.assert_allclose(kinematics.inverse(leg, points), theta, rtol=0, atol=1e-13)


# edge


def test_right_angled_pose_by_hand() -> None:
    """|AF| = 50 mm: 3-4-5 triangles; A and E 60 mm apart, F 40 mm below their middle."""
    a = math.atan2(4.0, 3.0)
    corner = math.pi / 2
    every = kinematics.inverse_all(RIGHT, (0.0, -0.04))
    # s = -1 and +1 of each; pi, not -pi
    A = (-2.0 * a, 0.0)
    E = (math.pi, 2.0 * a - math.pi)
    np.testing.assert_allclose(every, [[x, z] for x in A for z in E], rtol=0, atol=1e-15)
    assert every[0, 1] == every[2, 1] == math.pi
    p = kinematics.closed_points(RIGHT, every[1], assembly=-1)
    np.testing.assert_allclose(p.B, (-0.0384, -0.0288), rtol=1e-14)
    np.testing.assert_allclose(p.F, (0.0, -0.04), rtol=0, atol=1e-16)
    np.testing.assert_allclose(
        kinematics.passive(RIGHT, every[1], assembly=-1), (corner, -corner), rtol=1e-14
    )
    assert kinematics.branch(RIGHT, p) == (-1, 1, -1)
    with pytest.raises(LoopOpenError, match=r"\|BD\| must be above 0"):  # knees inwards: B on D
        kinematics.forward(RIGHT, every[2])


def test_upright_drawing_is_the_hanging_leg_mirrored() -> None:
    foot, theta = sample(RIGHT, (50,))
    up = kinematics.inverse(RIGHT, foot * [1.0, -1.0], mode=(1, -1))
    np.testing.assert_array_equal(up, -theta)
    np.testing.assert_array_equal(
        kinematics.forward(RIGHT, up, 1), kinematics.forward(RIGHT, theta, -1) * [1, -1]
    )


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_stretched_and_folded_sides_point_at_the_foot_and_never_at_minus_pi(zero: float) -> None:
    leg = FiveBar(0.25, 0.5, 0.5, 0.5, 0.25)
    for x_F, theta_A in ((-0.875, math.pi), (0.625, 0.0), (0.125, math.pi), (-0.375, 0.0)):
        theta = kinematics.inverse_all(leg, (x_F, zero))  # stretched twice; folded twice
        np.testing.assert_allclose(theta[:, 0], theta_A, rtol=0, atol=1e-15)
        assert (theta > -math.pi).all()
    coaxial = FiveBar(0.25, 0.5, 0.625, 0.25, 0.0)
    np.testing.assert_array_equal(kinematics.inverse_all(coaxial, (-0.75, zero))[:, 0], math.pi)


def test_foot_on_A_of_equal_links_has_theta_A_zero() -> None:
    leg = FiveBar(0.05, 0.05, 0.04, 0.04, 0.03)
    A = kinematics.bases(leg)[0]
    theta = kinematics.inverse(leg, A)
    assert theta[0] == 0.0
    both = [kinematics.forward(leg, theta, assembly) for assembly in (-1, 1)]
    assert np.abs(np.subtract(both, A)).max(axis=-1).min() < 1e-16


def test_axes_that_are_kept_cannot_be_written_to() -> None:
    for axis in kinematics.bases(RIGID):
        with pytest.raises(ValueError, match="read-only"):
            axis += 1.0


def test_nearest_solution_over_the_half_turn_and_the_tie() -> None:
    near = kinematics.inverse_nearest(RIGHT, (0.0, -0.04), (0.1, -math.pi + 0.1))
    np.testing.assert_allclose(near, (0.0, -math.pi), rtol=0, atol=1e-15)  # not +pi: 0.1 away


def test_minus_pi_is_never_returned() -> None:
    leg = FiveBar(0.25, 0.5, 0.5, 0.25, 0.0)
    for z in (0.0, -0.0, -1e-20, -1e-300):
        for theta in kinematics.inverse_all(leg, (-0.75, z)):
            np.testing.assert_array_equal(theta, [np.pi, np.pi])
    folded = FiveBar(0.05, 0.05, 0.05, 0.05, 0.0)
    for zeros in ((0.0, 0.0), (-0.0, 0.0), (0.0, -0.0), (-0.0, -0.0)):
        np.testing.assert_array_equal(kinematics.inverse(folded, zeros), [0.0, 0.0])


# refusal


def test_unreachable_and_open_name_the_first_index() -> None:
    foot = np.full((2, 3, 2), [0.0, -0.04])
    foot[1, 0] = (0.0, -0.5)
    foot[1, 2] = (np.nan, 0.0)
    with pytest.raises(
        UnreachableError, match=r"^2 of 6 points are out of reach: \|AF\| must be in"
    ) as info:
        kinematics.inverse(RIGHT, foot)
    assert info.value.index == (1, 0)
    with pytest.raises(
        UnreachableError, match=r"\|EF\|.* got 0\.08 m for the foot at \(-0\.05, 0\) m$"
    ):
        kinematics.inverse(RIGHT, (-0.05, 0.0))
    with pytest.raises(UnreachableError) as info:
        kinematics.inverse_nearest(RIGHT, foot, (0.0, 0.0))
    assert info.value.index == (1, 0)
    theta = np.full((2, 2, 2), [-1.85, -1.28])
    theta[0, 1] = (math.pi, 0.0)
    theta[1, 1] = (np.nan, 0.0)
    for f in (kinematics.forward, kinematics.passive, kinematics.jacobian):
        with pytest.raises(
            LoopOpenError, match=r"open in 2 of 4 poses.* got 0\.12 m at index"
        ) as opened:
            f(RIGHT, theta)
        assert opened.value.index == (0, 1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_points_that_are_not_finite_are_out_of_reach(bad: float) -> None:
    with pytest.raises(UnreachableError, match=r"the point is out of reach: \|AF\|") as info:
        kinematics.inverse(RIGHT, (0.0, bad))
    assert info.value.index == ()
    assert np.isnan(kinematics.inverse_all(RIGHT, (0.0, bad))).all()


def test_arguments_are_refused() -> None:
    foot = (0.0, -0.04)
    theta = (-1.85, -1.28)
    for mode in ((0, 1), (1,), "hanging"):
        with pytest.raises(ArgumentError, match=r"mode must be one of \(\(-1, -1\).*got"):
            kinematics.inverse(RIGHT, foot, mode)  # pyright: ignore[reportArgumentType]
    for f in (kinematics.forward, kinematics.passive, kinematics.closed_points):
        with pytest.raises(ArgumentError, match="assembly must be -1 or 1, got 0"):
            f(RIGHT, theta, assembly=0)
    for f in (kinematics.inverse, kinematics.inverse_all, kinematics.forward, kinematics.passive):
        for x in (1.0, (0.0, 0.0, 0.0), [[1.0], [2.0]], "ab", None, [[1.0, 2.0], [3.0]]):
            with pytest.raises(ArgumentError, match=r"(foot|theta) must .*\(\.\.\., 2\)"):
                f(RIGHT, x)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ArgumentError, match=r"must broadcast, got shapes \(2, 2\) and \(3, 2\)"):
        kinematics.inverse_nearest(RIGHT, [foot] * 2, [theta] * 3)
    with pytest.raises(ArgumentError, match="theta_now must be finite"):
        kinematics.inverse_nearest(RIGHT, foot, (np.nan, 0.0))
    leg = FiveBar.load("extended")  # its own mode does not reach the first point, another does
    with pytest.raises(UnreachableError, match="1 of 2 points") as info:
        kinematics.inverse_nearest(leg, [(0.0, -0.12), (0.5, 0.0)], (0.0, 0.0))
    assert info.value.index == (1,)
