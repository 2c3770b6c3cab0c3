"""The feedback controllers in the loop with the closed chain's dynamics, without MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from fivebar_controllers.computed_torque import ComputedTorque
from fivebar_controllers.gain_schedule import GainSchedule
from fivebar_controllers.gravity_compensation import GravityCompensation
from fivebar_controllers.impedance import Impedance
from fivebar_controllers.pd import Pd
from poses import sample

from fivebar_sim import dynamics, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import DivergedError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.paths import Circle

AIRHOCKEY = FiveBar.load("airhockey")
EXTENDED = FiveBar.load("extended")
CLASSIC = FiveBar.load("classic")
HOME = kinematics.home(AIRHOCKEY)[::2]
STILL = np.zeros(2)
NO_SERVO = Servo()
"""What torque controllers do not look at."""
Law = Pd | GainSchedule | ComputedTorque | Impedance | GravityCompensation
Wanted = Callable[[float], Reference]


def law_of(leg: FiveBar, controller: Law, wanted: Wanted) -> dynamics.Law:
    """Return a controller as a torque law in continuous time: a period of zero."""
    return lambda t, q, w: controller.command(leg, NO_SERVO, Observation(t, q, w), wanted(t))


def sampled(
    leg: FiveBar, controller: Law, wanted: Wanted, theta: Array, time: float, rate: Any = STILL
) -> dynamics.Motion:
    """Return the motion of legs whose torques are held for the controller's period."""
    T = controller.period
    q = theta
    w = np.broadcast_to(rate, theta.shape)
    n = math.ceil(T / 0.005)
    rows = [(0.0, q, w)]
    for k in range(round(time / T)):
        tau = controller.command(leg, NO_SERVO, Observation(k * T, q, w), wanted(k * T))
        hold = dynamics.simulate(leg, q, w, T / n, n, lambda t, q, w, tau=tau: tau)
        q = hold.theta[-1]
        w = hold.theta_dot[-1]
        rows.append(((k + 1) * T, q, w))
    time_, q, w = zip(*rows, strict=True)
    return dynamics.Motion(np.array(time_), np.array(q), np.array(w))


def keep(leg: FiveBar, theta: Array, force: Any = STILL, payload: float = 0.0) -> Wanted:
    """Return the reference of legs that shall rest in a pose."""
    zero = np.zeros_like(theta)
    force = np.broadcast_to(force, theta.shape)
    foot = kinematics.forward(leg, theta)
    return lambda t: Reference(foot, zero, zero, theta, zero, zero, force, payload)


def follow(leg: FiveBar, path: Circle) -> Wanted:
    """Return the reference of one leg along a path that does not wind a motor."""

    @cache
    def wanted(t: float) -> Reference:
        foot, foot_dot, foot_ddot = path.at(t)
        m = kinematics.joint_motion(leg, foot, foot_dot, foot_ddot)
        return Reference(
            foot, foot_dot, foot_ddot, m.q[::2], m.q_dot[::2], m.q_ddot[::2], STILL, 0.0
        )

    return wanted


def misses(leg: FiveBar, motion: dynamics.Motion, wanted: Wanted) -> Array:
    """Return |F - F*| at the rows of a motion [m]."""
    foot = np.array([wanted(t).foot for t in motion.time])
    d = kinematics.forward(leg, motion.theta) - foot
    return np.hypot(d[..., 0], d[..., 1])


# law


