"""Dynamics of poses: power and energy, differences, oracle and MuJoCo, hand cases, refusals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import oracle
import pytest
from poses import BATCHES, LINE, RIGHT, RIGID, sample

from fivebar_sim import dynamics, kinematics, model
from fivebar_sim.analysis import singularity
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, LoopOpenError, SingularError
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics import JointMotion

ASKEW = (2.5, -9.0)
"""Gravity along no axis [m/s^2]."""
PRESETS = {n: replace(FiveBar.load(n), gravity=ASKEW) for n in resources.shipped("models/legs")}
HEAVY = FiveBar(  # nothing equal, nothing in the middle of a link
    *(0.05, 0.04, 0.035, 0.07, 0.09, 0.02, 0.5, 0.3),
    mass=(0.03, 0.05, 0.02, 0.07),
    com=(0.012, 0.031, 0.015, 0.02),
    com_across=(0.003, -0.005, 0.004, -0.002),
    inertia=(1e-5, 4e-5, 2e-5, 3e-5),
    armature=3e-5,
    gravity=ASKEW,
)
LEGS = {**PRESETS, "rigid": replace(RIGID, gravity=ASKEW), "heavy": HEAVY}
EACH = pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
IN_LINE = (math.pi, 0.0)
LOAD = 0.2  # payload [kg]


def poses(leg: FiveBar, batch: tuple[int, ...]) -> Array:
    return sample(leg, batch, leg.mode, leg.assembly)[1]


def rates(rng: np.random.Generator, theta: Array) -> Array:
    return rng.uniform(-20.0, 20.0, theta.shape)


def times(M: Array, v: Array) -> Array:
    return np.einsum("...ij,...j->...i", M, v)


def motions(leg: FiveBar, rng: np.random.Generator) -> tuple[tuple[Array, Array, Array], Array]:
    """Return 50 random foot motions of some sizes a second, and foot forces."""
    foot = sample(leg, (50,), leg.mode, leg.assembly)[0]
    v = rng.uniform(-5.0, 5.0, foot.shape) * leg.size
    a = rng.uniform(-100.0, 100.0, foot.shape) * leg.size
    return (foot, v, a), rng.uniform(-10.0, 10.0, foot.shape)


def at_motors(motion: JointMotion) -> tuple[Array, Array, Array]:
    return motion.q[..., ::2], motion.q_dot[..., ::2], motion.q_ddot[..., ::2]


def worst(found: Array, truth: Array) -> float:
    """Return the greatest error of a row relative to that row's greatest number."""
    scale = np.abs(truth).max(axis=-1, keepdims=True)
    return float((np.abs(found - truth) / scale).max())


# law


@pytest.mark.parametrize("batch", BATCHES)
@EACH
def test_equation_of_motion_holds_together(
    leg: FiveBar, batch: tuple[int, ...], rng: np.random.Generator
) -> None:
    theta = poses(leg, batch)
    w = rates(rng, theta)
    alpha = 50.0 * rates(rng, theta)
    F = rates(rng, theta)
    M = dynamics.mass_matrix(leg, theta, payload=LOAD)
    assert M.shape == (*batch, 2, 2)
    np.testing.assert_array_equal(M, np.swapaxes(M, -1, -2))
    assert (np.linalg.eigvalsh(M) > 0.0).all()

    h = dynamics.bias(leg, theta, w, payload=LOAD)
    tau = dynamics.inverse(leg, theta, w, alpha, F, payload=LOAD)
    parts = times(M, alpha) + h + dynamics.statics(leg, theta, F)
    assert tau.shape == h.shape == theta.shape
    assert worst(tau, parts) < 1e-12  # roundings of the sum
    again = dynamics.forward(leg, theta, w, tau, F, payload=LOAD)
    assert worst(again, alpha) < 1e-11  # the same times M's condition, some tens

    kinetic, potential = dynamics.energy(leg, theta, w, payload=LOAD)
    assert kinetic.shape == potential.shape == batch
    half = 0.5 * np.einsum("...i,...ij,...j->...", w, M, w)
    np.testing.assert_allclose(kinetic, half, rtol=1e-13)
    J = kinematics.jacobian(leg, theta)
    felt = dynamics.reflected_inertia(leg, theta, payload=LOAD)
    v = times(J, w)
    np.testing.assert_allclose(np.einsum("...i,...ij,...j->...", v, felt, v), 2 * half, rtol=1e-12)
    np.testing.assert_array_equal(felt, np.swapaxes(felt, -1, -2))


