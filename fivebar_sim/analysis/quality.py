"""How well a pose turns motor rates and torques into foot rates and forces.

Both motors turn and the foot only shifts, so all of J has one unit, m/rad, and its singular values
s_1 >= s_2 >= 0 can be compared. With J = U diag(s) V^T, the columns of U being u_1, u_2:

    |theta_dot| = 1 rad/s   foot_dot = J theta_dot    an ellipse with semi-axes s_i along u_i
    |tau| = 1 N m           force = J^-T tau          an ellipse with semi-axes 1 / s_i along u_i

Where a side chain is straight or folded J loses rank, s_2 = 0: along u_2 the foot cannot move, and
any force is held without torque, so the condition number and that semi-axis are inf. Where B, C
and D are in line J is infinite, and all functions but `transmission_angles` raise SingularError.

See: Yoshikawa 1985, "Manipulability of robotic mechanisms", International Journal of Robotics
Research 4(2); Salisbury and Craig 1982, "Articulated hands: force control and kinematic issues",
IJRR 1(1), for the condition number.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import bases, closed_points
from fivebar_sim.kinematics.planar import angle_between, cross
from fivebar_sim.kinematics.rates import jacobian

LOST = 1e-12
"""A singular value below this fraction of the greater one, or of the leg's size per radian, is 0:
rounding of a singular pose leaves some hundred eps, which is below."""


class Ellipse(NamedTuple):
    """An ellipse about the foot.

    Attributes:
        semi_axes: Half lengths, (..., 2).
        directions: Unit vectors in the hip frame, one in each row: directions[..., i, :] belongs to
            semi_axes[..., i]; (..., 2, 2). Their signs are arbitrary; for a circle so are both.
    """

    semi_axes: Array
    directions: Array


class Transmission(NamedTuple):
    """Transmission angles [rad] in [0, pi], each (...).

    Attributes:
        B: Between L1 and the line BF (L2 where L6 = 0).
        C: Between L2 and L3.
        D: Between L4 and L3.
    """

    B: Array
    C: Array
    D: Array

    @property
    def deviation(self) -> Transmission:
        """How far each is from a right angle [rad]: 0 is best, pi / 2 is singular."""
        return Transmission(*(np.abs(angle - 0.5 * np.pi) for angle in self))


def determinant(leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None) -> Array:
    """Return det J of closed poses, with its sign: s_A s_E assembly.

        det J = (AB x BF) (ED x DC) / (BC x DC)

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        det J [m^2/rad^2], (...); 0 where a side chain is straight or folded.

    Raises:
        LoopOpenError: Where the links do not meet, and at B = D.
        SingularError: Where B, C and D are in line: det J is infinite.
    """
    return _decompose(leg, theta, assembly)[0]


def manipulability(leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None) -> Array:
    """Return |det J| = s_1 s_2: pi times it is the area of the velocity ellipse.

    Args, Returns, Raises: as `determinant`.

    See: Yoshikawa 1985, whose measure sqrt(det J J^T) this is.
    """
    return np.abs(determinant(leg, theta, assembly=assembly))


def condition(leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None) -> Array:
    """Return the condition number s_1 / s_2 of J: 1 is isotropic.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        At least 1, (...); inf where a side chain is straight or folded, J = 0 included.

    Raises:
        LoopOpenError: Where the links do not meet, and at B = D.
        SingularError: Where B, C and D are in line.
    """
    _, s, _ = _decompose(leg, theta, assembly)
    lost = s[..., 1] == 0.0
    return np.where(lost, np.inf, s[..., 0] / np.where(lost, 1.0, s[..., 1]))


def velocity_ellipse(leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None) -> Ellipse:
    """Return the velocities of the foot for motor rates of |theta_dot| = 1 rad/s.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        Semi-axes s_1 >= s_2 [m/s per rad/s] and directions u_1, u_2; s_2 is 0 where a side chain
        is straight or folded.

    Raises:
        LoopOpenError: Where the links do not meet, and at B = D.
        SingularError: Where B, C and D are in line.
    """
    _, s, U = _decompose(leg, theta, assembly)
    return Ellipse(s, np.swapaxes(U, -1, -2))


def force_ellipse(leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None) -> Ellipse:
    """Return the forces of the foot on the world, at rest, for motor torques of |tau| = 1 N m.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        Semi-axes 1 / s_1 <= 1 / s_2 [N per N m] and directions: those of `velocity_ellipse`, in
        its order. 1 / s_2 is inf where a side chain is straight or folded; both are if J = 0.

    Raises:
        LoopOpenError: Where the links do not meet, and at B = D.
        SingularError: Where B, C and D are in line.
    """
    _, s, U = _decompose(leg, theta, assembly)
    semi_axes = np.where(s > 0.0, 1.0 / np.where(s > 0.0, s, 1.0), np.inf)
    return Ellipse(semi_axes, np.swapaxes(U, -1, -2))


def transmission_angles(
    leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None
) -> Transmission:
    """Return the angles at B, C and D between the links that meet there.

        mu_B = angle(BA, BF),  mu_C = angle(CB, CD),  mu_D = angle(DE, DC)

    det J = |AB| |ED| |BF| / |BC| sin(mu_B) sin(mu_D) / sin(mu_C), signs aside: each is 0 or pi
    where its factor is singular. At B the line is BF, not L2: a force of the foot along BF is
    borne by motor A alone, with the arm |AB| sin(mu_B). Singular poses are allowed, except for
    B = D.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        The three angles [rad]; `.deviation` is how far each is from a right angle.

    Raises:
        LoopOpenError: Where the links do not meet, and at B = D.
    """
    A, E = bases(leg)
    p = closed_points(leg, theta, assembly=assembly)
    return Transmission(
        B=np.abs(angle_between(A - p.B, p.F - p.B)),
        C=np.abs(angle_between(p.B - p.C_left, p.D - p.C_left)),
        D=np.abs(angle_between(E - p.D, p.C_right - p.D)),
    )


def _decompose(leg: FiveBar, theta: ArrayLike, assembly: int | None) -> tuple[Array, Array, Array]:
    """Return det J (...), the singular values of J (..., 2) and U (..., 2, 2)."""
    J = jacobian(leg, theta, assembly)
    A, E = bases(leg)
    p = closed_points(leg, theta, assembly=assembly)
    DC = p.C_right - p.D
    det = cross(p.B - A, p.F - p.B) * cross(p.D - E, DC) / cross(p.C_left - p.B, DC)
    U, s, _ = np.linalg.svd(J)
    # s_2 = |det J| / s_1 with det J from its factors: where s_1 is great, B, C and D nearly in
    # line, the rounding of J would drown the s_2 of the SVD.
    s[..., 1] = np.abs(det) / np.where(s[..., 0] > 0.0, s[..., 0], 1.0)
    s[s <= LOST * np.maximum(s[..., :1], leg.size)] = 0.0
    return det, s, U
