"""The price of antagonistic motors: the five-bar beside a serial leg with the same foot."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim import dynamics, kinematics
from fivebar_sim.dynamics import antagonism
from fivebar_sim.errors import FiveBarError, UnreachableError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.two_link import SerialLeg
from fivebar_sim.metrics import load

CLASSIC = FiveBar.load("classic")
LEGS = [CLASSIC, FiveBar.load("extended")]


def moving(leg: FiveBar, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Return poses, foot rates, foot forces, and rates and torques of A and E."""
    foot = rng.uniform([-0.015, -0.085], [0.015, -0.070], (20, 2))
    foot_dot = rng.normal(size=(20, 2))
    force = rng.normal(size=(20, 2))
    theta = kinematics.inverse(leg, foot)
    J = kinematics.jacobian(leg, theta)
    omega = np.linalg.solve(J, foot_dot[..., None])[..., 0]
    return foot, foot_dot, force, theta, omega, dynamics.statics(leg, theta, force)


@pytest.mark.parametrize("leg", LEGS, ids=["classic", "extended"])
def test_it_is_the_serial_leg_that_holds_the_same_force(
    leg: FiveBar, rng: np.random.Generator
) -> None:
    foot, foot_dot, force, theta, omega, torque = moving(leg, rng)
    other = SerialLeg(leg.L1, float(abs(leg.L2 + leg.L6 * np.exp(1j * leg.bend))), leg.mode[0])
    q = other.inverse(foot)
    tau = other.static_torques(q, force)
    rate = np.linalg.solve(other.jacobian(q), foot_dot[..., None])[..., 0]

    found = antagonism.price(leg, theta, omega, torque)
    assert found.heat == pytest.approx(np.sum(torque**2) / np.sum(tau**2), rel=1e-9)
    gears = np.abs(torque * omega).sum() / np.abs(tau * rate).sum()
    assert found.friction == pytest.approx(gears, rel=1e-9)
    assert found.turning == pytest.approx(np.abs(omega).sum() / np.abs(rate).sum(), rel=1e-9)


def test_what_no_serial_leg_does_has_no_price(rng: np.random.Generator) -> None:
    _, _, _, theta, omega, torque = moving(CLASSIC, rng)
    still = antagonism.price(CLASSIC, theta, 0.0 * omega, torque)
    assert still.heat is not None
    assert (still.friction, still.turning) == (None, None)
    assert antagonism.price(CLASSIC, theta, omega, 0.0 * torque).heat is None


def test_a_foot_in_the_serial_legs_hip_is_refused() -> None:
    """Any knee fits."""
    none = np.zeros(1)
    with pytest.raises(FiveBarError, match="hip"):
        antagonism._tibia(SerialLeg(0.05, 0.05), (none, none))


def test_a_foot_out_of_the_serial_legs_reach_is_not_compared() -> None:
    wide = FiveBar(L1=0.03, L2=0.03, L3=0.09, L4=0.09, L5=0.06)
    theta = kinematics.inverse(wide, np.array([[-0.05, -0.052]]))
    none = np.zeros((1, 2))
    with pytest.raises(UnreachableError):
        antagonism.price(wide, theta, none, none)
    pairs = {"theta": theta, "theta_dot": none, "torque": none}
    record = {f"{name}_{m}": pair[:, k] for name, pair in pairs.items() for k, m in enumerate("AE")}
    assert load.serial(wide, record, slice(None)) == (None, None, None)
