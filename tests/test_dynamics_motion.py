"""Motions: energy kept, order of convergence, the oracle's motion, break-downs and refusals."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import oracle
import oracle_simulation
import pytest
from poses import BATCHES

from fivebar_sim import dynamics, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import (
    ArgumentError,
    DivergedError,
    ExtraError,
    LoopOpenError,
    SingularError,
)
from fivebar_sim.geometry import FiveBar

LEG = FiveBar.load("classic")
SLACK = kinematics.inverse(LEG, (0.0, -0.080))
START = kinematics.inverse(LEG, (0.005, -0.078))
STIFFNESS = 0.5
"""Of springs at A and E that are slack at SLACK [N m/rad]."""
STILL = (0.0, 0.0)
Ask = Callable[[], Any]


def springs(t: float, theta: Array, theta_dot: Array) -> Array:
    return STIFFNESS * (SLACK - theta)


def total(motion: dynamics.Motion) -> Array:
    """Return the energy of leg and springs [J]."""
    stored = 0.5 * STIFFNESS * np.sum((motion.theta - SLACK) ** 2, axis=-1)
    return np.sum(dynamics.energy(LEG, motion.theta, motion.theta_dot), axis=0) + stored


# law


@pytest.mark.parametrize("seconds", [0.4, pytest.param(10.0, marks=pytest.mark.long)])
def test_springs_keep_the_energy_for_seconds(seconds: float) -> None:
    times = np.linspace(0.0, seconds, 1001)
    motion = dynamics.integrate(LEG, START, STILL, times, springs)
    energy = total(motion)
    swing = dynamics.energy(LEG, motion.theta, motion.theta_dot).kinetic.max()
    assert swing > 4e-3
    assert np.abs(energy - energy[0]).max() < 1e-10 * swing  # asked: 1e-8; measured: 7e-12


def test_foot_force_and_torque_do_the_work() -> None:
    """Over 50 ms; the work by Simpson's rule on the same rows, error h^4 P'''' / 180 of each."""
    h = 1e-4
    load = 0.1
    leg = FiveBar.load("extended")
    theta = kinematics.home(leg)[::2]
    force = np.array([0.2, 0.5])
    torque = np.array([0.004, -0.003])
    motion = dynamics.simulate(
        leg, theta, STILL, h, 500, lambda t, q, w: torque * math.cos(40.0 * t),
        foot_force=lambda t, q, w: force, payload=load,
    )  # fmt: skip
    v = np.einsum("...ij,...j->...i", kinematics.jacobian(leg, motion.theta), motion.theta_dot)
    tau = torque * np.cos(40.0 * motion.time)[:, None]
    power = np.sum(tau * motion.theta_dot, -1) + np.sum(force * v, -1)
    work = h / 3.0 * (power[:-2:2] + 4.0 * power[1:-1:2] + power[2::2]).sum()
    energy = np.sum(dynamics.energy(leg, motion.theta, motion.theta_dot, payload=load), axis=0)
    assert abs(energy[-1] - energy[0]) > 1e-4
    assert energy[-1] - energy[0] == pytest.approx(work, rel=1e-8)


# slope


def test_runge_kutta_is_of_order_four() -> None:
    end = 0.03
    truth = dynamics.integrate(LEG, START, STILL, (0.0, end), springs).theta[-1]
    errors = []
    for steps in (60, 120, 240):
        theta = dynamics.simulate(LEG, START, STILL, end / steps, steps, springs).theta[-1]
        errors.append(float(np.abs(theta - truth).max()))
    assert errors[0] < 1e-3
    ratios = np.array(errors[:-1]) / errors[1:]
    np.testing.assert_allclose(ratios, 16.0, rtol=0.15)  # 16 (1 + O(h)), h omega is 0.1


# oracle


def test_motion_is_the_oracles() -> None:
    times = np.linspace(0.0, 0.3, 31)
    held = oracle_simulation.Springs((STIFFNESS, STIFFNESS), (float(SLACK[0]), float(SLACK[1])))
    path = oracle_simulation.eased_ellipse((0.005, -0.078), (0.0, 0.0), 1.0, 0.0)
    force = (0.03, 0.05)
    truth = oracle_simulation.simulate(
        oracle.Leg.of(LEG), None, path, 0.3, times,
        foot_force=lambda t: complex(*force), springs=held, method="DOP853",
    )  # fmt: skip
    found = dynamics.integrate(LEG, START, STILL, times, springs, foot_force=lambda t, q, w: force)
    np.testing.assert_allclose(found.time, truth.time, rtol=0, atol=0)
    np.testing.assert_allclose(found.theta, truth.theta, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.theta_dot, truth.theta_dot, rtol=0, atol=1e-8)


@pytest.mark.parametrize("batch", BATCHES)
def test_batch_is_a_plain_loop_to_the_last_bit(
    batch: tuple[int, ...], rng: np.random.Generator
) -> None:
    theta = START + rng.uniform(-0.05, 0.05, (*batch, 2))
    motion = dynamics.simulate(LEG, theta, STILL, 5e-4, 40, springs, every=4)
    assert motion.theta.shape == motion.theta_dot.shape == (11, *batch, 2)
    np.testing.assert_array_equal(motion.time, 5e-4 * np.arange(0, 41, 4))
    for index in np.ndindex(batch):
        alone = dynamics.simulate(LEG, theta[index], STILL, 5e-4, 40, springs)
        np.testing.assert_array_equal(motion.theta[:, *index], alone.theta[::4])
        np.testing.assert_array_equal(motion.theta_dot[:, *index], alone.theta_dot[::4])


# edge


def test_balanced_leg_stays() -> None:
    theta = SLACK
    hold = dynamics.bias(LEG, SLACK, STILL)
    motion = dynamics.simulate(LEG, theta, STILL, 1e-3, 20, lambda t, q, w: hold)
    np.testing.assert_allclose(motion.theta, np.broadcast_to(theta, (21, 2)), rtol=0, atol=1e-14)


def test_free_motors_and_a_remainder_of_steps() -> None:
    still = replace(LEG, gravity=(0.0, 0.0))
    motion = dynamics.simulate(still, START, STILL, 1e-3, 10, every=4)
    np.testing.assert_array_equal(motion.time, 1e-3 * np.array([0, 4, 8]))
    np.testing.assert_array_equal(motion.theta, np.broadcast_to(START, (3, 2)))


def test_results_are_the_callers_own() -> None:
    times = np.array([0.0, 0.01])
    motion = dynamics.integrate(LEG, START, STILL, times, springs)
    times[:] = 9.0
    assert motion.time[-1] == 0.01
    assert motion.theta.base is None


# refusal


def test_motion_into_a_singular_pose_says_when() -> None:
    apart = (40.0, -40.0)  # free, the knees fly until B, C and D are in line
    with pytest.raises(DivergedError, match=r"down at t = 0\.0\d+ s: no step is short") as fine:
        dynamics.integrate(LEG, START, apart, (0.0, 5.0), rtol=1e-9, atol=1e-10)
    with pytest.raises(DivergedError, match=r"down at t = 0\.0\d+ s: .* at index \(1,\)") as fixed:
        dynamics.simulate(LEG, [SLACK, START], [STILL, apart], 2e-4, 25_000)
    assert fixed.value.time == pytest.approx(fine.value.time, abs=4e-4)  # two steps


def test_step_that_is_far_too_long_is_refused() -> None:
    with pytest.raises(DivergedError, match=r"t = 0 s: a motor must turn by less than 0\.5 rad"):
        dynamics.simulate(LEG, START, (1.0, 1.0), 0.6, 1, lambda t, q, w: -1e-4 * w)


def test_links_too_light_for_any_number_end_the_motion() -> None:
    four = (1e-200,) * 4
    leg = replace(LEG, mass=four, com=(0.01,) * 4, inertia=four, armature=0.0)
    with pytest.raises(DivergedError, match=r"t = 0 s: the links are too light"):
        dynamics.integrate(leg, START, STILL, [0.0, 0.1])


def test_start_that_cannot_be_keeps_its_own_error() -> None:
    line = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)
    law = springs
    asks: list[Callable[[FiveBar, tuple[float, float]], Any]] = [
        lambda leg, theta: dynamics.simulate(leg, theta, STILL, 1e-3, 3, law),
        lambda leg, theta: dynamics.integrate(leg, theta, STILL, (0.0, 1.0), law),
    ]
    for ask in asks:
        with pytest.raises(SingularError):
            ask(line, (math.pi, 0.0))
        with pytest.raises(LoopOpenError):
            ask(FiveBar(0.03, 0.04, 0.04, 0.03, 0.06), (math.pi, 0.0))


def test_law_without_a_number_ends_the_motion() -> None:
    def late(t: float, theta: Array, theta_dot: Array) -> Array:
        return np.full_like(theta, math.nan if t > 0.0045 else 0.0)

    with pytest.raises(DivergedError, match=r"t = 0\.004 s: torque is not finite") as info:
        dynamics.simulate(LEG, START, STILL, 1e-3, 10, late)
    assert info.value.time == 0.004
    with pytest.raises(DivergedError, match="foot_force is not finite"):
        dynamics.integrate(LEG, START, STILL, (0.0, 0.01), foot_force=late)


def test_precision_without_scipy_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.integrate", None)
    with pytest.raises(ExtraError, match=r"needs SciPy .*: pip install 'fivebar-sim\[precise\]'"):
        dynamics.integrate(LEG, START, STILL, (0.0, 0.01))


def test_bad_arguments_are_refused() -> None:
    def three(t: float, theta: Array, theta_dot: Array) -> list[float]:
        return [1.0, 2.0, 3.0]

    def many(t: float, theta: Array, theta_dot: Array) -> Array:
        return np.zeros((5, 2))

    simulate = dynamics.simulate
    integrate = dynamics.integrate
    asks: list[tuple[str, Ask]] = [
        ("timestep must be in", lambda: simulate(LEG, START, STILL, 0.0, 3)),
        ("timestep must be in", lambda: simulate(LEG, START, STILL, math.nan, 3)),
        ("steps must be a whole", lambda: simulate(LEG, START, STILL, 1e-3, 0)),
        ("steps must be a whole", lambda: simulate(LEG, START, STILL, 1e-3, 2.5)),  # pyright: ignore[reportArgumentType]
        ("every must be", lambda: simulate(LEG, START, STILL, 1e-3, 3, every=0)),
        ("torque must have shape", lambda: simulate(LEG, START, STILL, 1e-3, 3, three)),
        ("torque must give shape", lambda: simulate(LEG, START, STILL, 1e-3, 3, many)),
        ("foot_force must", lambda: integrate(LEG, START, STILL, (0, 1), foot_force=many)),
        ("theta must be finite", lambda: simulate(LEG, (0.0, math.inf), STILL, 1e-3, 3)),
        ("theta_dot must be finite", lambda: integrate(LEG, START, (0, math.nan), (0, 1))),
        ("one leg", lambda: integrate(LEG, [START, START], STILL, (0, 1))),
        ("times must rise", lambda: integrate(LEG, START, STILL, (0.0, 0.0))),
        ("times must rise", lambda: integrate(LEG, START, STILL, (0.0,))),
        ("times must be finite", lambda: integrate(LEG, START, STILL, (0.0, math.inf))),
        ("rtol must be", lambda: integrate(LEG, START, STILL, (0, 1), rtol=0.0)),
        ("atol must be", lambda: integrate(LEG, START, STILL, (0, 1), atol=-1.0)),
        ("payload must be", lambda: simulate(LEG, START, STILL, 1e-3, 3, payload=-1.0)),
    ]
    for message, ask in asks:
        with pytest.raises(ArgumentError, match=message):
            ask()
