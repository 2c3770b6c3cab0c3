"""How far poses are from singular.

The loop ties the rates of C to those of the motors. L2 and L3 keep their lengths, so with

    [BC]            [AB x BC     0   ]
    [DC] C_dot  =   [   0     ED x DC] theta_dot,      as   M_x C_dot = M_theta theta_dot

det d C / d theta = det M_theta / det M_x. The foot turns with L2 about B, and with F for C on
side A alone the same holds for d F / d theta, whatever L6 and bend are:

    det J = (AB x BF) (ED x DC) / (BC x DC)

    AB x BF = 0   A, B, F in line: side A straight or folded   inverse (serial): J loses rank
    ED x DC = 0   E, D, C in line: side E straight or folded   inverse (serial): J loses rank
    BC x DC = 0   B, C, D in line; or B = D, where BC = DC     direct (parallel): J is infinite

So with L6 > 0 the pose A, B, C in line is an ordinary one. One length measures each factor: the
shorter of the two links times the sine of the angle between them, signed as the modes are,

    side_A = (AF x AB) / max(|AB|, |BF|)      AF x AB = -AB x BF
    side_E = (EC x ED) / max(|ED|, |DC|)      EC x ED = -ED x DC
    loop   = (BD x BC) / max(|BC|, |DC|)      BD x BC =  BC x DC

the lesser distance of either link's far end from the other link's line. The height of B over the
line AF, of D over EC, of C over BD would not do: where two equal links fold onto each other the
height is a whole link long, or undefined, while the determinant is zero (F = A, C = E, B = D).

See: Gosselin and Angeles 1990, "Singularity analysis of closed-loop kinematic chains", IEEE
Transactions on Robotics and Automation 6(3): types 1 (inverse) and 2 (direct).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.arrays import Array, as_pairs
from fivebar_sim.geometry import FiveBar, Mode
from fivebar_sim.kinematics.closure import Points, bases, closed_points
from fivebar_sim.kinematics.planar import cross
from fivebar_sim.kinematics.reach import foot_radius_and_angle, inverse, points_at

EDGE = 1e-6
"""Sine of the angle between two links a, b that counts as 0. A foot on the edge of reach to
rounding, 16 eps of (a + b)^2, is solved with a sine of up to sqrt(16 eps) (a + b) / sqrt(a b):
1.2e-7 for equal links, 1e-6 for 280 : 1."""


class Distances(NamedTuple):
    """Signed distances from the three kinds of singularity [m], each of shape (...).

    Attributes:
        side_A: How far A, B, F are from being in line, with the sign of s_A.
        side_E: How far E, D, C are from being in line, with the sign of s_E.
        loop: How far B, C, D are from being in line, with the sign of the assembly mode.
    """

    side_A: Array
    side_E: Array
    loop: Array


def distances(leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None) -> Distances:
    """Return the signed distances of closed poses from the singularities.

        side_A = (AF x AB) / max(|AB|, |BF|)
        side_E = (EC x ED) / max(|ED|, |DC|)
        loop   = (BD x BC) / max(|BC|, |DC|)

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        The distances [m], each (...); a singular pose's zero is exact to rounding, some eps of
        the leg's size.

    Raises:
        LoopOpenError: Where the links do not meet, and at B = D, where C may be anywhere on a
            circle: `distances_of` accepts that pose, and `distances_at` can return it.
    """
    return distances_of(leg, closed_points(leg, theta, assembly=assembly))


def distances_at(leg: FiveBar, foot: ArrayLike, *, mode: Mode | None = None) -> Distances:
    """Return the signed distances from the singularities, of the poses that put F at given points.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        mode: Working mode (s_A, s_E); None is the leg's own.

    Returns:
        The distances [m], each (...); the assembly mode follows from the foot and the mode.

    Raises:
        UnreachableError: Where the foot is out of reach.
        ArgumentError: Unknown mode, or a shape other than (..., 2).
    """
    foot = as_pairs(foot, "foot")
    return distances_of(leg, points_at(leg, foot, inverse(leg, foot, mode)))


def distances_of(leg: FiveBar, points: Points) -> Distances:
    """Return the signed distances of poses given by their joints; formulas as `distances`."""
    A, E = bases(leg)
    rho, _ = foot_radius_and_angle(leg)
    # The loop may be open by rounding: each side takes the C of its own chain.
    return Distances(
        side_A=cross(points.F - A, points.B - A) / max(leg.L1, rho),
        side_E=cross(points.C_right - E, points.D - E) / max(leg.L4, leg.L3),
        loop=cross(points.D - points.B, points.C_left - points.B) / max(leg.L2, leg.L3),
    )


def shorter_links(leg: FiveBar) -> tuple[float, float, float]:
    """Return the shorter link of each pair [m]: a distance divided by it is a sine.

    They are min(|AB|, |BF|), min(|ED|, |DC|) and min(|BC|, |DC|), in the order of `Distances`.
    """
    rho, _ = foot_radius_and_angle(leg)
    return min(leg.L1, rho), min(leg.L4, leg.L3), min(leg.L2, leg.L3)


def signs(leg: FiveBar, d: Distances) -> NDArray[np.int_]:
    """Return (s_A, s_E, assembly) of poses, 0 where singular to rounding: sine at most `EDGE`.

    Args:
        leg: The leg.
        d: Signed distances [m], each (...).

    Returns:
        -1, 0 or +1, shape (..., 3).
    """
    every = np.stack(np.broadcast_arrays(*d), axis=-1)
    return np.where(np.abs(every) > EDGE * np.array(shorter_links(leg)), np.sign(every), 0).astype(
        int
    )
