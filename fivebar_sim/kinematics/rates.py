"""Velocities and accelerations: the foot Jacobian, and joint motion along a foot path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, as_pairs, at, broadcast, finite, first_index
from fivebar_sim.errors import SingularError
from fivebar_sim.geometry import FiveBar, Mode
from fivebar_sim.kinematics.closure import bases, corners
from fivebar_sim.kinematics.planar import (
    Scalar,
    angle_between,
    between,
    cross,
    dot,
    joined,
    perp,
    turned,
    unit,
)
from fivebar_sim.kinematics.reach import foot_radius_and_angle, inverse

SINGULAR = float(16 * np.sqrt(np.finfo(float).eps))
"""Sine of the angle between two links below which rounding decides the answer: when links are in
line, the computed sine is the square root of several rounding errors."""


class JointMotion(NamedTuple):
    """Joint angles along a foot path, and their time derivatives.

    Attributes:
        q: (theta_A, theta_B, theta_E, theta_D) [rad], each in (-pi, pi], (..., 4).
        q_dot: [rad/s], (..., 4).
        q_ddot: [rad/s^2], (..., 4).
    """

    q: Array
    q_dot: Array
    q_ddot: Array


def jacobian(leg: FiveBar, theta: ArrayLike, assembly: int | None = None) -> Array:
    """Return d foot / d theta of closed poses.

    C moves so that L2 and L3 keep their lengths: BC . C_dot = BC . B_dot, DC . C_dot = DC . D_dot.

        d C / d theta_A = (AB x BC) / (BC x DC) (DC_z, -DC_x)
        d C / d theta_E = (ED x DC) / (BC x DC) (-BC_z, BC_x)
        d F = d C + perp(CF) d psi_2,   d psi_2 = BC x (d C - d B) / L2^2

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        J [m/rad], (..., 2, 2): J[..., i, j] = d F_i / d theta_j.

    Raises:
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line (BC x DC = 0), so the foot's velocity is infinite.
    """
    return foot_and_jacobian(leg, theta, assembly)[1]


def foot_and_jacobian(
    leg: FiveBar, theta: ArrayLike, assembly: int | None = None
) -> tuple[Array, Array]:
    """Return what `forward` and `jacobian` do, in less time than both.

    Raises:
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line.
    """
    theta = as_pairs(theta, "theta")
    p = corners(leg, theta, assembly)
    AB = between(p.A, p.B)
    ED = between(p.E, p.D)
    BC = between(p.B, p.C)
    DC = between(p.D, p.C)
    # At m = 0 the two circles about B and D touch, and C can leave both ways.
    m = BC[0] * DC[1] - BC[1] * DC[0]
    check_sine(m / (leg.L2 * leg.L3), "B, C and D are in line", theta.shape[:-1])

    by_A = (AB[0] * BC[1] - AB[1] * BC[0]) / m
    by_E = (ED[0] * DC[1] - ED[1] * DC[0]) / m
    dC_A = by_A * DC[1], -by_A * DC[0]
    dC_E = -by_E * BC[1], by_E * BC[0]
    # Beyond C the foot is carried along by the turn of L2.
    psi_A = (BC[0] * (dC_A[1] - AB[0]) - BC[1] * (dC_A[0] + AB[1])) / leg.L2**2
    psi_E = (BC[0] * dC_E[1] - BC[1] * dC_E[0]) / leg.L2**2
    CF = between(p.C, p.F)
    J = np.empty((*theta.shape, 2))
    J[..., 0, 0] = dC_A[0] - psi_A * CF[1]
    J[..., 1, 0] = dC_A[1] + psi_A * CF[0]
    J[..., 0, 1] = dC_E[0] - psi_E * CF[1]
    J[..., 1, 1] = dC_E[1] + psi_E * CF[0]
    return joined(p.F, theta.shape), J


def joint_motion(
    leg: FiveBar,
    foot: ArrayLike,
    foot_dot: ArrayLike,
    foot_ddot: ArrayLike,
    *,
    mode: Mode | None = None,
) -> JointMotion:
    """Return the angles of all four joints along a foot path, with both time derivatives.

    Side A is the two-link chain A, B, F; side E is E, D, C (see `_side_motion`). If L6 > 0, the
    motion of C follows from side A: C = B + R(-phi) BF L2 / |BF|.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        foot_dot: [m/s], (..., 2).
        foot_ddot: [m/s^2], (..., 2).
        mode: Working mode (s_A, s_E); None is the leg's own.

    Returns:
        The joint motion; angles as `inverse` and `passive` give them.

    Raises:
        UnreachableError: The foot is out of reach.
        SingularError: A side chain is straight or folded.
        ArgumentError: The shapes do not broadcast, or rates are not finite.
    """
    F, F_dot, F_ddot = broadcast(
        foot=as_pairs(foot, "foot"),
        foot_dot=finite(as_pairs(foot_dot, "foot_dot"), "foot_dot"),
        foot_ddot=finite(as_pairs(foot_ddot, "foot_ddot"), "foot_ddot"),
    )
    A, E = bases(leg)
    rho, phi = foot_radius_and_angle(leg)
    theta = inverse(leg, F, mode)
    AB = leg.L1 * unit(theta[..., 0])
    # Side A first: it fixes B and L2, hence C, whose motion is what side E has to follow.
    BF = F - A - AB
    A_dot, A_ddot = _side_motion(AB, BF, F_dot, F_ddot, "A, B and F are in line")
    BC = (leg.L2 / rho) * turned(BF, -phi)
    C = A + AB + BC
    C_dot, C_ddot = _end_motion(AB, BC, A_dot, A_ddot)

    ED = leg.L4 * unit(theta[..., 1])
    DC = C - E - ED
    E_dot, E_ddot = _side_motion(ED, DC, C_dot, C_ddot, "E, D and C are in line")

    q = (theta[..., 0], angle_between(AB, BC), theta[..., 1], angle_between(ED, DC))
    # Knee angles are relative to the inner link, so their rates are differences.
    q_dot = (A_dot[0], A_dot[1] - A_dot[0], E_dot[0], E_dot[1] - E_dot[0])
    q_ddot = (A_ddot[0], A_ddot[1] - A_ddot[0], E_ddot[0], E_ddot[1] - E_ddot[0])

    return JointMotion(np.stack(q, -1), np.stack(q_dot, -1), np.stack(q_ddot, -1))


Pair = tuple[Array, Array]


def _side_motion(r1: Array, r2: Array, v: Array, a: Array, where: str) -> tuple[Pair, Pair]:
    """Return the rates and accelerations of the two links' directions (psi_1, psi_2).

    The chain's end moves with v = perp(r1) psi_1_dot + perp(r2) psi_2_dot; with k = r1 x r2:

        psi_1_dot = r2 . v / k,   psi_2_dot = -r1 . v / k
        psi_1_ddot = r2 . w / k,   psi_2_ddot = -r1 . w / k
        w = a + r1 psi_1_dot^2 + r2 psi_2_dot^2
    """
    k = cross(r1, r2)
    check_sine(k / np.sqrt(dot(r1, r1) * dot(r2, r2)), where)
    rate_1 = dot(r2, v) / k
    rate_2 = -dot(r1, v) / k
    # The centripetal part is known once the rates are: what is left is linear.
    w = a + r1 * (rate_1**2)[..., None] + r2 * (rate_2**2)[..., None]
    return (rate_1, rate_2), (dot(r2, w) / k, -dot(r1, w) / k)


def _end_motion(r1: Array, r2: Array, rate: Pair, accel: Pair) -> tuple[Array, Array]:
    """Return velocity and acceleration of the end of two links with given direction rates."""
    w1, w2, b1, b2 = (x[..., None] for x in (*rate, *accel))
    velocity = perp(r1) * w1 + perp(r2) * w2
    return velocity, perp(r1) * b1 - r1 * w1**2 + perp(r2) * b2 - r2 * w2**2


def check_sine(sine: Scalar, where: str, batch: tuple[int, ...] | None = None) -> None:
    """Raise if the sine of the angle between two links is no more than rounding.

    Args:
        sine: Sine of the angle at each pose, (...).
        where: What it means if it is 0, for the message.
        batch: Shape of the poses, for the error's index; None: the sine's own.

    Raises:
        SingularError: At one pose at least; `.index` is the first.
    """
    # Of one pose, at once: NumPy takes twenty times as long.
    if isinstance(sine, float) and abs(sine) > SINGULAR:
        return
    sine = np.asarray(sine) if batch is None else np.reshape(sine, batch)
    # Written so that NaN is singular too.
    singular = ~(np.abs(sine) > SINGULAR)
    if singular.any():
        index = first_index(singular)
        count = f"{int(singular.sum())} of {singular.size} poses are" if index else "the pose is"
        raise SingularError(
            f"{count} singular: {where}; the sine of the angle there must be above "
            f"{SINGULAR:.1e}, got {abs(float(sine[index])):.1e}{at(index)}",
            index,
        )
