"""Torques of whole steps: their limit, MuJoCo's open tree, the soft loop's equation, refusals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from poses import BATCHES, RIGID

from fivebar_sim import dynamics, kinematics, model, motion
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, DivergedError, SingularError
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import pull
from fivebar_sim.motion import Motion
from fivebar_sim.paths import Ellipse

LEG = FiveBar.load("classic")
LEGS = {name: FiveBar.load(name) for name in resources.shipped("models/legs")} | {"rigid": RIGID}
PATH = Ellipse(centre=(0.0, -0.072), radii=(0.02, 0.008), frequency=2.0, ramp=0.25)
KD = 0.05


def planned(h: float, duration: float = 0.5) -> Motion:
    return motion.plan(LEG, PATH, round(duration / h), h)


def open_rows(leg: FiveBar, rng: np.random.Generator, h: float, batch: tuple[int, ...]) -> Array:
    """Return three rows each of motions near the rest pose that do not keep the loop closed."""
    q = kinematics.home(leg) + rng.uniform(-0.2, 0.2, (*batch, 4))
    v = rng.uniform(-5.0, 5.0, q.shape)
    a = rng.uniform(-50.0, 50.0, q.shape)
    return np.stack([q - h * v, q, q + h * (v + h * a)], axis=-2)


# law


@settings(max_examples=25)
@given(
    frequency=st.floats(0.5, 4.0),
    payload=st.floats(0.0, 0.5),
    friction=st.floats(0.0, 0.1),
    force=st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)),
)
def test_short_steps_take_the_torque_of_the_continuous_motion(
    frequency: float, payload: float, friction: float, force: tuple[float, float]
) -> None:
    path = ellipse(frequency)
    errors = []
    for h in (2e-4, 1e-4):
        m = motion.plan(LEG, path, round(0.3 / h), h)
        tau = dynamics.step_torques(LEG, m.q, h, force, payload=payload, friction=friction)
        theta, w, alpha = (x[:-1, ::2] for x in (m.q, m.q_dot, m.q_ddot))
        exact = dynamics.inverse(LEG, theta, w, alpha, force, payload=payload, friction=friction)
        moving = (np.abs(w) > 2.0 * h * np.abs(alpha)).all(-1)  # friction's sign is plain
        errors.append(float(np.abs(tau - exact)[moving].max()))
    assert errors[1] < 0.02 * np.abs(exact).max()
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)  # of first order


def ellipse(frequency: float) -> Ellipse:
    return Ellipse(centre=PATH.centre, radii=PATH.radii, frequency=frequency, ramp=0.1)


@pytest.mark.parametrize(("damping", "order", "widest"), [(0.0, 2, 2e-6), (KD, 3, 100e-6)])
def test_left_side_of_a_soft_loop_keeps_its_motion_and_the_right_trails(
    damping: float, order: int, widest: float
) -> None:
    """The gap is what k = 1 / 4 h^2 makes of h D alpha, and of b times the sagitta of a step."""
    gaps = []
    for h in (1e-3, 5e-4):
        q = planned(h).q
        soft = dynamics.soft_loop(LEG, q, h, damping)
        np.testing.assert_array_equal(soft[:, :2], q[:, :2])
        np.testing.assert_allclose(soft[0], q[0], rtol=0, atol=1e-15)  # of psi - theta
        p = kinematics.chain_points(LEG, soft)
        gaps.append(np.hypot(*(p.C_right - p.C_left).T).max())
    assert gaps[0] / gaps[1] == pytest.approx(2.0**order, rel=0.05)
    assert 0.3 * widest < gaps[0] < widest


# oracle


@pytest.mark.parametrize("leg", LEGS.values(), ids=LEGS)
def test_torques_are_those_of_mujocos_open_tree(leg: FiveBar, rng: np.random.Generator) -> None:
    h = 0.1
    friction = 0.2
    F = np.array([1.5, -4.0])
    rows = open_rows(leg, rng, h, (20,))
    tau = dynamics.step_torques(leg, rows, h, F, friction=friction)[:, 1]
    v, v_next = (np.diff(rows, axis=1) / h).swapaxes(0, 1)
    mj = model.build(leg)
    off = mujoco.mjtDisableBit
    mj.opt.disableflags |= off.mjDSBL_CONSTRAINT | off.mjDSBL_ACTUATION | off.mjDSBL_DAMPER
    data = mujoco.MjData(mj)
    for i in range(len(rows)):
        data.qpos = rows[i, 1]
        data.qvel = v[i]
        data.qacc = (v_next[i] - v[i]) / h
        mujoco.mj_inverse(mj, data)
        left, right, tip = (site_jacobian(mj, data, name) for name in ("C_left", "C_right", "foot"))
        columns = np.column_stack([*np.eye(4)[::2], *(left - right)])
        known = np.linalg.solve(columns, data.qfrc_inverse - tip.T @ F)[:2]
        truth = known + friction * np.sign(v_next[i, ::2])
        np.testing.assert_allclose(tau[i], truth, rtol=0, atol=1e-10 * np.abs(truth).max())


def site_jacobian(mj: mujoco.MjModel, data: mujoco.MjData, name: str) -> Array:
    J = np.empty((3, mj.nv))
    mujoco.mj_jacSite(mj, data, J, None, mj.site(name).id)
    return J[::2]


@pytest.mark.parametrize("h", [1e-3, 2e-4])
def test_pull_of_the_loop_is_mujocos(h: float) -> None:
    mj = model.build(LEG, servo=Servo(), timestep=h, integrator="implicitfast")
    data = mujoco.MjData(mj)
    data.qpos[:] = kinematics.home(LEG)
    data.qpos[3] += 1e-3
    data.qvel[:] = 0.1, -0.2, 0.3, 0.4
    mujoco.mj_forward(mj, data)
    k, b = pull(h)
    np.testing.assert_allclose(data.efc_KBIP[:3, 0] * data.efc_KBIP[:3, 2], k, rtol=1e-12)
    np.testing.assert_allclose(data.efc_KBIP[:3, 1], b, rtol=1e-12)


@pytest.mark.parametrize("batch", BATCHES)
def test_batch_is_a_plain_loop(batch: tuple[int, ...], rng: np.random.Generator) -> None:
    h = 0.1
    rows = open_rows(RIGID, rng, 0.1, batch)
    tau = dynamics.step_torques(RIGID, rows, h)
    assert tau.shape == (*batch, 2, 2)
    for index in np.ndindex(batch):
        alone = dynamics.step_torques(RIGID, rows[index], h)
        np.testing.assert_array_equal(tau[index], alone)


# edge


def test_rest_takes_what_holds_the_leg_and_no_friction() -> None:
    q = np.tile(kinematics.home(LEG), (4, 1))
    held = dynamics.inverse(LEG, q[0, ::2], (0.0, 0.0), (0.0, 0.0), payload=0.1)
    tau = dynamics.step_torques(LEG, q, 1e-3, payload=0.1, friction=1.0)
    np.testing.assert_allclose(tau, np.tile(held, (3, 1)), rtol=1e-12)
    # k times the rounding of a loop of 0.1 m, over 60 mm and k again
    np.testing.assert_allclose(dynamics.soft_loop(LEG, q, 1e-3, KD), q, rtol=0, atol=1e-14)


def test_rounding_of_a_leg_at_rest_turns_no_friction_round() -> None:
    q = np.tile(kinematics.home(LEG), (5, 1))
    # A path sets out by less than an angle's last bits, up and down.
    q[1::2, ::2] += 4e-15
    held = dynamics.step_torques(LEG, q, 1e-3)
    np.testing.assert_array_equal(dynamics.step_torques(LEG, q, 1e-3, friction=1.0), held)


# refusal


def test_bad_arguments_are_refused() -> None:
    m = planned(1e-3, 0.1)
    spoilt = m.q.copy()
    spoilt[3, 1] = math.nan
    asks: list[tuple[str, Callable[[], object]]] = [
        ("q must be finite at index", lambda: dynamics.step_torques(LEG, spoilt, 1e-3)),
        (r"q must have shape \(..., N", lambda: dynamics.step_torques(LEG, m.q[:1], 1e-3)),
        (r"q must have shape \(..., 4", lambda: dynamics.step_torques(LEG, m.q[:, :3], 1e-3)),
        (r"q must have shape \(N \+", lambda: dynamics.soft_loop(LEG, m.q[None], 1e-3, KD)),
        ("timestep must be in .* s, got 0", lambda: dynamics.step_torques(LEG, m.q, 0.0)),
        ("finite accelerations at", lambda: dynamics.step_torques(LEG, m.q, 1e-200)),
        ("foot_force must broadcast", lambda: dynamics.step_torques(LEG, m.q, 1e-3, m.force)),
        ("foot_force must be finite", lambda: dynamics.step_torques(LEG, m.q, 1e-3, (0, math.inf))),
        ("friction must be in", lambda: dynamics.step_torques(LEG, m.q, 1e-3, friction=-1.0)),
        ("payload must be in", lambda: dynamics.step_torques(LEG, m.q, 1e-3, payload=-1.0)),
        ("damping must be in", lambda: dynamics.soft_loop(LEG, m.q, 1e-3, -1.0)),
    ]
    for message, ask in asks:
        with pytest.raises(ArgumentError, match=message):
            ask()


def test_singular_poses_and_a_loop_that_cannot_follow_are_refused() -> None:
    q = np.zeros((3, 4))
    with pytest.raises(SingularError, match=r"B, C and D are in line: .* at index \(0,\)") as info:
        dynamics.step_torques(LEG, q, 1e-3)
    assert info.value.index == (0,)
    folded = np.tile(kinematics.home(LEG), (3, 1))
    folded[:, 3] = 0.0
    with pytest.raises(SingularError, match="E, D and C are in line"):
        dynamics.soft_loop(LEG, folded, 1e-3, KD)
    jump = planned(1e-3, 0.1).q.copy()
    jump[50:, 0] += 0.4
    with pytest.raises(DivergedError, match=r"cannot follow at t = 0\.0") as diverged:
        dynamics.soft_loop(replace(LEG, armature=0.0), jump, 1e-3, KD)
    assert 0.049 <= diverged.value.time < 0.1
