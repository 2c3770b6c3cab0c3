"""The closed chain itself: its inverse dynamics three ways, and the energy that MuJoCo keeps."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
import oracle
import test_dynamics as pose_tests
import test_dynamics_motion as motion_tests

from fivebar_sim import dynamics, kinematics, model
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.integrator import Integrator
from fivebar_sim.simulation import steps

LEG = motion_tests.LEG
SLACK = motion_tests.SLACK
START = motion_tests.START
STIFFNESS = motion_tests.STIFFNESS
SECONDS = 10.0


def inverse_dynamics(preset: str) -> tuple[float, float]:
    """Return the largest relative error of `dynamics.inverse` over 50 random motions.

    Against the oracle, and against mj_inverse of the open tree with the loop's force eliminated.
    """
    leg = pose_tests.PRESETS[preset]
    (foot, v, a), F = pose_tests.motions(leg, np.random.default_rng(20240607))
    motion = kinematics.joint_motion(leg, foot, v, a)
    tau = dynamics.inverse(leg, *pose_tests.at_motors(motion), F)
    known = oracle.inverse_dynamics(oracle.Leg.of(leg), foot, v, a, F)

    mj = model.build(leg)
    off = mujoco.mjtDisableBit
    mj.opt.disableflags |= off.mjDSBL_CONSTRAINT | off.mjDSBL_ACTUATION | off.mjDSBL_DAMPER
    data = mujoco.MjData(mj)
    found = np.empty_like(tau)
    for i in range(len(foot)):
        data.qpos = motion.q[i]
        data.qvel = motion.q_dot[i]
        data.qacc = motion.q_ddot[i]
        mujoco.mj_inverse(mj, data)
        left, right, tip = (
            pose_tests.site_jacobian(mj, data, name) for name in ("C_left", "C_right", "foot")
        )
        columns = np.column_stack([*np.eye(4)[::2], *(left - right)])
        found[i] = np.linalg.solve(columns, data.qfrc_inverse - tip.T @ F[i])[:2]
    return pose_tests.worst(tau, known), pose_tests.worst(tau, found)


class Swing(NamedTuple):
    """Ten seconds of the leg on undamped springs.

    Attributes:
        time: [s], (N,).
        energy: What swings, over its start: 1 at t = 0, 0 at rest, (N,).
    """

    time: Array
    energy: Array

    @property
    def ripple(self) -> float:
        """The largest change of the energy within the first 0.1 s, some five swings."""
        return float(np.abs(self.energy[self.time <= 0.1] - 1.0).max())

    @property
    def drift(self) -> float:
        """The change from the mean over the first second to that over the last."""
        first = self.time <= 1.0
        last = self.time > SECONDS - 1.0
        return float(self.energy[last].mean() - self.energy[first].mean())

    @property
    def decay(self) -> float:
        """How fast the energy decays, from when it is first down to 1/e [1/s]; else 0."""
        down = np.flatnonzero(self.energy < np.exp(-1.0))
        return float(1.0 / self.time[down[0]]) if len(down) else 0.0


def swing(integrator: Integrator, timestep: float) -> Swing:
    """Return the swing in MuJoCo: servos with kp = STIFFNESS and kd = 0, sent a constant angle."""
    mj = model.build(
        LEG, servo=Servo(kp=STIFFNESS, kd=0.0), timestep=timestep, integrator=integrator
    )
    foot = kinematics.forward(LEG, START)[None]
    rest = np.zeros((1, 2))
    q = kinematics.joint_motion(LEG, foot, rest, rest).q
    ctrl = np.broadcast_to(SLACK, (1, round(SECONDS / timestep), 2))
    states = steps.simulate(mj, q, ctrl)
    steps.check_states(states, timestep)
    theta, theta_dot = (rows[0][:, ::2] for rows in (states.qpos, states.qvel))
    return Swing(states.time[0], _fraction(theta, theta_dot))


def true_swing() -> Swing:
    """Return the swing by `dynamics.integrate`, which tests/test_dynamics_motion.py proves."""
    times: Array = np.linspace(0.0, SECONDS, 1001)
    motion = dynamics.integrate(LEG, START, motion_tests.STILL, times, motion_tests.springs)
    return Swing(times, _fraction(motion.theta, motion.theta_dot))


def _fraction(theta: Array, theta_dot: Array) -> Array:
    """Return the energy above that of rest, over that at the start."""
    rest = _resting()
    low, high = (float(_total(pose, np.zeros(2))) for pose in (rest, START))
    return (_total(theta, theta_dot) - low) / (high - low)


def _total(theta: Array, theta_dot: Array) -> Array:
    stored = 0.5 * STIFFNESS * np.sum((theta - SLACK) ** 2, axis=-1)
    return np.sum(dynamics.energy(LEG, theta, theta_dot), axis=0) + stored


def _resting() -> Array:
    """Return where springs and weight balance: k (theta - slack) = -bias, by iteration."""
    theta = SLACK
    for _ in range(50):  # the weight's stiffness is a hundredth of the springs': 2 digits a round
        theta = SLACK - dynamics.bias(LEG, theta, np.zeros(2)) / STIFFNESS
    return theta


def squared_rates() -> Array:
    """Return omega^2 of the two ways of swinging about the slack pose [1/s^2], (2,)."""
    inertias = np.linalg.eigvalsh(dynamics.mass_matrix(LEG, SLACK))
    return np.array(STIFFNESS / inertias, dtype=np.float64)
