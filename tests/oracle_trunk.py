"""The oracle's leg under a trunk on a vertical slide, as both of its floors see it.

The hip frame keeps its axes and moves up and down with hip_z, the height of its origin above the
floor. With M, h, G of `oracle`, S = sum m J_z of the centres, m the whole mass, J of the foot F:

    M psi_ddot + S hip_ddot - G^T lambda = (tau, 0) - h + what the floor does
    S psi_ddot + m hip_ddot = m g_z - sum m_i (J_dot psi_dot)_z + what the floor does
    G psi_ddot = -G_dot psi_dot

The foot is a ball of radius r about F, fixed to L2: it touches below F, at J_x + r e_2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import oracle
from oracle import Array, Leg


class Carried(NamedTuple):
    """The equations of leg and trunk without a floor, for (psi_ddot, hip_ddot).

    Attributes:
        inertia: [kg m^2, kg m, kg], shape (5, 5).
        right: Right side [N m, N], shape (5,).
        loop: G, with a column for hip_ddot, and G_dot psi_dot, shapes (2, 5) and (2,).
        along: J_x + r e_2 of what touches [m], shape (5,).
        up: J_z of it, 1 for hip_ddot [m], shape (5,).
        drift: (J_dot psi_dot) of F, x + 1j z [m/s^2].
    """

    inertia: Array
    right: Array
    loop: tuple[Array, Array]
    along: Array
    up: Array
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
    # Plain numbers until the end: an operation on arrays of five takes as long as ten of them.
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
        inertia=np.array([*inertia, [*S, mass]]),
        right=np.array([tau[0] - h1, -h2, -h3, tau[1] - h4, mass * leg.gravity.imag - pull]),
        loop=(
            np.array([[*row, 0.0] for row in oracle.jacobian(arms)]),
            np.array([gap.real, gap.imag]),
        ),
        along=np.array([*J_x, 0.0]),
        up=np.array([*J_z, 1.0]),
        drift=oracle.centripetal(tip, psi_dot),
    )


def solved(inertia: Array, held: Array, right: Array, still: Array) -> tuple[Array, Array]:
    """Return accelerations and the forces that hold: inertia a - held^T f = right, held a = still.

    Args:
        inertia: Shape (5, 5).
        held: Rows of what is held, shape (k, 5).
        right: Shape (5,).
        still: Accelerations of what is held, shape (k,).
    """
    n = 5 + len(held)
    K = np.zeros((n, n))
    K[:5, :5] = inertia
    K[5:, :5] = held
    K[:5, 5:] = -held.T
    found = np.array(oracle.solve(K, np.concatenate([right, still])))
    return found[:5], found[5:]


def integrated(
    slope: Callable[[float, Array], list[float]],
    start: Sequence[float],
    times: Array,
    rtol: float,
    atol: float,
) -> tuple[Array, Array]:
    """Return times and states of a motion, shapes (N,) and (N, n), under error control.

    Raises:
        RuntimeError: The integrator gave up.
    """
    from scipy.integrate import solve_ivp

    span = (0.0, float(times[-1]))
    result = solve_ivp(slope, span, start, "LSODA", times, rtol=rtol, atol=atol)
    if not result.success:
        raise RuntimeError(result.message)
    return result.t, result.y.T
