"""The half-angle route against the law of cosines; special poses, refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from poses import BATCHES, FAR, RIGHT, RIGID, WIDE, length, random_leg, sample

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import FiveBarError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.kinematics.half_angle import half_angle, principal
from fivebar_sim.kinematics.planar import turned, unit, wrap
from fivebar_sim.kinematics.reach import foot_radius_and_angle, side_angle

EPS = float(np.finfo(float).eps)
SOME = 8.0  # roundings, each at most u: measured 4 between the two routes


def root(r: Array, near: float, far: float) -> Array:
    """Return sqrt(a^2 + b^2 - c^2), which is four times the area of the side's triangle."""
    d2 = length(r) ** 2
    return np.sqrt(np.maximum(((near + far) ** 2 - d2) * (d2 - (near - far) ** 2), 0.0))


def side_bound(r: Array, near: float, far: float, u: float) -> Array:
    """Return how far two routes may be apart: u / root, and the root of rounding at its zeros."""
    with np.errstate(divide="ignore"):
        edge = np.sqrt(SOME * u / (near * length(r)))
        return np.minimum(SOME * u / root(r, near, far), edge)


def bound(leg: FiveBar, foot: Array, theta: Array) -> Array:
    """Return how far the two routes may be apart at (theta_A, theta_E)."""
    A, E = kinematics.bases(leg)
    rho, phi = foot_radius_and_angle(leg)
    bound_A = side_bound(foot - A, leg.L1, rho, EPS * (leg.L1 + rho + leg.L5) ** 2)
    B = A + leg.L1 * unit(theta[..., 0])
    C = B + (leg.L2 / rho) * turned(foot - B, -phi) if leg.L6 > 0.0 else foot
    bound_E = side_bound(C - E, leg.L4, leg.L3, EPS * (leg.L4 + leg.L3 + leg.L5) ** 2)
    if leg.L6 > 0.0:  # C moves with B on side A; E's angle by 2 L3 / root for each metre of C
        off = leg.L1 * (1.0 + leg.L2 / rho) * bound_A
        bound_E = bound_E + 2.0 * leg.L3 * off / root(C - E, leg.L4, leg.L3)
    return np.stack([bound_A, bound_E], axis=-1)


# law


@pytest.mark.parametrize("legs", [30, pytest.param(1000, marks=pytest.mark.long)])
def test_two_routes_agree_over_random_legs(legs: int) -> None:
    """1000 points each, all four modes; of a million points 1.2 10^6 poses are reachable."""
    rng = np.random.default_rng(5)
    seen = 0
    worst = 0.0
    for _ in range(legs):
        leg = random_leg(rng)
        foot = rng.uniform(-1.0, 1.0, (1000, 2)) * leg.size
        every = kinematics.inverse_all(leg, foot)
        for k, mode in enumerate(MODES):
            ok = np.isfinite(every[:, k, 0])
            p = foot[ok]
            theta = every[ok, k]
            other = kinematics.inverse_half_angle(leg, p, mode=mode)
            assert ((-np.pi < other) & (other <= np.pi)).all()
            error = np.abs(wrap(other - theta))
            assert (error <= bound(leg, p, theta)).all()
            worst = max(worst, float(error.max(initial=0.0)))
            seen = seen + int(ok.sum())
            count = f"^{1000 - ok.sum()} of 1000 points"
            with pytest.raises(UnreachableError, match=count):
                kinematics.inverse_half_angle(leg, foot, mode=mode)
    assert seen > 1000 * legs
    assert worst < 1e-10


def test_two_routes_agree_near_full_stretch_and_fold() -> None:
    """There the angle is known to the root of rounding: 3e-8 rad; 1e-10 from 1e-11 of d inwards."""
    rng = np.random.default_rng(6)
    worst = 0.0
    far_off = 0
    chains: Any = rng.uniform(0.02, 0.1, (3, 500, 1))
    near, far, L5 = chains
    u = EPS * (near + far + L5) ** 2
    inward = np.concatenate([np.zeros((500, 1)), 10.0 ** rng.uniform(-17.0, -2.0, (500, 50))], 1)
    for d in ((near + far) * (1.0 - inward), abs(near - far) * (1.0 + inward)):
        for turn in (rng.uniform(-np.pi, np.pi, d.shape), np.full(d.shape, np.pi)):
            r = d[..., None] * unit(turn)
            limit = side_bound(r, near, far, u)
            for s in (-1, 1):
                (theta, ok), (alpha, also) = (f(r, near, far, s) for f in (side_angle, half_angle))
                np.testing.assert_array_equal(ok, also)
                error = np.abs(wrap(alpha - theta))
                assert (error[ok] <= limit[ok]).all()
                worst = max(worst, float(error[ok].max()))
                far_off += int((error[ok] > 1e-10).sum())
    assert worst < 1e-6
    assert far_off > 100  # so it is the bound that was tested


# oracle


@pytest.mark.parametrize("batch", [*BATCHES, (100,)])
def test_batch_is_a_plain_loop_to_the_last_bit(batch: tuple[int, ...]) -> None:
    foot, theta = sample(RIGID, batch)
    found = kinematics.inverse_half_angle(RIGID, foot)
    np.testing.assert_allclose(found, theta, rtol=0, atol=1e-13)
    within = kinematics.inverse_within(RIGID, foot, WIDE)
    for index in np.ndindex(batch):
        assert (found[index] == kinematics.inverse_half_angle(RIGID, foot[index])).all()
        assert (within[index] == kinematics.inverse_within(RIGID, foot[index], WIDE)).all()
    assert found.shape == within.shape == (*batch, 2)