@EACH
def test_weightless_rest_is_statics(leg: FiveBar, rng: np.random.Generator) -> None:
    theta = poses(leg, (30,))
    F = rng.uniform(-10.0, 10.0, theta.shape)
    truth = -np.einsum("...ji,...j->...i", kinematics.jacobian(leg, theta), F)
    assert worst(dynamics.statics(leg, theta, F), truth) < 1e-12
    floating = replace(leg, gravity=(0.0, 0.0))
    assert worst(dynamics.inverse(floating, theta, (0, 0), (0, 0), F), truth) < 1e-12


@EACH
def test_payload_is_the_force_that_its_mass_exerts(leg: FiveBar, rng: np.random.Generator) -> None:
    (foot, v, a), F = motions(leg, rng)
    motion = at_motors(kinematics.joint_motion(leg, foot, v, a))
    carried = dynamics.inverse(leg, *motion, F, payload=LOAD)
    pulled = dynamics.inverse(leg, *motion, F + LOAD * (np.array(leg.gravity) - a))
    assert worst(carried, pulled) < 1e-11


# slope


@EACH
def test_energy_grows_by_the_power_put_in(leg: FiveBar, rng: np.random.Generator) -> None:
    theta = poses(leg, (30,))
    h = 1e-6
    w = rates(rng, theta)
    alpha = 50.0 * rates(rng, theta)
    F = rates(rng, theta)
    tau = dynamics.inverse(leg, theta, w, alpha, F, payload=LOAD)
    power = np.sum(tau * w, -1) + np.sum(F * times(kinematics.jacobian(leg, theta), w), -1)
    energies = [
        sum(dynamics.energy(leg, theta + t * w + t * t / 2 * alpha, w + t * alpha, payload=LOAD))
        for t in (-h, h)
    ]
    slope = (energies[1] - energies[0]) / (2.0 * h)
    # h^2 E''' / 6 with rates up to 20 1/s far from singular, and eps E / h
    np.testing.assert_allclose(power, slope, rtol=0, atol=1e-7 * np.abs(power).max())


@EACH
def test_weight_is_the_slope_of_the_potential_energy(leg: FiveBar) -> None:
    theta = poses(leg, (30,))
    h = 1e-5
    rest = (0.0, 0.0)
    slopes = [
        (up.potential - down.potential) / (2.0 * h)
        for up, down in (
            [dynamics.energy(leg, theta + s * h * e, rest, payload=LOAD) for s in (1, -1)]
            for e in np.eye(2)
        )
    ]
    held = dynamics.bias(leg, theta, rest, payload=LOAD)
    # h^2 U''' / 6 and eps U / h, of U about m g size and held m g size
    np.testing.assert_allclose(held, np.stack(slopes, -1), rtol=0, atol=1e-8 * np.abs(held).max())


# oracle


