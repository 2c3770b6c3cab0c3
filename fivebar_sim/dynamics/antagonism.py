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
from fivebar_sim.dynamics.chain import Chain, kept
from fivebar_sim.dynamics.plane import Vector, cross, dot, placed, split
from fivebar_sim.errors import FiveBarError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.reach import reaches
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
    chain = kept(leg, None, 0.0)
    own = np.zeros(3)
    other = np.zeros(3)
    for rows in blocks(len(theta)):
        tau = split(torque[rows])
        w = split(omega[rows])
        own += _needs(tau, w)
        other += _needs(*_serial(serial, chain, split(theta[rows]), w, tau))

    ratios = zip(own.tolist(), other.tolist(), strict=True)
    return Price(*(needs / most if most > 0.0 else None for needs, most in ratios))


def _needs(tau: Vector, w: Vector) -> Array:
    """Return the sums of tau^2, |tau omega| and |omega| of both motors, (3,)."""
    sums = [
        [np.dot(t, t), np.abs(t * rate).sum(), np.abs(rate).sum()]
        for t, rate in zip(tau, w, strict=True)
    ]
    return np.sum(sums, axis=0)


def _serial(
    serial: SerialLeg, chain: Chain, theta: Vector, w: Vector, tau: Vector
) -> tuple[Vector, Vector]:
    """Return the torques and the rates of the serial leg's hip and knee; see `price`.

    J's columns are perp(AB) + a2 perp(BF) and b2 perp(BF), S's perp(OF) and perp(KF), K the knee.
    """
    leg = chain.leg
    pose = chain.pose(*theta)
    AB = leg.L1 * pose.e1[0], leg.L1 * pose.e1[1]
    BF = placed(pose.e2, leg.foot_offset)
    A = kinematics.bases(leg)[0].tolist()
    OF = A[0] + AB[0] + BF[0], A[1] + AB[1] + BF[1]
    KF = _tibia(serial, OF)
    det = cross(AB, BF)
    det_s = cross(OF, KF)
    if not (det.all() and pose.b2.all() and det_s.all()):
        raise FiveBarError("a pose of the window is singular")

    # J^T f = tau are the torques of f about A and B, and J omega turns L1 and L2.
    about_B = tau[1] / pose.b2
    about_A = (tau[0] - pose.a2 * about_B) / det
    about_B /= det
    f = about_A * BF[0] - about_B * AB[0], about_A * BF[1] - about_B * AB[1]
    w2 = pose.a2 * w[0] + pose.b2 * w[1]
    # perp(v): the velocity of F, turned back by a quarter.
    v = AB[0] * w[0] + BF[0] * w2, AB[1] * w[0] + BF[1] * w2
    rates = cross(v, KF) / det_s, cross(OF, v) / det_s
    return (cross(OF, f), cross(KF, f)), rates


def _tibia(serial: SerialLeg, OF: Vector) -> Vector:
    """Return the vector from the serial leg's knee to its foot, for the vector from its hip.

    The law of cosines as in `kinematics.reach.side_angle`, without the angle.
    """
    x, z = OF
    d2 = dot(OF, OF)
    if not d2.all():
        raise FiveBarError("the foot is in the serial leg's hip in a pose of the window")
    if not reaches(d2, serial.L1, serial.L2).all():
        # Says which point, and how far it may be.
        serial.inverse(np.stack(OF, axis=-1))
    longer = serial.L1 + serial.L2
    shorter = serial.L1 - serial.L2
    along = 0.5 - 0.5 * shorter * longer / d2
    root = np.sqrt(np.maximum((longer**2 - d2) * (d2 - shorter**2), 0.0))
    across = 0.5 * serial.knee * root / d2
    return along * x + across * z, along * z - across * x
