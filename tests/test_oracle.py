"""The oracle is proven here on its own: by geometry, differences, power and energy."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import oracle
import pytest
from oracle import Array, Leg
from oracle_simulation import Path, eased_ellipse

from fivebar_sim.geometry import FiveBar

CLASSIC = Leg.of(FiveBar())
BENT = FiveBar(L1=0.040, L2=0.066, L3=0.058, L4=0.045, L5=0.030, L6=0.020, bend=0.5, tilt=0.2)
ODD = replace(  # nothing equal, nothing on an axis: a swap or a lost sign shows
    Leg.of(BENT),
    com=(0.017 + 0.003j, 0.037 - 0.005j, 0.026 + 0.004j, 0.021 - 0.002j),
    gravity=1.5 - 9.6j,
)
LEGS = pytest.mark.parametrize("leg", [CLASSIC, ODD], ids=["classic", "odd"])
ROUND = eased_ellipse((0.004, -0.075), (0.012, 0.009), 3.0, 0.0)
BATCHES = pytest.mark.parametrize("batch", [(), (1,), (3, 1, 4)])


def on(path: Path, t: float) -> tuple[complex, complex, complex]:
    p, v, a = path(t)
    return complex(*p), complex(*v), complex(*a)


def state(leg: Leg, t: float = 0.13) -> tuple[list[float], list[float], list[float]]:
    psi, psi_dot, psi_ddot = oracle.angles_of(leg, *on(ROUND, t))
    return psi, psi_dot, psi_ddot


def moved(psi: list[float], rates: list[float], step: float) -> list[float]:
    return [q + step * w for q, w in zip(psi, rates, strict=True)]


# --- law: kinematics ---


@LEGS
@pytest.mark.parametrize("mode", [(-1, -1), (-1, 1), (1, -1), (1, 1)])
def test_pose_has_the_links_and_its_mode(leg: Leg, mode: tuple[int, int]) -> None:
    target = 0.005 - 0.075j
    psi = oracle.pose(replace(leg, mode=mode), target)
    # every relation below is a few roundings of numbers up to 0.2 m
    assert abs(oracle.position(oracle.loop(leg, psi))) < 1e-15
    assert abs(oracle.position(oracle.foot(leg, psi)) - target) < 1e-15

    A, E = leg.motors
    C = A + cmath.rect(leg.lengths[0], psi[0]) + cmath.rect(leg.lengths[1], psi[1])
    for s, motor, aim, angle in ((mode[0], A, target, psi[0]), (mode[1], E, C, psi[3])):
        beta = math.remainder(angle - cmath.phase(aim - motor), 2 * math.pi)
        assert math.copysign(1.0, beta) == s
    sign = oracle.assembly_of(leg, psi)
    again = oracle.closed(replace(leg, assembly=sign), psi[0], psi[3])
    np.testing.assert_allclose(again, psi, rtol=0, atol=1e-14)
    other = oracle.closed(replace(leg, assembly=-sign), psi[0], psi[3])
    assert oracle.assembly_of(leg, other) == -sign
    assert abs(oracle.position(oracle.loop(leg, other))) < 1e-15
    assert abs(oracle.position(oracle.foot(leg, other)) - target) > 0.01


def test_tilt_turns_the_leg_about_the_origin() -> None:
    flat = replace(ODD, tilt=0.0)
    turn = cmath.rect(1.0, ODD.tilt)
    psi = np.array(oracle.pose(flat, -0.07j)) + ODD.tilt
    np.testing.assert_allclose(oracle.pose(ODD, -0.07j * turn), psi, rtol=0, atol=1e-14)


@LEGS
def test_slopes_of_pose_are_its_rates(leg: Leg) -> None:
    h = 1e-4
    t = 0.13
    before, now, after = (np.array(oracle.pose(leg, on(ROUND, s)[0])) for s in (t - h, t, t + h))
    _, psi_dot, psi_ddot = state(leg, t)
    # error: h^2 psi''' / 6 ~ 1e-9 * 1e4 / 6 and h^2 psi'''' / 12 ~ 1e-8 * 1e6 / 12
    np.testing.assert_allclose((after - before) / (2 * h), psi_dot, rtol=0, atol=1e-4)
    np.testing.assert_allclose((after - 2 * now + before) / h**2, psi_ddot, rtol=0, atol=2e-2)


@BATCHES
def test_batch_is_a_loop(batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    p, v, a, F = (
        c + s * rng.uniform(-1, 1, (*batch, 2))
        for c, s in (([0.0, -0.08], 0.005), ([0.0, 0.0], 0.3), ([0.0, 0.0], 3.0), ([0.0, 5.0], 2.0))
    )
    psi, psi_dot, psi_ddot = oracle.motion(ODD, p, v, a)
    tau = oracle.inverse_dynamics(ODD, p, v, a, F)
    assert psi.shape == psi_dot.shape == psi_ddot.shape == (*batch, 4)
    assert tau.shape == (*batch, 2)
    for i in np.ndindex(batch):
        row = complex(*p[i]), complex(*v[i]), complex(*a[i])
        for one, many in zip(oracle.angles_of(ODD, *row), (psi, psi_dot, psi_ddot), strict=True):
            np.testing.assert_array_equal(many[i], one)
        np.testing.assert_array_equal(tau[i], oracle.torques(ODD, *row, complex(*F[i])))


# --- slope: mass matrix, bias, accelerations ---


def places(leg: Leg, psi: list[float]) -> Array:
    """The four centres of mass, with sines and cosines, without arms."""
    L1, _, _, L4, L5 = leg.lengths
    out = np.zeros((4, 2))
    c = np.cos(psi)
    s = np.sin(psi)
    half = 0.5 * L5 * np.array([math.cos(leg.tilt), math.sin(leg.tilt)])
    inner = [-half, -half + L1 * np.array([c[0], s[0]]), half + L4 * np.array([c[3], s[3]]), half]
    for i, r in enumerate(leg.com):
        out[i] = inner[i] + [c[i] * r.real - s[i] * r.imag, s[i] * r.real + c[i] * r.imag]
    return out


@LEGS
def test_mass_matrix_is_kinetic_energy(leg: Leg) -> None:
    psi = state(leg)[0]
    h = 1e-5
    M = np.array(oracle.mass_matrix(leg, psi))
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M).min() > 0.0
    for w in np.random.default_rng(1).uniform(-10.0, 10.0, (5, 4)):
        ends = (places(leg, moved(psi, w.tolist(), s)) for s in (h, -h))
        speed = np.subtract(*ends) / (2 * h)
        T = 0.5 * np.dot(leg.mass, (speed**2).sum(axis=1)) + 0.5 * np.dot(leg.inertia, w**2)
        T += 0.5 * leg.armature * (w[0] ** 2 + w[3] ** 2)
        # relative error of the differences: (h w)^2 / 6 ~ 2e-9
        assert 0.5 * w @ M @ w == pytest.approx(T, rel=1e-8)
        weightless = replace(leg, gravity=0j)
        assert oracle.energy(weightless, psi, w.tolist()) == pytest.approx(T, rel=1e-8)


@LEGS
def test_potential_energy_is_work_against_gravity(leg: Leg) -> None:
    psi = state(leg)[0]
    g = np.array([leg.gravity.real, leg.gravity.imag])
    V = -np.dot(leg.mass, places(leg, psi) @ g)
    assert oracle.energy(leg, psi, [0.0] * 4) == pytest.approx(V, rel=1e-13)  # rounding


@LEGS
def test_bias_is_lagranges(leg: Leg) -> None:
    psi, w, _ = state(leg)
    h = 1e-5
    rate = np.array(w)

    def slope(f, along: list[float]):  # central difference of f(psi)
        return (f(moved(psi, along, h)) - f(moved(psi, along, -h))) / (2 * h)

    M_dot = slope(lambda q: np.array(oracle.mass_matrix(leg, q)), w)
    still = [0.0] * 4
    expected = M_dot @ rate
    for k, axis in enumerate(np.eye(4).tolist()):
        expected[k] -= (
            0.5 * rate @ slope(lambda q: np.array(oracle.mass_matrix(leg, q)), axis) @ rate
        )
        expected[k] += slope(lambda q: oracle.energy(leg, q, still), axis)
    # h ~ 1e-4 N m; differences: (h w)^2 / 6 ~ 1e-9 of it, and rounding 1e-18 J / h = 1e-13
    np.testing.assert_allclose(oracle.bias(leg, psi, w), expected, rtol=0, atol=2e-12)


@LEGS
def test_power_balances_and_the_loop_stays(leg: Leg) -> None:
    psi, w, _ = state(leg)
    tau = (0.02, -0.03)
    F = 0.3 + 0.8j
    h = 1e-6
    a, _ = oracle.forward_dynamics(leg, psi, w, tau, F)
    arms = oracle.loop(leg, psi)[1]
    size = 0.06 * max(map(abs, a))  # the terms that cancel [m/s^2]
    assert abs(oracle.velocity(arms, a) + oracle.centripetal(arms, w)) < 1e-13 * size

    def energy_at(s: float) -> float:
        q = [x + s * y + 0.5 * s**2 * z for x, y, z in zip(psi, w, a, strict=True)]
        return oracle.energy(leg, q, moved(w, a, s))

    power = tau[0] * w[0] + tau[1] * w[3]
    power += (F.conjugate() * oracle.velocity(oracle.foot(leg, psi)[1], w)).real
    # a ~ 1e3 rad/s^2: (h a / w)^2 / 6 ~ 1e-8 of the power 0.5 W; rounding 1e-18 / h = 1e-12 W
    assert (energy_at(h) - energy_at(-h)) / (2 * h) == pytest.approx(power, rel=1e-7)


@LEGS
def test_inverse_dynamics_undoes_forward(leg: Leg) -> None:
    psi, w, a = state(leg)
    F = 1.2 + 3.4j
    tau = oracle.torques(leg, *on(ROUND, 0.13), F)
    again, _ = oracle.forward_dynamics(leg, psi, w, tau, F)
    np.testing.assert_allclose(again, a, rtol=1e-10)  # rounding times cond(M) ~ 100


# --- oracle: statics and a leg simple enough for pencil and paper ---


@LEGS
def test_static_torque_is_jacobian_times_force(leg: Leg) -> None:
    psi = oracle.pose(leg, 0.004 - 0.08j)
    h = 1e-6
    F = np.array([3.0, 20.0])
    assert oracle.assembly_of(leg, psi) == leg.assembly

    def foot(psi1: float, psi4: float) -> Array:
        at = oracle.position(oracle.foot(leg, oracle.closed(leg, psi1, psi4)))
        return np.array([at.real, at.imag])

    q = psi[0]
    e = psi[3]
    J = np.stack([foot(q + h, e) - foot(q - h, e), foot(q, e + h) - foot(q, e - h)], -1) / (2 * h)
    tau = oracle.inverse_dynamics(
        replace(leg, gravity=0j), [0.004, -0.08], [0.0, 0.0], [0.0, 0.0], F
    )
    # rounding 1e-17 m / h = 1e-11 m, times 20 N
    np.testing.assert_allclose(tau, -J.T @ F, rtol=0, atol=1e-9)


@LEGS
def test_multiplier_is_the_force_on_link_2(leg: Leg) -> None:
    """At rest the moments on L2 about B and on L3 about D vanish, which leaves one lambda."""
    target = 0.004 - 0.08j
    F = 1.2 + 3.4j
    psi = oracle.pose(leg, target)
    tau = oracle.torques(leg, target, 0j, 0j, F)
    psi_ddot, force = oracle.forward_dynamics(leg, psi, [0.0] * 4, tau, F)
    e2 = cmath.rect(1.0, psi[1])
    e3 = cmath.rect(1.0, psi[2])
    weight = [m * leg.gravity for m in leg.mass]
    loads = [  # (arm, force): moment = arm x force
        [(leg.lengths[1] * e2, force), (leg.foot_offset * e2, F), (leg.com[1] * e2, weight[1])],
        [(leg.lengths[2] * e3, -force), (leg.com[2] * e3, weight[2])],
    ]
    for moments in loads:
        # rounding of terms of 0.3 N m
        assert abs(sum((arm.conjugate() * f).imag for arm, f in moments)) < 1e-15
    np.testing.assert_allclose(psi_ddot, 0.0, rtol=0, atol=1e-9)  # 1e-16 N m / 1e-6 kg m^2


def test_point_mass_at_the_foot_is_carried_by_statics() -> None:
    m = 0.1
    zero = (0.0, 0.0, 0.0, 0.0)
    leg = replace(
        ODD,
        mass=(0.0, m, 0.0, 0.0),
        com=(0j, ODD.foot_offset, 0j, 0j),
        inertia=zero,
        armature=0.0,
    )
    p, v, a = on(ROUND, 0.13)
    load = m * (leg.gravity - a)  # d'Alembert: weight and inertia, on a leg without mass
    bare = replace(leg, mass=zero)
    expected = oracle.torques(bare, p, 0j, 0j, load)
    np.testing.assert_allclose(oracle.torques(leg, p, v, a), expected, rtol=1e-12)  # rounding


# --- edge and refusal ---


def test_stretched_knee_is_where_the_circles_touch() -> None:
    B = oracle.crossing(0j, 0.25, 1 + 0j, 0.75, 1)  # exact in binary: no room for rounding
    assert B == 0.25
    assert oracle.crossing(0j, 0.25, 0.5j, 0.75, -1) == -0.25j


def test_leg_of_coaxial_motors() -> None:
    leg = Leg.of(FiveBar(L5=0.0, L1=0.04, L4=0.045))
    assert leg.motors == (0j, 0j)
    assert abs(oracle.position(oracle.loop(leg, oracle.pose(leg, 0.01 - 0.07j)))) < 1e-15


@pytest.mark.parametrize("target", [-0.2j, -0.001 + 0j, complex(math.nan, 0.0)])
def test_a_foot_out_of_reach_is_refused(target: complex) -> None:
    with pytest.raises(ValueError, match=r"the circles never cross: d must be in \[0.0"):
        oracle.pose(CLASSIC, target)


def test_an_open_loop_is_refused() -> None:
    far = Leg.of(FiveBar(L5=0.14))
    with pytest.raises(ValueError, match="the circles never cross"):
        oracle.closed(far, math.pi, 0.0)
