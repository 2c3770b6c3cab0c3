"""The rest pose, the stops at C, and vectors: what each is defined by, computed another way."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from poses import RIGHT, RIGID, length, pose, sample, sine

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import (
    ArgumentError,
    GeometryError,
    LoopOpenError,
    SingularError,
    UnreachableError,
)
from fivebar_sim.files import resources
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics import planar, stops
from fivebar_sim.kinematics.reach import points_at

PRESETS = [FiveBar.load(name) for name in resources.shipped("models/legs")]
CLASSIC = FiveBar.load("classic")
LEGS = [
    *PRESETS,
    RIGID,
    *(replace(CLASSIC, mode=mode, assembly=assembly) for mode in MODES for assembly in (-1, 1)),
]
SIDEWAYS = FiveBar(0.02, 0.05, 0.05, 0.02, 0.08, tilt=math.pi / 2)  # never on its branch at x = 0


def least_sine(leg: FiveBar, foot: Array) -> Array:
    """Return the least sine at B, D and C of poses on the leg's branch, 0 off it."""
    theta = kinematics.inverse_all(leg, foot)[:, MODES.index(leg.mode)]
    p = pose(leg, foot, theta)
    A, E = kinematics.bases(leg)
    DC = p.C_right - p.D
    with np.errstate(invalid="ignore"):
        at = [sine(p.B - A, foot - p.B), sine(p.D - E, DC), sine(p.C_left - p.B, DC)]
        side = planar.cross(p.D - p.B, p.C_left - p.B) * leg.assembly > 0.0
    return np.where(side, np.nan_to_num(np.min(at, axis=0)), 0.0)


# law


@pytest.mark.parametrize("leg", LEGS, ids=lambda leg: f"{leg.name}{leg.mode}{leg.assembly}")
def test_home_is_the_best_pose_straight_below_or_above_the_hip(leg: FiveBar) -> None:
    q = kinematics.home(leg)
    p = kinematics.chain_points(leg, q)
    assert length(p.C_left - p.C_right) < 1e-15
    assert kinematics.branch(leg, p) == (*leg.mode, leg.assembly)
    assert abs(p.F[0]) < 1e-15
    assert ((-math.pi < q) & (q <= math.pi)).all()
    step = (leg.size + leg.L5) / 60.0
    z: Array = step * np.arange(-60.0, 61.0)
    np.testing.assert_allclose(np.abs(z - p.F[1]).min(), 0.0, atol=1e-15)  # one of those tried
    best = least_sine(leg, np.stack([np.zeros_like(z), z], axis=-1))
    assert least_sine(leg, p.F[None])[0] == pytest.approx(best.max(), abs=2e-9)
    assert best.max() > 0.25
    assert p.F[1] < z[best > best.max() - 1e-10].min() + 0.5 * step  # the lowest of equals


def test_home_of_a_leg_that_is_never_there_is_the_best_of_the_plane() -> None:
    q = kinematics.home(SIDEWAYS)
    F = kinematics.chain_points(SIDEWAYS, q).F
    line: Array = (SIDEWAYS.size + SIDEWAYS.L5) / 60.0 * np.arange(-60.0, 61.0)
    assert least_sine(SIDEWAYS, np.stack([np.zeros_like(line), line], axis=-1)).max() == 0.0
    plane = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    assert least_sine(SIDEWAYS, F[None])[0] == pytest.approx(
        least_sine(SIDEWAYS, plane).max(), abs=2e-9
    )


@pytest.mark.parametrize("leg", LEGS, ids=lambda leg: f"{leg.name}{leg.mode}{leg.assembly}")
def test_hanging_is_the_best_pose_below_the_hip_in_the_turns_of_home(leg: FiveBar) -> None:
    rest = kinematics.home(leg)
    line = (leg.size + leg.L5) / 60.0 * np.arange(-60.0, 61.0)
    plane = np.stack(np.meshgrid(line, line[:60]), axis=-1)
    # Straight below the hip, or anywhere below it if it is never there.
    below = least_sine(leg, plane[:, 60]).max() or least_sine(leg, plane.reshape(-1, 2)).max()
    q = kinematics.hanging(leg)
    if kinematics.chain_points(leg, rest).F[1] < 0.0 or below == 0.0:
        np.testing.assert_array_equal(q, rest)
        return

    p = kinematics.chain_points(leg, q)
    assert p.F[1] < 0.0
    assert kinematics.branch(leg, p) == (*leg.mode, leg.assembly)
    assert least_sine(leg, p.F[None])[0] == pytest.approx(below, abs=2e-9)
    for (low, high), angle in (
        (stops.stops_at_B(leg, rest), q[1]),
        (stops.stops_at_C(rest), stops.angle_at_C(q)),
    ):
        assert low < angle < high
    q[:] = 0.0
    assert kinematics.hanging(leg).any()  # nobody writes into another's pose


