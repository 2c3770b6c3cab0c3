"""What it costs that motors A and E work against each other: the leg beside a serial one.

The serial leg has links like L1 and BF, its hip at O, its second motor in the knee, and its knee on
A's side. It makes the same foot motion with the same force at the foot, with the same two gears and
motors. With J of the five-bar and S of the serial leg, the virtual work of the foot's force gives

    tau_s = S^T J^-T tau,     omega_s = S^-1 J omega

What the links weigh is not exchanged: the five-bar's own part of tau is carried over.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, blocks
from fivebar_sim.errors import FiveBarError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.two_link import SerialLeg


class Price(NamedTuple):
    """What the five-bar needs, as a multiple of what the serial leg does.

    Attributes:
        heat: Copper heat, sum of tau^2 of both motors; the gears' ratio cancels.
        friction: Loss of gears that lose a part of what passes through them, sum of |tau omega|.
        turning: Loss of gears with Coulomb friction, sum of |omega|.
    """

    heat: float | None
    friction: float | None
    turning: float | None


def serial_leg(leg: FiveBar) -> SerialLeg:
    """Return the serial leg with links like L1 and BF, its knee on A's side."""
    tibia = abs(leg.L2 + leg.L6 * np.exp(1j * leg.bend))
    return SerialLeg(leg.L1, float(tibia), leg.mode[0])


def price(leg: FiveBar, theta: Array, omega: Array, torque: Array) -> Price:
    """Return what the motors' antagonism costs; None where the serial leg needs nothing.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (N, 2).
        omega: Their rates [rad/s], (N, 2).
        torque: (tau_A, tau_E) [N m], (N, 2).

    Raises:
        FiveBarError: The serial leg does not reach a foot point, or a pose is open or singular.
    """
    tau_s = np.empty_like(torque)
    omega_s = np.empty_like(omega)
    for rows in blocks(len(theta)):
        tau_s[rows], omega_s[rows] = _serial(leg, theta[rows], omega[rows], torque[rows])

    return Price(
        heat=_ratio(torque**2, tau_s**2),
        friction=_ratio(np.abs(torque * omega), np.abs(tau_s * omega_s)),
        turning=_ratio(np.abs(omega), np.abs(omega_s)),
    )


def _serial(leg: FiveBar, theta: Array, omega: Array, torque: Array) -> tuple[Array, Array]:
    """Return the serial leg's torques and rates, (N, 2); see `price`."""
    serial = serial_leg(leg)
    foot = kinematics.forward(leg, theta)
    J = kinematics.jacobian(leg, theta)
    S = serial.jacobian(serial.inverse(foot))
    force = _solved(np.swapaxes(J, -1, -2), torque)
    tau_s = np.einsum("nij,ni->nj", S, force)
    return tau_s, _solved(S, np.einsum("nij,nj->ni", J, omega))


def _solved(matrix: Array, vector: Array) -> Array:
    """Return x of matrix x = vector, (N, 2)."""
    try:
        solved = np.linalg.solve(matrix, vector[..., None])[..., 0]
    except np.linalg.LinAlgError:
        raise FiveBarError("a pose of the window is singular") from None
    return np.asarray(solved, dtype=np.float64)


def _ratio(own: Array, other: Array) -> float | None:
    most = float(other.sum())
    return float(own.sum()) / most if most > 0.0 else None
