"""The foot's motion from the motors': what `rates.joint_motion` is, the other way round."""

from __future__ import annotations

from typing import NamedTuple

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import bases, closed_points
from fivebar_sim.kinematics.planar import cross, dot, perp
from fivebar_sim.kinematics.rates import check_sine


class FootMotion(NamedTuple):
    """The foot over time, hip frame, each (..., 2).

    Attributes:
        foot: F [m].
        foot_dot: [m/s].
        foot_ddot: [m/s^2].
    """

    foot: Array
    foot_dot: Array
    foot_ddot: Array


def foot_motion(leg: FiveBar, theta: Array, theta_dot: Array, theta_ddot: Array) -> FootMotion:
    """Return the foot's motion at given motor angles and rates; F as `forward` gives it.

    With psi_2 and psi_3 the directions of L2 and L3, both chains bring C the same velocity and
    acceleration, which with m = BC x DC gives

        psi_2_dot = (D_dot - B_dot) . DC / m,   psi_3_dot = (D_dot - B_dot) . BC / m
        psi_2_ddot = (D_ddot - DC psi_3_dot^2 - B_ddot + BC psi_2_dot^2) . DC / m
        F_dot = B_dot + perp(BF) psi_2_dot
        F_ddot = B_ddot + perp(BF) psi_2_ddot - BF psi_2_dot^2

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        theta_dot: [rad/s], (..., 2).
        theta_ddot: [rad/s^2], (..., 2).

    Raises:
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line, so the foot's velocity is infinite.
    """
    A, E = bases(leg)
    p = closed_points(leg, theta)
    BC = p.C_left - p.B
    DC = p.C_right - p.D
    BF = p.F - p.B
    m = cross(BC, DC)
    check_sine(m / (leg.L2 * leg.L3), "B, C and D are in line")

    B_dot, B_ddot = _end(p.B - A, theta_dot[..., 0], theta_ddot[..., 0])
    D_dot, D_ddot = _end(p.D - E, theta_dot[..., 1], theta_ddot[..., 1])
    apart = D_dot - B_dot
    psi_2_dot = dot(apart, DC) / m
    psi_3_dot = dot(apart, BC) / m

    turning = D_ddot - DC * (psi_3_dot**2)[..., None] - B_ddot + BC * (psi_2_dot**2)[..., None]
    psi_2_ddot = dot(turning, DC) / m
    F_dot = B_dot + perp(BF) * psi_2_dot[..., None]
    F_ddot = B_ddot + perp(BF) * psi_2_ddot[..., None] - BF * (psi_2_dot**2)[..., None]
    return FootMotion(p.F, F_dot, F_ddot)


def _end(crank: Array, rate: Array, accel: Array) -> tuple[Array, Array]:
    """Return velocity and acceleration of the end of a crank."""
    velocity = perp(crank) * rate[..., None]
    return velocity, perp(crank) * accel[..., None] - crank * (rate**2)[..., None]