@EACH
def test_torques_and_energy_are_the_oracles(leg: FiveBar, rng: np.random.Generator) -> None:
    (foot, v, a), F = motions(leg, rng)
    truth = oracle.Leg.of(leg)
    theta, w, alpha = at_motors(kinematics.joint_motion(leg, foot, v, a))
    tau = dynamics.inverse(leg, theta, w, alpha, F)
    assert worst(tau, oracle.inverse_dynamics(truth, foot, v, a, F)) < 1e-11  # measured: 1e-14

    psi, psi_dot, _ = oracle.motion(truth, foot, v, a)
    pushed = dynamics.forward(leg, theta, w, 0.1 * F, F)
    for i in range(len(foot)):
        angles = psi[i].tolist()
        speeds = psi_dot[i].tolist()
        alphas, _ = oracle.forward_dynamics(truth, angles, speeds, 0.1 * F[i], complex(*F[i]))
        assert worst(pushed[i], np.array(alphas)[[0, 3]]) < 1e-10
        total = sum(dynamics.energy(leg, theta[i], w[i]))
        assert total == pytest.approx(oracle.energy(truth, angles, speeds), rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
@EACH
def test_torques_are_mujocos_with_the_loop_eliminated(
    leg: FiveBar, integrator: model.Integrator, rng: np.random.Generator
) -> None:
    (foot, v, a), F = motions(leg, rng)
    motion = kinematics.joint_motion(leg, foot, v, a)
    mj = model.build(leg, integrator=integrator)
    off = mujoco.mjtDisableBit
    mj.opt.disableflags |= off.mjDSBL_CONSTRAINT | off.mjDSBL_ACTUATION | off.mjDSBL_DAMPER
    data = mujoco.MjData(mj)
    tau = dynamics.inverse(leg, *at_motors(motion), F)
    for i in range(len(foot)):
        data.qpos = motion.q[i]
        data.qvel = motion.q_dot[i]
        data.qacc = motion.q_ddot[i]
        mujoco.mj_inverse(mj, data)
        left, right, tip = (site_jacobian(mj, data, name) for name in ("C_left", "C_right", "foot"))
        # open tree: f = (tau_A, 0, tau_E, 0) + loop^T lambda + tip^T F
        columns = np.column_stack([*np.eye(4)[::2], *(left - right)])
        known = np.linalg.solve(columns, data.qfrc_inverse - tip.T @ F[i])
        assert worst(tau[i], known[:2]) < 1e-10


def site_jacobian(mj: mujoco.MjModel, data: mujoco.MjData, name: str) -> Array:
    J = np.empty((3, mj.nv))
    mujoco.mj_jacSite(mj, data, J, None, mj.site(name).id)
    return J[::2]


def test_batch_is_a_plain_loop_to_the_last_bit(rng: np.random.Generator) -> None:
    theta = poses(HEAVY, (64,))
    w, alpha, F = (rates(rng, theta) for _ in range(3))
    laws: list[tuple[Callable[..., Array], tuple[Array, ...]]] = [
        (dynamics.inverse, (theta, w, alpha, F)),
        (dynamics.forward, (theta, w, alpha, F)),
        (dynamics.statics, (theta, F)),
        (dynamics.mass_matrix, (theta,)),
        (dynamics.bias, (theta, w)),
        (dynamics.reflected_inertia, (theta,)),
    ]
    for law, given in laws:
        rows = [law(HEAVY, *row) for row in zip(*given, strict=True)]
        np.testing.assert_array_equal(law(HEAVY, *given), rows)
        # as controllers ask, which is answered in plain numbers
        single = [law(HEAVY, *(each[k : k + 1] for each in given)) for k in range(len(theta))]
        np.testing.assert_array_equal(law(HEAVY, *given), np.concatenate(single))
    rows = [dynamics.energy(HEAVY, *row) for row in zip(theta, w, strict=True)]
    np.testing.assert_array_equal(np.transpose(dynamics.energy(HEAVY, theta, w)), rows)


# edge


def test_right_angled_pose_by_hand() -> None:
    """J = ((1/64, 1/64), (-3/56, 3/56)) m: see the test of the Jacobian."""
    theta = kinematics.inverse(RIGHT, (0.0, -0.04))
    tau = dynamics.statics(RIGHT, theta, [(0.0, 56.0), (64.0, 0.0)])
    np.testing.assert_allclose(tau, [(3.0, -3.0), (-1.0, -1.0)], rtol=1e-14)


def test_leg_of_nothing_is_felt_as_its_payload() -> None:
    nothing = replace(HEAVY, mass=(1e-15,) * 4, inertia=(1e-18,) * 4, armature=0.0)
    felt = dynamics.reflected_inertia(nothing, poses(nothing, (20,)), payload=0.7)
    np.testing.assert_allclose(felt, np.broadcast_to(0.7 * np.eye(2), (20, 2, 2)), atol=1e-10)


def test_coaxial_leg_turned_as_a_whole_is_a_rigid_body() -> None:
    leg = replace(PRESETS["minitaur"], gravity=(0.0, 0.0))
    theta = poses(leg, (20,))
    w = (7.0, 7.0)
    np.testing.assert_allclose(dynamics.bias(leg, theta, w).sum(-1), 0.0, rtol=0, atol=1e-13)
    turned = dynamics.energy(leg, theta + 0.4, w)
    np.testing.assert_allclose(turned.kinetic, dynamics.energy(leg, theta, w).kinetic, rtol=1e-12)


def test_assembly_and_its_mirror_image() -> None:
    other = replace(HEAVY, assembly=1)
    theta = poses(other, (10,))
    given = (theta, theta, theta)
    F = (1.0, 2.0)
    found = dynamics.inverse(HEAVY, *given, F, assembly=1)
    np.testing.assert_array_equal(found, dynamics.inverse(other, *given, F))
    assert (np.abs(found - dynamics.inverse(HEAVY, *given, F)) > 1e-3).any()


def test_straight_sides_move_but_resist_without_limit() -> None:
    leg = FiveBar(0.25, 0.5, 0.5, 0.375, 0.5)
    for x_F, chain in ((0.5, "A, B and F"), (-0.625, "E, D and C")):  # stretched to the last bit
        foot = [(0.0, -0.5), (x_F, 0.0)]
        theta = kinematics.inverse(leg, foot)
        points = singularity.points_at(leg, np.array(foot), theta)
        sign = int(kinematics.branch(leg, points).assembly[1])
        assert np.isfinite(dynamics.mass_matrix(leg, theta[1], assembly=sign)).all()
        with pytest.raises(SingularError, match=f"{chain} are in line") as info:
            dynamics.reflected_inertia(leg, theta[1:], assembly=sign)
        assert info.value.index == (0,)


# refusal


def test_singular_and_open_poses_name_the_first_index() -> None:
    theta = [(math.pi - 0.5, 0.5), IN_LINE]
    still = (0.0, 0.0)
    for ask in (dynamics.mass_matrix, dynamics.reflected_inertia):
        with pytest.raises(SingularError, match="1 of 2 poses are singular: B, C and D") as info:
            ask(LINE, theta)
        assert info.value.index == (1,)
    with pytest.raises(LoopOpenError, match="in 1 of 2 poses") as opened:
        dynamics.inverse(RIGHT, [(-1.85, -1.28), IN_LINE], still, still)
    assert opened.value.index == (1,)
    for leg, error in ((LINE, SingularError), (RIGHT, LoopOpenError)):
        with pytest.raises(error) as first:
            dynamics.inverse(leg, [IN_LINE], still, still)
        assert first.value.index == (0,)


def test_bad_arguments_are_refused() -> None:
    theta = poses(HEAVY, ())
    still = (0.0, 0.0)
    bad = (0.0, math.nan)
    asks: list[tuple[str, Callable[[], object]]] = [
        ("theta must be finite", lambda: dynamics.mass_matrix(HEAVY, bad)),
        ("theta_dot must be finite", lambda: dynamics.bias(HEAVY, theta, bad)),
        ("theta_ddot must be finite", lambda: dynamics.inverse(HEAVY, theta, still, bad)),
        ("foot_force must be finite", lambda: dynamics.statics(HEAVY, theta, bad)),
        ("tau must be finite", lambda: dynamics.forward(HEAVY, theta, still, bad)),
        ("theta_dot must have shape", lambda: dynamics.energy(HEAVY, theta, (1.0, 2.0, 3.0))),
        ("theta and theta_dot must", lambda: dynamics.bias(HEAVY, [theta] * 2, [still] * 3)),
        ("payload must be in .* kg", lambda: dynamics.mass_matrix(HEAVY, theta, payload=-1.0)),
        ("payload must be in", lambda: dynamics.energy(HEAVY, theta, still, payload=math.inf)),
        ("assembly must be -1 or 1", lambda: dynamics.statics(HEAVY, theta, still, assembly=0)),
    ]
    for message, ask in asks:
        with pytest.raises(ArgumentError, match=message):
            ask()
