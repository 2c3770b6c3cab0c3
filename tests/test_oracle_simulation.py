"""The oracle's motions are proven here: closure, energy, power, and motions known beforehand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import oracle
import pytest
from oracle import Array, Leg
from oracle_simulation import (
    Motion,
    Pair,
    Path,
    Servo,
    Springs,
    eased_ellipse,
    knee_rates,
    simulate,
)

from fivebar_sim.geometry import FiveBar

CLASSIC = Leg.of(FiveBar())
BENT = FiveBar(L1=0.040, L2=0.066, L3=0.058, L4=0.045, L5=0.030, L6=0.020, bend=0.5, tilt=0.2)
ODD = replace(  # nothing equal, nothing on an axis: a swap or a lost sign shows
    Leg.of(BENT),
    com=(0.017 + 0.003j, 0.037 - 0.005j, 0.026 + 0.004j, 0.021 - 0.002j),
    gravity=1.5 - 9.6j,
)
LEGS = pytest.mark.parametrize("leg", [CLASSIC, ODD], ids=["classic", "odd"])
ELLIPSE = eased_ellipse((0.0, -0.072), (0.020, 0.008), 2.0, 0.25)
PLAIN = Servo(8.0, 0.05)
AHEAD = Servo(8.0, 0.05, "velocity")


def held(x: float, z: float) -> Path:
    return lambda _: ((x, z), (0.0, 0.0), (0.0, 0.0))


def positions(path: Path, times: Array) -> Array:
    return np.array([path(t)[0] for t in times.tolist()])


def tracking_rms(motion: Motion, start: float) -> float:
    error = motion.foot - positions(ELLIPSE, motion.time)
    return math.sqrt(np.mean(np.sum(error[motion.time > start] ** 2, axis=1)))


# --- law: closure, energy, power ---


@LEGS
def test_loop_stays_closed_in_its_assembly(leg: Leg) -> None:
    motion = simulate(leg, AHEAD, ELLIPSE, 0.15)
    for psi, psi_dot in zip(motion.psi.tolist(), motion.psi_dot.tolist(), strict=True):
        point = oracle.loop(leg, psi)
        assert abs(oracle.position(point)) < 1e-15  # no integration error: closed in every state
        assert abs(oracle.velocity(point[1], psi_dot)) < 1e-14
        assert oracle.assembly_of(leg, psi) == leg.assembly
    assert np.abs(motion.gap).max() < 1e-15
    np.testing.assert_array_equal(motion.psi[:, [0, 3]], motion.theta)
    assert np.abs(np.diff(motion.psi, axis=0)).max() < 0.1  # continuous, also beyond -pi
    # rates against differences of the dense output: h^2 psi''' / 6 ~ 1e-6 * 2e4 / 6
    middle = (motion.psi[2:] - motion.psi[:-2]) / 2e-3
    np.testing.assert_allclose(motion.psi_dot[1:-1], middle, rtol=0, atol=2e-2)


@LEGS
def test_knee_rates_are_those_of_the_foot_motion(leg: Leg) -> None:
    psi, w, _ = oracle.angles_of(leg, 0.004 - 0.075j, 0.2 + 0.1j, 0j)
    np.testing.assert_allclose(knee_rates(leg, psi, w[0], w[3]), w, rtol=1e-12)  # rounding


@pytest.mark.parametrize(
    ("leg", "start", "springs"),
    [  # all swing far from B on D, where the classic leg comes apart
        (CLASSIC, (0.005, -0.097), None),
        (ODD, (0.030, -0.105), None),
        (ODD, (0.010, -0.080), Springs((0.02, 0.03), (-2.4, -0.6))),
    ],
    ids=["classic", "odd", "springs"],
)
def test_free_swing_keeps_its_energy(
    leg: Leg, start: tuple[float, float], springs: Springs | None
) -> None:
    motion = simulate(leg, None, held(*start), 0.3, springs=springs)
    weightless = replace(leg, gravity=0j)
    rows = zip(motion.psi.tolist(), motion.psi_dot.tolist(), strict=True)
    kinetic = max(oracle.energy(weightless, *row) for row in rows)
    assert kinetic > 1e-5  # it does swing [J]
    # the solver's 1e-12 a step, over the 3e3 steps of 0.3 s
    assert np.ptp(motion.energy) < 1e-8 * kinetic
    np.testing.assert_array_equal(motion.tau, 0.0)


@LEGS
def test_energy_gained_is_work_done(leg: Leg) -> None:
    from scipy.integrate import simpson

    force = 0.5 + 1.0j
    times = np.linspace(0.0, 0.2, 2001)
    motion = simulate(leg, PLAIN, ELLIPSE, 0.2, times, foot_force=lambda t: force * math.sin(9 * t))
    power = np.sum(motion.tau * motion.theta_dot, axis=1)
    for i, (psi, psi_dot) in enumerate(
        zip(motion.psi.tolist(), motion.psi_dot.tolist(), strict=True)
    ):
        v = oracle.velocity(oracle.foot(leg, psi)[1], psi_dot)
        power[i] += (force.conjugate() * v).real * math.sin(9 * times[i])
    work = simpson(power, x=times)
    # 1e-3 W of power, state to 1e-10 through kp = 8: 1e-9 W; Simpson h^4 P'''' ~ 1e-16 * 1e5 W
    assert motion.energy[-1] - motion.energy[0] == pytest.approx(work, abs=1e-10)


# --- oracle: motions that are known beforehand, and the other integrator ---


@LEGS
def test_fed_back_torques_reproduce_their_motion(leg: Leg) -> None:
    def feed(leg: Leg, path: Path, t: float, theta: Pair, theta_dot: Pair) -> Pair:
        return oracle.torques(leg, *(complex(*x) for x in path(t)))

    motion = simulate(leg, feed, ELLIPSE, 0.3)
    # nothing holds the leg: errors of 1e-12 grow by up to e^(0.3 s * 20 / s) ~ 4e2
    np.testing.assert_allclose(motion.foot, positions(ELLIPSE, motion.time), rtol=0, atol=1e-9)


@LEGS
def test_servo_with_dynamics_is_exactly_on_its_path(leg: Leg) -> None:
    motion = simulate(leg, replace(PLAIN, feedforward="dynamics"), ELLIPSE, 0.4)
    psi, psi_dot, _ = oracle.motion(leg, *(np.array(x) for x in ELLIPSE(0.4)))
    # the solver's tolerance, and 4e-12 m of interpolation where the path's jerk jumps at 0.25 s
    np.testing.assert_allclose(motion.foot, positions(ELLIPSE, motion.time), rtol=0, atol=1e-11)
    turns = (motion.psi[-1] - psi) / (2 * math.pi)  # whole: theta_A of the odd leg has passed -pi
    np.testing.assert_allclose(turns, np.round(turns), rtol=0, atol=1e-11)
    np.testing.assert_allclose(motion.psi_dot[-1], psi_dot, rtol=0, atol=1e-9)
    tau = oracle.inverse_dynamics(leg, *(np.array(x) for x in ELLIPSE(0.4)))
    np.testing.assert_allclose(motion.tau[-1], tau, rtol=0, atol=1e-10)


@LEGS
def test_both_integrators_agree(leg: Leg) -> None:
    fast = simulate(leg, PLAIN, ELLIPSE, 0.04)
    slow = simulate(leg, PLAIN, ELLIPSE, 0.04, method="DOP853", rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(fast.theta, slow.theta, rtol=0, atol=1e-11)
    np.testing.assert_allclose(fast.theta_dot, slow.theta_dot, rtol=0, atol=1e-9)


def test_lag_of_the_classic_leg() -> None:
    """An independent closed-form model of this motion gave 1.19 mm, and about 15 um."""
    plain, ahead = (
        simulate(CLASSIC, servo, ELLIPSE, 0.75, rtol=1e-8, atol=1e-9) for servo in (PLAIN, AHEAD)
    )
    assert tracking_rms(plain, 0.25) == pytest.approx(1.19e-3, rel=0.01)
    assert tracking_rms(ahead, 0.25) == pytest.approx(15e-6, rel=0.03)


def test_at_rest_the_servo_sags_by_statics() -> None:
    """At rest kp (theta_ref - theta) = tau_static(theta)."""
    F = 2.0 + 5.0j
    motion = simulate(CLASSIC, PLAIN, held(0.0, -0.08), 0.2, foot_force=lambda _: F)
    rest = complex(*motion.foot[-1])
    tau = oracle.torques(CLASSIC, rest, 0j, 0j, F)
    ref = oracle.pose(CLASSIC, -0.08j)
    pull = 8.0 * (np.array([ref[0], ref[3]]) - motion.theta[-1])
    # the slowest mode decays by e^(-170 / s * 0.2 s) ~ 1e-15: only the solver's tolerance is left
    np.testing.assert_allclose(pull, tau, rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion.tau[-1], tau, rtol=0, atol=1e-9)


# --- edge ---


def test_spring_and_damper_are_limited_together() -> None:
    servo = replace(PLAIN, limit=0.1)
    psi = oracle.pose(CLASSIC, -0.07j)
    theta = (psi[0] - 1.0, psi[3] + 1.0)
    tau = servo(CLASSIC, held(0.0, -0.07), 0.0, theta, (159.0, 2.0))
    np.testing.assert_allclose(tau, (8.0 - 7.95, -0.1), rtol=1e-12)


def test_servo_does_not_care_for_whole_turns() -> None:
    path = held(0.0, -0.07)
    psi = oracle.pose(CLASSIC, -0.07j)
    theta = (psi[0] + 0.01 + 2 * math.pi, psi[3] - 0.02 - 2 * math.pi)
    tau = PLAIN(CLASSIC, path, 0.0, theta, (0.0, 0.0))
    np.testing.assert_allclose(tau, (-0.08, 0.16), rtol=1e-12)  # rounding of 2 pi


def test_ellipse_starts_at_rest_and_its_slopes_are_its_rates() -> None:
    h = 1e-5
    start = ((0.0, -0.08), (0.0, 0.0), (0.0, 0.0))
    np.testing.assert_allclose(ELLIPSE(0.0), start, rtol=0, atol=1e-16)
    for t in (0.03, 0.11, 0.2499, 0.25, 0.2501, 0.6):
        (p0, v0, _), (_, v, a), (p1, v1, _) = (ELLIPSE(s) for s in (t - h, t, t + h))
        # h^2 p''' / 6 ~ 1e-10 * 1e3 / 6; at 0.25 s the jerk jumps: h p''' ~ 1e-5 * 1e3
        np.testing.assert_allclose(np.subtract(p1, p0) / (2 * h), v, rtol=0, atol=1e-7)
        np.testing.assert_allclose(np.subtract(v1, v0) / (2 * h), a, rtol=0, atol=1e-2)


# --- refusal ---


def test_the_other_assembly_is_refused() -> None:
    with pytest.raises(ValueError, match=r"path\(0\) is in assembly -1, the leg in 1"):
        simulate(replace(CLASSIC, assembly=1), PLAIN, ELLIPSE, 0.1)


def test_a_path_out_of_the_workspace_is_refused() -> None:
    with pytest.raises(ValueError, match="the circles never cross"):
        simulate(CLASSIC, PLAIN, eased_ellipse((0.0, -0.09), (0.0, 0.03), 2.0, 0.0), 0.5)


def test_an_unknown_feedforward_is_refused() -> None:
    with pytest.raises(ValueError, match=r"must be one of .*, got 'speed'"):
        Servo(1.0, 1.0, "speed")