def test_error_of_computed_torque_is_a_free_oscillator() -> None:
    """e_ddot + kd e_dot + kp e = 0, with a payload, a foot force, a motion and the full weight."""
    leg = EXTENDED
    start = kinematics.home(EXTENDED)[::2]
    force = np.array([0.5, -1.0])
    e0 = np.array([0.05, -0.03])
    v0 = np.array([-0.4, 0.6])
    z = 0.6
    w0 = 20.0

    def wanted(t: float) -> Reference:
        theta = start + 0.1 * np.sin([5.0 * t, 7.0 * t])
        rate = 0.1 * np.cos([5.0 * t, 7.0 * t]) * [5.0, 7.0]
        return Reference(STILL, STILL, STILL, theta, rate, (start - theta) * [25, 49], force, 0.05)

    law = law_of(leg, ComputedTorque(kp=w0**2, kd=2 * z * w0), wanted)
    first = wanted(0.0)
    t = np.linspace(0.0, 0.5, 51)
    motion = dynamics.integrate(
        leg, first.theta - e0, first.theta_dot - v0, t, law,
        foot_force=lambda t, q, w: force, payload=0.05,
    )  # fmt: skip
    error = np.array([wanted(s).theta for s in t]) - motion.theta
    wd = w0 * np.sqrt(1.0 - z * z)
    swing = e0 * np.cos(wd * t)[:, None] + (v0 + z * w0 * e0) / wd * np.sin(wd * t)[:, None]
    closed = np.exp(-z * w0 * t)[:, None] * swing
    np.testing.assert_allclose(error, closed, rtol=0, atol=1e-10)  # the integrator's own


def test_impedance_gives_way_by_the_force_over_the_stiffness() -> None:
    """Under its weight and more than the expected force, from the target to rest."""
    theta = kinematics.inverse(CLASSIC, (0.005, -0.075))
    expected = np.array([0.2, 0.5])
    real = np.array([0.5, 0.9])
    law = Impedance(stiffness=(600.0, 1000.0), damping=(6.0, 6.0))
    wanted = keep(CLASSIC, theta, expected)
    motion = dynamics.simulate(
        CLASSIC, theta, STILL, 1e-3, 200, law_of(CLASSIC, law, wanted),
        foot_force=lambda t, q, w: real, every=200,
    )  # fmt: skip
    moved = kinematics.forward(CLASSIC, motion.theta[-1]) - kinematics.forward(CLASSIC, theta)
    np.testing.assert_allclose(moved, [0.3 / 600.0, 0.4 / 1000.0], rtol=0, atol=1e-12)
    held = sampled(CLASSIC, Impedance(), keep(CLASSIC, theta), theta, 0.02)
    np.testing.assert_allclose(held.theta, np.broadcast_to(theta, (21, 2)), rtol=0, atol=1e-12)


def test_leg_without_weight_floats() -> None:
    """It rests where it is; in motion it keeps its kinetic energy, or gives it to the damping."""
    theta = sample(EXTENDED, (5,))[1]
    free = GravityCompensation()
    drag = GravityCompensation(kd=1e-3)
    rest = sampled(EXTENDED, free, keep(EXTENDED, theta), theta, 0.02)
    np.testing.assert_allclose(rest.theta - theta, 0.0, rtol=0, atol=1e-12)
    ends = []
    for law in (free, drag):
        torque = law_of(EXTENDED, law, keep(EXTENDED, theta))
        motion = dynamics.simulate(EXTENDED, theta, (2.0, -1.0), 1e-4, 50, torque, every=10)
        ends.append(dynamics.energy(EXTENDED, motion.theta, motion.theta_dot).kinetic)
    np.testing.assert_allclose(ends[0], np.broadcast_to(ends[0][0], ends[0].shape), rtol=1e-9)
    assert np.all(np.diff(ends[1], axis=0) < 0.0)


# slope


def growth(leg: FiveBar, law: Law, periods: int) -> float:
    """Return by how much a tiny push at home, along both modes of M, grows in some periods."""
    home = kinematics.home(leg)[::2]
    modes = np.linalg.eigh(dynamics.mass_matrix(leg, home))[1].sum(axis=1)
    motion = sampled(leg, law, keep(leg, home), home, periods * law.period, 1e-6 * modes)
    return float(np.abs(motion.theta_dot[-2:]).max() / np.abs(motion.theta_dot[0]).max())


@pytest.mark.parametrize("T", [0.001, 0.01])
def test_held_torque_is_stable_between_the_two_bounds(T: float) -> None:
    """Between kp T / 2 and 2 m / T, m the least eigenvalue of M; computed torque has m = 1."""
    m = float(np.linalg.eigvalsh(dynamics.mass_matrix(AIRHOCKEY, HOME))[0])
    for law, m_ in ((Pd, m), (ComputedTorque, 1.0)):
        top = 2.0 * m_ / T
        kp = 0.1 * m_ / T**2
        assert growth(AIRHOCKEY, law(kp=kp, kd=0.95 * top, period=T), 30) < 0.1
        assert growth(AIRHOCKEY, law(kp=kp, kd=1.05 * top, period=T), 40) > 10.0
        kd = 0.8 * m_ / T
        assert growth(AIRHOCKEY, law(kp=0.9 * 2.0 * kd / T, kd=kd, period=T), 75) < 0.1
        assert growth(AIRHOCKEY, law(kp=1.1 * 2.0 * kd / T, kd=kd, period=T), 75) > 10.0