# edge


@pytest.mark.parametrize(("x", "z"), [(-0.25, -0.5), (-0.25, 0.5)])
def test_a_plus_c_zero_has_one_knee_at_half_a_turn(x: float, z: float) -> None:
    """|AB| = 1/4, |BC| = 1/2, in numbers without rounding: a + c = -1/8 + 1/8."""
    r = np.array([x, z])
    near = 0.25
    far = 0.5
    s = 1 if z > 0.0 else -1  # which knee is straight to the left
    assert principal(half_angle(r, near, far, s)[0]) == math.pi
    other = half_angle(r, near, far, -s)[0]  # 0 / 0 in the published form
    assert other == pytest.approx(2.0 * math.atan2(z, x) - s * math.pi, abs=1e-15)
    for off in (1e-16, -1e-16, 1e-12, -1e-12, 1e-6, -1e-6):
        moved = np.array([x + off, z])
        for sign in (-1, 1):
            alpha, theta = (f(moved, near, far, sign)[0] for f in (half_angle, side_angle))
            assert abs(wrap(alpha - theta)) < 1e-15


@pytest.mark.parametrize(("s", "zero"), [(-1, 0.0), (-1, -0.0), (1, 0.0), (1, -0.0)])
def test_full_stretch_and_fold_along_the_base_line(s: int, zero: float) -> None:
    """Where alpha is pi the first form is 0 / 0 in both modes: a + c = b = root = 0."""
    for x, near, far, alpha in (
        (0.75, 0.25, 0.5, 0.0),
        (-0.75, 0.25, 0.5, math.pi),
        (0.25, 0.25, 0.5, math.pi),
        (-0.25, 0.25, 0.5, 0.0),
        (0.25, 0.5, 0.25, 0.0),
        (-0.25, 0.5, 0.25, math.pi),
    ):
        r = np.array([x, zero])
        assert principal(half_angle(r, near, far, s)[0]) == alpha


def test_stretched_leg_is_never_at_minus_pi() -> None:
    leg = FiveBar(0.25, 0.5, 0.5, 0.25, 0.0)
    for z in (0.0, -0.0, -1e-20, -1e-300):
        theta = [kinematics.inverse_half_angle(leg, (-0.75, z), mode=mode) for mode in MODES]
        np.testing.assert_array_equal(theta, np.pi)


def test_foot_on_the_base_line() -> None:
    """There b = 0: the two knees are mirror images, cos alpha = c / a."""
    leg = FiveBar(0.05, 0.04, 0.045, 0.055, 0.06)
    for x in (-0.015, -0.001, 0.0, 0.01, 0.05):
        X = x + 0.5 * leg.L5
        alpha = math.acos((X**2 + leg.L1**2 - leg.L2**2) / (2.0 * leg.L1 * X))
        for mode in MODES:
            theta = kinematics.inverse_half_angle(leg, (x, 0.0), mode=mode)
            assert theta[0] == pytest.approx(mode[0] * alpha, abs=1e-14)
            assert np.abs(theta - kinematics.inverse(leg, (x, 0.0), mode)).max() < 1e-14


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_foot_on_A_of_equal_links(tilt: float) -> None:
    leg = FiveBar(0.05, 0.05, 0.04, 0.04, 0.03, tilt=tilt)
    assert kinematics.inverse_half_angle(leg, kinematics.bases(leg)[0])[0] == 0.0


def test_foot_near_A_of_equal_links() -> None:
    """There c = |AC|^2, of which L1^2 - L2^2 by squares would leave nothing."""
    near = 10.0 ** np.linspace(-12.0, -3.0, 50)[:, None] * unit(np.linspace(0.0, 6.0, 50))
    for s in (-1, 1):
        theta, alpha = (f(near, 0.05, 0.05, s)[0] for f in (side_angle, half_angle))
        assert np.abs(wrap(alpha - theta)).max() < 1e-15


def test_principal_angles() -> None:
    beyond = math.nextafter(math.pi, 4.0)
    angle = np.array([math.pi, -math.pi, beyond, -beyond, 0.1, 7.0, -7.0, 3 * math.pi])
    found = principal(angle)
    assert ((found > -math.pi) & (found <= math.pi)).all()
    np.testing.assert_allclose(np.cos(found - angle), 1.0, rtol=0, atol=1e-15)
    assert found[0] == found[1] == math.pi
    assert found[4] == 0.1


# refusal


@pytest.mark.parametrize("leg", [RIGHT, RIGID], ids=["plain", "extended"])
@pytest.mark.parametrize("mode", [None, (1, 1), (0, 1), "hanging"])
@pytest.mark.parametrize(
    "foot", [FAR, (-0.05, 0.2), (0.0, np.inf), (0.0, 1e200), (0.0, 0.0, 0.0), "ab"]
)
def test_refusals_are_those_of_inverse(leg: FiveBar, foot: Any, mode: Any) -> None:
    raised = []
    for f in (kinematics.inverse, kinematics.inverse_half_angle):
        with pytest.raises(FiveBarError) as info:
            f(leg, foot, mode=mode)
        raised.append((info.type, str(info.value), getattr(info.value, "index", None)))
    assert raised[0] == raised[1]