@pytest.mark.parametrize("leg", [CLASSIC, RIGID], ids=["classic", "rigid"])
def test_stops_at_B_are_where_the_foot_is_folded_back_over_the_motor(leg: FiveBar) -> None:
    """About every rest pose, in all turns: BF then points from B to A."""
    for theta_B in np.linspace(-9.0, 9.0, 37):
        low, high = stops.stops_at_B(leg, np.array([0.3, theta_B, 0.0, 0.0]))
        assert low <= theta_B <= high
        assert high - low == pytest.approx(math.tau, abs=1e-14)
        p = kinematics.chain_points(leg, np.array([0.3, high, 0.0, 0.0]))
        BA = kinematics.bases(leg)[0] - p.B
        np.testing.assert_allclose((p.F - p.B) / length(p.F - p.B), BA / leg.L1, rtol=0, atol=1e-14)


def test_points_of_a_known_foot_are_those_of_its_joints() -> None:
    foot, theta = sample(RIGID, (20,))
    for found, point in zip(points_at(RIGID, foot, theta), pose(RIGID, foot, theta), strict=True):
        np.testing.assert_allclose(found, point, rtol=0, atol=1e-15)


def test_stops_hold_the_angle_at_C_between_two_poses_in_line() -> None:
    seen = set()
    for leg in LEGS:
        q = kinematics.home(leg)
        for turns in (-2, 0, 1):  # of a motor: the angle at C goes with it
            rest = q + 2.0 * math.pi * turns * np.array([1.0, 0.0, 0.0, 0.0])
            angle = float(stops.angle_at_C(rest))
            low, high = stops.stops_at_C(rest)
            assert low < angle < high
            assert high - low == pytest.approx(math.pi - 2.0 * math.radians(2.0), abs=1e-14)
            assert math.sin(low - stops.C_STOP) == pytest.approx(0.0, abs=1e-14)
            seen.add(round((low - stops.C_STOP) / math.pi))
    assert len(seen) > 4
    assert stops.stops_at_C(np.array([1.0, 0.5, -0.5, 0.25])) == (
        math.radians(2.0),
        math.pi - math.radians(2.0),
    )
    assert math.tau == stops.MOTOR_RANGE


def test_angle_at_C_turns_L3_into_L2() -> None:
    theta = sample(RIGID, (50,))[1]
    knees = kinematics.passive(RIGID, theta)
    q = np.stack([theta[:, 0], knees[:, 0], theta[:, 1], knees[:, 1]], axis=-1)
    p = kinematics.closed_points(RIGID, theta)
    DC, BC = ((p.C_left - end) @ [1.0, 1j] for end in (p.D, p.B))
    np.testing.assert_allclose(
        np.exp(1j * stops.angle_at_C(q)), (BC / RIGID.L2) / (DC / RIGID.L3), rtol=1e-12
    )


def test_open_chains_of_a_closed_pose_are_the_closed_pose() -> None:
    """Every joint, one by one, and by turning complex numbers."""
    theta = sample(RIGID, (50,))[1]
    q = np.insert(theta, (1, 2), kinematics.passive(RIGID, theta), axis=-1)
    chains = kinematics.chain_points(RIGID, q)
    closed = kinematics.closed_points(RIGID, theta)
    for one, two in zip(chains, closed, strict=True):
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-15)
    E = 0.5 * RIGID.L5 * np.exp(1j * RIGID.tilt)
    B = -E + RIGID.L1 * np.exp(1j * theta[:, 0])
    D = E + RIGID.L4 * np.exp(1j * theta[:, 1])
    for ours, truth in ((chains.B, B), (chains.D, D)):
        np.testing.assert_allclose(ours @ [1.0, 1j], truth, rtol=0, atol=1e-16)


# refusal


def test_leg_that_is_never_on_its_branch_has_no_home() -> None:
    leg = FiveBar(0.04, 0.05, 0.05, 0.04, 0.0, assembly=1)  # coaxial: C is always below B and D
    with pytest.raises(GeometryError, match=r"no pose has working mode \(-1, 1\) and .* 1 at"):
        kinematics.home(leg)
    assert kinematics.home(replace(leg, assembly=-1)).shape == (4,)


def refused(error: type[Exception], ask: Callable[[], object]) -> str:
    with pytest.raises(error) as info:
        ask()
    return str(info.value)