# oracle: figures of a leg on which published gains fail


def test_schedule_follows_at_ten_milliseconds_where_the_stiff_pd_breaks_down() -> None:
    circle = follow(AIRHOCKEY, Circle(centre=(0.0, 0.62), radius=0.12, frequency=1.0, ramp=0.5))
    start = circle(0.0).theta
    stiff = Pd(kp=150.0, kd=5.0, period=0.001)
    for derivative in ("measurement", "error"):
        slow = Pd(kp=150.0, kd=5.0, derivative=derivative, period=0.01)
        with pytest.raises(DivergedError):
            sampled(AIRHOCKEY, slow, circle, start, 0.5)
    fast = misses(AIRHOCKEY, sampled(AIRHOCKEY, stiff, circle, start, 0.5), circle)
    law = GainSchedule()
    followed = misses(AIRHOCKEY, sampled(AIRHOCKEY, law, circle, start, 1.5), circle)
    assert 0.02 < fast.max() < 0.04  # the lag kd / kp = 33 ms at 0.75 m/s
    assert followed.max() < 0.0025
    assert followed[50:].max() < 0.0015


def test_schedule_reaches_far_targets_that_its_near_gains_alone_do_not() -> None:
    """Jumps of the target between all pairs of seven places, at 10 ms."""
    feet = np.array(
        [(-0.35, 0.4), (0.35, 0.4), (0, 0.3), (0, 0.8), (-0.2, 0.75), (0.3, 0.6), (0.05, 0.62)]
    )
    theta = kinematics.inverse(AIRHOCKEY, feet)
    theta = HOME + (theta - HOME + np.pi) % (2.0 * np.pi) - np.pi
    pairs = np.array([(i, j) for i in range(7) for j in range(7) if i != j])
    starts = theta[pairs[:, 0]]
    goal = keep(AIRHOCKEY, theta[pairs[:, 1]])
    motion = sampled(AIRHOCKEY, GainSchedule(), goal, starts, 0.6)
    assert misses(AIRHOCKEY, motion, goal)[0].min() > 0.1
    assert misses(AIRHOCKEY, motion, goal)[40:].max() < 0.005
    law = GainSchedule()
    near = Pd(kp=law.kp_near, kd=law.kd_near, period=0.01)
    with pytest.raises(DivergedError):
        sampled(AIRHOCKEY, near, goal, starts, 0.6)


def test_mass_error_leaves_a_bounded_error() -> None:
    """At rest -mass_error M^-1 weight / ((1 + mass_error) kp); in motion more, yet stable."""
    theta = kinematics.inverse(CLASSIC, (0.005, -0.075))
    law = ComputedTorque(kp=4e4, kd=400.0, mass_error=0.2)
    motion = sampled(CLASSIC, law, keep(CLASSIC, theta), theta, 0.12)  # slowest: 140 / s
    end = motion.theta[-1]
    pull = np.linalg.solve(dynamics.mass_matrix(CLASSIC, end), dynamics.bias(CLASSIC, end, STILL))
    np.testing.assert_allclose(theta - end, -0.2 * pull / (1.2 * law.kp), rtol=1e-6)

    path = follow(CLASSIC, Circle(centre=(0.0, -0.072), radius=0.01, frequency=2.0, ramp=0.1))
    ideal, heavy, light = (
        misses(
            CLASSIC,
            sampled(CLASSIC, ComputedTorque(mass_error=e), path, path(0.0).theta, 0.2),
            path,
        )
        for e in (0.0, 0.2, -0.2)
    )
    assert ideal.max() < 5e-5
    for wrong in (heavy, light):
        assert 20.0 * ideal.max() < wrong[100:].max() < 7e-4
