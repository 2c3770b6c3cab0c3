"""Joint PD with a gain for the leg's direction and one for its opening, as the Doggo has it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fivebar_controllers.pd import Pd

from fivebar_sim import Scenario
from fivebar_sim.arrays import Array
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import FiveBar

LEG = FiveBar.load("doggo")


def command(law: Pd, error: Any, rate: Any, time: float = 0.0) -> Array:
    """Return the torques of a law for errors of A and E [rad] and rates [rad/s] at a time [s]."""
    zero = np.zeros_like(error)
    seen = Observation(time, zero - error, np.asarray(rate))
    return law.command(LEG, Servo(), seen, Reference(*[zero] * 7, payload=0.0))


def test_each_gain_acts_on_its_own_angle(rng: np.random.Generator) -> None:
    """Virtual work: both torques together turn the leg, half their difference opens it."""
    law = Pd(kp=80.0, kd=0.5, kp_opening=50.0, kd_opening=0.2)
    error = rng.uniform(-1.0, 1.0, (5, 3, 2))
    rate = rng.uniform(-9.0, 9.0, (5, 3, 2))
    torque = command(law, error, rate)
    A = torque[..., 0]
    E = torque[..., 1]
    theta, theta_dot = [0.5 * pair.sum(axis=-1) for pair in (error, rate)]
    gamma, gamma_dot = [0.5 * (pair[..., 0] - pair[..., 1]) for pair in (error, rate)]
    np.testing.assert_allclose(0.5 * (A + E), 80.0 * theta - 0.5 * theta_dot, atol=1e-12)
    np.testing.assert_allclose(0.5 * (A - E), 50.0 * gamma - 0.2 * gamma_dot, atol=1e-12)


def test_equal_gains_are_those_of_each_motor(rng: np.random.Generator) -> None:
    error = rng.uniform(-1.0, 1.0, (7, 2))
    rate = rng.uniform(-9.0, 9.0, (7, 2))
    both = command(Pd(kp=3.0, kd=0.1, kp_opening=3.0, kd_opening=0.1), error, rate)
    np.testing.assert_allclose(both, command(Pd(kp=3.0, kd=0.1), error, rate), atol=1e-14)


def test_negative_gain_is_refused() -> None:
    with pytest.raises(ArgumentError, match=r"kp_opening must be in \[0, inf\) N m/rad, got -1"):
        Pd(kp_opening=-1.0)


def test_shipped_doggo_gets_the_currents_of_its_firmware(rng: np.random.Generator) -> None:
    """controller.cpp in Nate711/ODrive, in its own words; 0.084 N m/A makes its amperes torques."""
    scenario = Scenario.load("robot-doggo-trot")
    error = rng.uniform(-1.0, 1.0, 2)
    rate = rng.uniform(-9.0, 9.0, 2)
    alpha, beta = error
    d_alpha, d_beta = rate
    tau_theta = 80.0 * (alpha / 2.0 + beta / 2.0) - 0.5 * (d_alpha / 2.0 + d_beta / 2.0)
    tau_gamma = 50.0 * (alpha / 2.0 - beta / 2.0) - 0.5 * (d_alpha / 2.0 - d_beta / 2.0)
    amperes = [tau_theta * 0.5 + tau_gamma * 0.5, tau_theta * 0.5 - tau_gamma * 0.5]

    law = scenario.controller
    assert isinstance(law, Pd)
    np.testing.assert_allclose(command(law, error, rate), 0.084 * np.array(amperes), atol=1e-12)
    assert scenario.servo.limit == pytest.approx(0.084 * 50.0)


def test_each_part_of_a_run_has_its_gains(rng: np.random.Generator) -> None:
    """At any time a list of gains is the law with the numbers of that part."""
    seconds = (0.5, 0.8)
    law = Pd(kp=(2.0, 9.0, 3.0), kd=0.1, kp_opening=(1.0, 7.0, 2.0), seconds=seconds)
    error = rng.uniform(-1.0, 1.0, (4, 2))
    rate = rng.uniform(-9.0, 9.0, (4, 2))
    for time, kp, kp_opening in ((0.0, 2.0, 1.0), (0.5, 9.0, 7.0), (1.299, 9.0, 7.0), (5, 3.0, 2)):
        alone = Pd(kp=kp, kd=0.1, kp_opening=kp_opening)
        found = command(law, error, rate, time)
        np.testing.assert_array_equal(found, command(alone, error, rate))


def test_gains_that_do_not_fit_the_parts_are_refused() -> None:
    with pytest.raises(ArgumentError, match=r"kd must be a number or a list of 2, .* got 3"):
        Pd(kd=(0.1, 0.2, 0.3), seconds=(0.5,))
    with pytest.raises(ArgumentError, match=r"kp must be in \[0, inf\) N m/rad, got -1"):
        Pd(kp=(0.1, -1.0), seconds=(0.5,))
    with pytest.raises(ArgumentError, match=r"seconds must be in \(0, inf\) s, got 0"):
        Pd(seconds=(0.0,))
