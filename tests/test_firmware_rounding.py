"""`controller.arithmetic = "float32"`: the setpoints of a run are the firmware's, bit for bit."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from fivebar_controllers.servo import Servo as Law

from fivebar_sim import firmware, motion
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import GeometryError, UnreachableError
from fivebar_sim.firmware.accuracy import inverse_bound
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.kinematics import forward, inverse
from fivebar_sim.metrics.columns import MOTOR_JOINTS
from fivebar_sim.paths import Ellipse

STEP = 1e-3
CLASSIC = FiveBar.load("classic")
SERVO = Servo()
Feedforward = Literal["none", "velocity", "torque"]


def planned(leg: FiveBar = CLASSIC) -> motion.Motion:
    x, z = forward(leg, inverse(leg, (0.0, -0.072))).tolist()
    path = Ellipse(centre=(x, z), radii=(0.02, 0.008), frequency=2.0, ramp=0.1)
    return motion.plan(leg, path, 400, STEP)


def test_the_setpoints_are_the_firmwares_bits() -> None:
    wanted = planned()
    u = Law(arithmetic="float32").setpoints(CLASSIC, SERVO, wanted, "discrete")
    theta, status = firmware.inverse(firmware.of(CLASSIC), wanted.foot[1:], *CLASSIC.mode)
    assert not status.any()
    # In double there is room for the whole turns of the plan, and for less than a rounding of it.
    turns = np.round((u - theta) / (2.0 * np.pi)) * 2.0 * np.pi
    np.testing.assert_allclose(u - turns, theta, rtol=0, atol=1e-14)
    exact = Law().setpoints(CLASSIC, SERVO, wanted, "discrete")
    assert (u != exact).any(axis=1).mean() > 0.9
    np.testing.assert_array_equal(exact, wanted.q[1:][:, MOTOR_JOINTS])


def test_what_is_sent_puts_the_foot_within_the_bound() -> None:
    wanted = planned()
    u = Law(arithmetic="float32").setpoints(CLASSIC, SERVO, wanted, "discrete")
    off = np.hypot(*(forward(CLASSIC, u) - wanted.foot[1:]).T)
    assert (off < inverse_bound(CLASSIC, u)).all()
    assert off.max() > 1e-10


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
@pytest.mark.parametrize("feedforward", ["none", "velocity", "torque"])
def test_every_law_differs_by_the_rounding_alone(
    feedforward: Feedforward, integrator: Integrator
) -> None:
    wanted = planned()
    exact = Law(feedforward=feedforward).setpoints(CLASSIC, SERVO, wanted, integrator)
    law = Law(feedforward=feedforward, arithmetic="float32")
    u = law.setpoints(CLASSIC, SERVO, wanted, integrator)
    # A float's pi is off by 1e-7; the rate has two of them over a step.
    most = 1e-6 * (1.0 if feedforward == "none" else 1.0 + 2.0 * SERVO.damping / SERVO.kp / STEP)
    assert 0.0 < np.abs(u - exact).max() < most


def test_rounding_is_within_half_a_turn_of_any_angle() -> None:
    foot = np.array([0.01, -0.075])
    theta = inverse(CLASSIC, foot)
    one = firmware.rounding(CLASSIC, foot, theta)
    other = firmware.rounding(CLASSIC, foot, theta + np.array([2.0, -4.0]) * np.pi)
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-14)
    assert 0.0 < np.abs(one).max() < 1e-6


def test_what_float_cannot_do_is_one_line() -> None:
    with pytest.raises(UnreachableError, match=r"in float32 .* \(0.5, 0\) m at index \(1,\): stat"):
        firmware.rounding(CLASSIC, [(0.0, -0.07), (0.5, 0.0)], np.zeros((2, 2)))
    tiny = FiveBar(L1=2e-5, L2=4e-5, L3=4e-5, L4=2e-5, L5=1e-5, scale="any")
    with pytest.raises(GeometryError, match="the firmware cannot hold the leg custom"):
        firmware.rounding(tiny, (0.0, -5e-5), np.zeros(2))
