"""The oracle's leg under a trunk on a vertical slide, as both of its floors see it.

The hip frame keeps its axes and moves up and down with hip_z, the height of its origin above the
floor. With M, h, G of `oracle`, S = sum m J_z of the centres, m the whole mass, J of the foot F:

    M psi_ddot + S hip_ddot - G^T lambda = (tau, 0) - h + what the floor does
    S psi_ddot + m hip_ddot = m g_z - sum m_i (J_dot psi_dot)_z + what the floor does
    G psi_ddot = -G_dot psi_dot

The foot is a ball of radius r about F, fixed to L2: it touches below F, at J_x + r e_2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import oracle
from oracle import Leg

Rows = list[list[float]]


class Carried(NamedTuple):
    """The equations of leg and trunk without a floor, for (psi_ddot, hip_ddot).

    Attributes:
        inertia: [kg m^2, kg m, kg], five rows of five.
        right: Right side [N m, N], five.
        loop: G, with a column for hip_ddot, two rows of five; and -G_dot psi_dot, two.
        along: J_x + r e_2 of what touches [m], five.
        up: J_z of it, 1 for hip_ddot [m], five.
        drift: (J_dot psi_dot) of F, x + 1j z [m/s^2].
    """

    inertia: Rows
    right: list[float]
    loop: tuple[Rows, list[float]]
    along: list[float]
    up: list[float]
    drift: complex


def carried(
    leg: Leg,
    trunk: float,
    radius: float,
    psi: Sequence[float],
    psi_dot: Sequence[float],
    tau: Sequence[float],
) -> Carried:
    """Return the equations of a leg that carries a trunk.

    Args:
        leg: The leg.
        trunk: Mass on the slide besides the leg's own [kg].
        radius: r of the foot's ball [m].
        psi: Angles [rad] that close the loop.
        psi_dot: Their rates [rad/s].
        tau: Motor torques (tau_A, tau_E) [N m].
    """
    # Plain numbers: an operation on arrays of five takes as long as ten of them.
    S = [0.0] * 4
    mass = trunk + sum(leg.mass)
    pull = 0.0
    for m, (_, arms) in zip(leg.mass, oracle.centres(leg, psi), strict=True):
        for k, r in arms:
            S[k] += m * r.real
        pull += m * oracle.centripetal(arms, psi_dot).imag

    inertia = [[*row, s] for row, s in zip(oracle.mass_matrix(leg, psi), S, strict=True)]
    h1, h2, h3, h4 = oracle.bias(leg, psi, psi_dot)

    arms = oracle.loop(leg, psi)[1]
    gap = oracle.centripetal(arms, psi_dot)
    tip = oracle.foot(leg, psi)[1]
    J_x, J_z = oracle.jacobian(tip)
    J_x[1] += radius
    return Carried(
        inertia=[*inertia, [*S, mass]],
        right=[tau[0] - h1, -h2, -h3, tau[1] - h4, mass * leg.gravity.imag - pull],
        loop=([[*row, 0.0] for row in oracle.jacobian(arms)], [-gap.real, -gap.imag]),
        along=[*J_x, 0.0],
        up=[*J_z, 1.0],
        drift=oracle.centripetal(tip, psi_dot),
    )


def solved(
    inertia: Rows, held: Rows, right: Sequence[float], still: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Return accelerations and the forces that hold: inertia a - held^T f = right, held a = still.

    Args:
        inertia: Five rows of five.
        held: Rows of what is held, k rows of five.
        right: Five.
        still: Accelerations of what is held, k.
    """
    columns = zip(*held, strict=True)
    K = [[*row, *(-h for h in each)] for row, each in zip(inertia, columns, strict=True)]
    K += [[*row, *(0.0 for _ in held)] for row in held]
    found = oracle.solve(K, [*right, *still])
    return found[:5], found[5:]
