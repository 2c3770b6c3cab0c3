r"""How far the firmware's rounding moves the foot at most.

Let u be half the distance from 1 to the next number (2^-24 for float), gamma the angle at C between
BC and DC, rho = |BF|, and `outer` the sum of a side chain's two links.

**Inverse.** Each rounding in a chain's law of cosines is undone by a small change of the problem:

    r = F - A is off by dr <= u (2.5 L5 + d): A's sine and cosine, the subtraction
    high - d^2: outer is off by 4.5 u outer: lengths (u), sum, squares, difference
    d^2 - low: d is off by u outer + 3.5 u d, as |near - far| <= d
    N: its error over 2 d is 1.5 u d + dr + 3 u outer, for the same reason
    S, and the direction's arc tangent: 1 u and 7 u, at the crank's end up to 8 u near

so the angle is the exact one of a chain whose end is elsewhere by

    e = 3 dr + 13.5 u outer + 8 u near <= 24.5 u (outer + L5)

The exact foot at both computed angles is where the two displaced circles cross, off by

    (e_A + e_E) / |sin gamma|                                     for L6 = 0
    e_A + (e_E + (1 + L2 / rho) e_A) (rho / L2) / |sin gamma|      else, since E follows C

Beyond the edge of reach, where a point still counts as on it, another 8 u (size + L5) in each e.
The distance from the reach's edge does not matter: the motors' angles are uncertain there, and the
foot is not. What matters is gamma: B, C and D in line.

**Forward.** The knees are off by 4 u L1 and 4 u L4, BD by 7 u (L1 + L4 + L5); as above, L2 and L3
are off by 13.5 u (L2 + L3) together, and C by both over |sin gamma|:

    4 u L1 + u (7 (L1 + L4 + L5) + 16 (L2 + L3)) (rho / L2) / |sin gamma| + 3 u |F|

Both hold where they are small beside the links times sin^2 gamma; for larger ones they are only the
first term of a series.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import closed_points
from fivebar_sim.kinematics.planar import cross
from fivebar_sim.kinematics.reach import foot_radius_and_angle

CHAIN = 24.5
EDGE = 8.0
"""Roundings of a chain's inverse, and of the edge of reach; see the top of this file."""


def inverse_bound(leg: FiveBar, theta: ArrayLike, kind: type[Any] = np.float32) -> Array:
    """Return how far the exact foot at the firmware's angles is from where it was asked, (...) [m].

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) of the pose [rad], (..., 2).
        kind: np.float32 or np.float64.

    Raises:
        LoopOpenError: The links do not meet.
    """
    rho, _ = foot_radius_and_angle(leg)
    edge = EDGE * (leg.size + leg.L5)
    e_A = CHAIN * (leg.L1 + rho + leg.L5) + edge
    e_E = CHAIN * (leg.L4 + leg.L3 + leg.L5) + edge
    if leg.L6 == 0.0:
        return _unit(kind) * (e_A + e_E) / _sine(leg, theta)

    at_C = e_E + (1.0 + leg.L2 / rho) * e_A
    return _unit(kind) * (e_A + at_C * rho / (leg.L2 * _sine(leg, theta)))


def forward_bound(leg: FiveBar, theta: ArrayLike, kind: type[Any] = np.float32) -> Array:
    """Return how far the firmware's foot is from the exact one at the same angles, (...) [m].

    Arguments and errors are those of `inverse_bound`.
    """
    rho, _ = foot_radius_and_angle(leg)
    F = closed_points(leg, theta).F
    moved = 7.0 * (leg.L1 + leg.L4 + leg.L5) + 16.0 * (leg.L2 + leg.L3)
    at_F = moved * rho / (leg.L2 * _sine(leg, theta))
    return _unit(kind) * (4.0 * leg.L1 + at_F + 3.0 * np.hypot(F[..., 0], F[..., 1]))


def _unit(kind: type[Any]) -> float:
    """Return half the distance from 1 to the next number."""
    return 0.5 * float(np.finfo(kind).eps)


def _sine(leg: FiveBar, theta: ArrayLike) -> Array:
    """Return |sin gamma|, (...)."""
    p = closed_points(leg, theta)
    return np.abs(cross(p.C_left - p.B, p.C_left - p.D)) / (leg.L2 * leg.L3)