def test_messages_of_single_poses_and_of_batches() -> None:
    open_ = "|BD| must be above 0 and in [0, 0.08] m, got 0.12 m"
    apart = (math.pi, 0.0)
    foot = (0.0, -0.04)
    for theta, said in (
        (apart, f"the loop is open here: {open_}"),
        ([[apart]], f"the loop is open in 1 of 1 poses: {open_} at index (0, 0)"),
    ):
        assert refused(LoopOpenError, lambda theta=theta: kinematics.forward(RIGHT, theta)) == said
    near = FiveBar(0.03, 0.04, 0.06, 0.03, 0.01)  # with L1 beside L4 both knees are L5 apart
    said = refused(LoopOpenError, lambda: kinematics.forward(near, (0.5, 0.5)))
    assert said.endswith("in [0.02, 0.1] m, got 0.01 m")
    said = refused(UnreachableError, lambda: kinematics.inverse(RIGHT, [[foot, (0.0, -0.5)]]))
    assert said.endswith("m for the foot at (0, -0.5) m at index (0, 1)")
    line = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)
    batch = [(math.pi - 0.5, 0.5), apart]
    assert refused(SingularError, lambda: kinematics.jacobian(line, batch)).endswith(
        "at index (1,)"
    )
    far = "|EF| must be in [0.01, 0.07] m, got 0.08 m for the foot at (-0.05, 0) m"
    leg = replace(RIGHT, L3=0.04, L4=0.03)
    assert far in refused(
        UnreachableError, lambda: kinematics.inverse_nearest(leg, (-0.05, 0.0), (0.0, 0.0))
    )
    asks: list[tuple[str, Callable[[], object]]] = [
        ("foot must", lambda: kinematics.inverse_nearest(RIGHT, 1.0, foot)),
        ("theta_now must", lambda: kinematics.inverse_nearest(RIGHT, foot, 1.0)),
        ("foot must", lambda: kinematics.inverse_within(RIGHT, 1.0, [(-4, 4)] * 2)),
        ("foot must", lambda: kinematics.joint_motion(RIGHT, 1.0, foot, foot)),
        ("foot_dot must be fin", lambda: kinematics.joint_motion(RIGHT, foot, (0, math.nan), foot)),
        ("foot_ddot must be f", lambda: kinematics.joint_motion(RIGHT, foot, foot, (math.inf, 0))),
    ]
    for start, ask in asks:
        assert refused(ArgumentError, ask).startswith(start)


def test_limits_are_finite_on_every_side() -> None:
    for low, high in ((0.0, math.inf), (-math.inf, 0.0), (math.nan, 1.0), (1.0, 0.5)):
        for limits in ([(low, high), (0.0, 1.0)], [(0.0, 1.0), (low, high)]):
            with pytest.raises(ArgumentError, match=r"limits must be .* finite, low <= high, got"):
                kinematics.inverse_within(RIGHT, (0.0, -0.04), limits)


def test_what_is_beyond_the_limits_is_told_whole() -> None:
    """The limits that no mode keeps, or both where each is kept in one, in degrees too."""
    foot = (0.004, -0.042)
    deg = "([57.2958, 114.592] deg)"
    beyond = "beyond the joint limits in every working mode:"
    A = f"theta_A must be in [1, 2] rad {deg}, got -1.70686 or -0.0736923 rad"
    E = f"theta_E must be in [1, 2] rad {deg}, got -3.06844 or -1.18176 rad"
    at = "for the foot at (0.004, -0.042) m"
    one = (1.0, 2.0)
    wide = (-4.0, 4.0)
    for points, limits, said in (
        (foot, (one, wide), f"the point is {beyond} {A}, {at}"),
        ([foot] * 2, (wide, one), f"2 of 2 points are {beyond} {E}, {at} at index (0,)"),
        (foot, (one, one), f"the point is {beyond} {A} and {E}, {at}"),
    ):
        assert said == refused(
            UnreachableError,
            lambda points=points, limits=limits: kinematics.inverse_within(RIGHT, points, limits),
        )


@pytest.mark.parametrize("leg", [RIGID, replace(RIGID, L6=0.0)], ids=["rigid", "plain"])
@pytest.mark.parametrize("mode", MODES)
def test_message_out_of_reach_has_the_numbers_of_the_side_that_fails(
    leg: FiveBar, mode: Mode
) -> None:
    """Against complex numbers: B by the law of cosines at A, C from BC / BF in L2's own frame."""
    E = 0.5 * leg.L5 * cmath.exp(1j * leg.tilt)
    BF = leg.L2 + leg.L6 * cmath.exp(1j * leg.bend)
    seen = dict.fromkeys(("AF", "EC" if leg.L6 else "EF"), 0)
    for x, z in np.random.default_rng(5).uniform(-0.2, 0.2, (60, 2)).tolist():
        AF = complex(x, z) + E
        r = abs(AF)
        rho = abs(BF)
        what = "AF"
        ends = (leg.L1, rho)
        got = r
        if abs(leg.L1 - rho) <= r <= leg.L1 + rho:
            inside = math.acos((r * r + leg.L1**2 - rho**2) / (2.0 * r * leg.L1))
            AB = leg.L1 * AF / r * cmath.exp(1j * mode[0] * inside)
            what = "EC" if leg.L6 else "EF"
            ends = (leg.L4, leg.L3)
            got = abs(AB + (AF - AB) * leg.L2 / BF - 2.0 * E)
            if abs(ends[0] - ends[1]) <= got <= sum(ends):
                assert np.isfinite(kinematics.inverse(leg, (x, z), mode)).all()
                continue
        seen[what] += 1
        wanted = (
            f"the point is out of reach: |{what}| must be in [{abs(ends[0] - ends[1]):g}, "
            f"{sum(ends):g}] m, got {got:g} m for the foot at ({x:g}, {z:g}) m"
        )
        for ask in (kinematics.inverse, kinematics.inverse_half_angle):
            assert refused(UnreachableError, lambda: ask(leg, (x, z), mode=mode)) == wanted  # noqa: B023
    assert min(seen.values()) > 3
