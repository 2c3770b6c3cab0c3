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
from fivebar_sim.dynamics.chain import Chain
from fivebar_sim.dynamics.plane import placed
from fivebar_sim.errors import FiveBarError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.planar import cross, dot, perp
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
    serial = serial_leg(leg)
    chain = Chain.of(leg, None, 0.0)
    tau_s = np.empty_like(torque)
    omega_s = np.empty_like(omega)
    for rows in blocks(len(theta)):
        tau_s[rows], omega_s[rows] = _serial(serial, chain, theta[rows], omega[rows], torque[rows])

    return Price(
        heat=_ratio(torque**2, tau_s**2),
        friction=_ratio(np.abs(torque * omega), np.abs(tau_s * omega_s)),
        turning=_ratio(np.abs(omega), np.abs(omega_s)),
    )


def _serial(
    serial: SerialLeg, chain: Chain, theta: Array, omega: Array, torque: Array
) -> tuple[Array, Array]:
    """Return the serial leg's torques and rates, (N, 2); see `price`."""
    leg = chain.leg
    pose = chain.pose(theta[:, 0], theta[:, 1])
    AB = np.stack(pose.e1, axis=-1) * leg.L1
    BF = np.stack(placed(pose.e2, leg.foot_offset), axis=-1)
    by_A = perp(AB) + pose.a2[:, None] * perp(BF)
    by_E = pose.b2[:, None] * perp(BF)
    # J^T f = tau, so that J's columns are the rows.
    force = _solved(by_A, by_E, torque)
    S = serial.jacobian(serial.inverse(kinematics.bases(leg)[0] + AB + BF))
    hip = S[..., 0]
    knee = S[..., 1]
    tau_s = np.stack([dot(hip, force), dot(knee, force)], axis=-1)
    speed = by_A * omega[:, :1] + by_E * omega[:, 1:]
    return tau_s, _solved(S[:, 0], S[:, 1], speed)


def _solved(first: Array, second: Array, right: Array) -> Array:
    """Return x of first . x = right_1 and second . x = right_2, (N, 2)."""
    # By Cramer's rule, in a tenth of the time that LAPACK takes for so small matrices.
    det = cross(first, second)
    if not det.all():
        raise FiveBarError("a pose of the window is singular")
    x = right[:, 0] * second[:, 1] - right[:, 1] * first[:, 1]
    z = first[:, 0] * right[:, 1] - second[:, 0] * right[:, 0]
    return np.stack([x / det, z / det], axis=-1)


def _ratio(own: Array, other: Array) -> float | None:
    most = float(other.sum())
    return float(own.sum()) / most if most > 0.0 else None
