"""What the closed chain's equation of motion says of given poses, rates and torques."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, as_pairs, at, finite, first_index, together
from fivebar_sim.checks import check_number
from fivebar_sim.dynamics.chain import Chain, Vector, cross, placed
from fivebar_sim.errors import SingularError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.rates import SINGULAR


class Energy(NamedTuple):
    """The mechanical energy of poses in motion.

    Attributes:
        kinetic: Of links, payload and rotors [J], (...).
        potential: Of links and payload, zero if all were at O, the hip frame's origin [J], (...).
    """

    kinetic: Array
    potential: Array


def inverse(
    leg: FiveBar,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    theta_ddot: ArrayLike,
    foot_force: ArrayLike | None = None,
    *,
    assembly: int | None = None,
    payload: float = 0.0,
    friction: float = 0.0,
) -> Array:
    """Return the motor torques of a motion of the closed chain under a foot force.

        tau = M theta_ddot + bias - J^T F + friction sign(theta_dot)

    At rest without weight tau = -J^T F, with weight what holds the leg: sticking is not modelled.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        theta_dot: [rad/s], broadcasts with theta.
        theta_ddot: [rad/s^2], broadcasts with theta.
        foot_force: (x, z) that the world exerts on the foot F [N], broadcasts with theta; None: 0.
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].
        friction: Coulomb friction of each motor's gear [N m]; none at rest.

    Returns:
        (tau_A, tau_E) [N m], positive with the angles, the rotors' share included, (..., 2).

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where B, C and D are in line.
        ArgumentError: Shapes that do not broadcast, numbers that are not finite, unknown
            assembly, negative payload or friction.
    """
    chain = Chain.of(leg, assembly, payload)
    check_number("friction", friction, "N m", low=0.0)
    force = (0.0, 0.0) if foot_force is None else foot_force
    theta, w, alpha, F = _pairs(
        theta=theta, theta_dot=theta_dot, theta_ddot=theta_ddot, foot_force=force
    )
    p = chain.pose(*_split(theta))
    M_AA, M_AE, M_EE = chain.mass(p)
    h_A, h_E = chain.bias(p, *_split(w))
    f_A, f_E = chain.foot_torques(p, _split(F))
    tau_A = M_AA * alpha[..., 0] + M_AE * alpha[..., 1] + h_A - f_A
    tau_E = M_AE * alpha[..., 0] + M_EE * alpha[..., 1] + h_E - f_E

    return np.stack([tau_A, tau_E], axis=-1) + friction * np.sign(w)


def statics(
    leg: FiveBar, theta: ArrayLike, foot_force: ArrayLike, *, assembly: int | None = None
) -> Array:
    """Return the motor torques that hold a foot force at rest: tau = -J^T F.

    The links weigh nothing here; with their weight it is `inverse` at zero rates.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        foot_force: (x, z) that the world exerts on the foot F [N], broadcasts with theta.
        assembly: +1 or -1; None is the leg's own.

    Returns:
        (tau_A, tau_E) [N m], (..., 2).

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where B, C and D are in line.
        ArgumentError: As `inverse`.
    """
    chain = Chain.of(leg, assembly, 0.0)
    theta, F = _pairs(theta=theta, foot_force=foot_force)
    f_A, f_E = chain.foot_torques(chain.pose(*_split(theta)), _split(F))
    return np.stack([-f_A, -f_E], axis=-1)


def mass_matrix(
    leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None, payload: float = 0.0
) -> Array:
    """Return the mass matrix M = G^T H G in motor coordinates, the rotors' inertia included.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Returns:
        M [kg m^2], symmetric and positive definite, (..., 2, 2).

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where B, C and D are in line: M is infinite.
        ArgumentError: As `inverse`.
    """
    chain = Chain.of(leg, assembly, payload)
    (theta,) = _pairs(theta=theta)
    M_AA, M_AE, M_EE = chain.mass(chain.pose(*_split(theta)))
    return np.stack([np.stack([M_AA, M_AE], -1), np.stack([M_AE, M_EE], -1)], -2)


def bias(
    leg: FiveBar,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    *,
    assembly: int | None = None,
    payload: float = 0.0,
) -> Array:
    """Return the torques that a motion at constant motor rates takes: centripetal and weight.

        bias = G^T (H g + c - Q)

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        theta_dot: [rad/s], broadcasts with theta.
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Returns:
        (..., 2) [N m]; at theta_dot = 0 the slope of the potential energy.

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where B, C and D are in line.
        ArgumentError: As `inverse`.
    """
    chain = Chain.of(leg, assembly, payload)
    theta, w = _pairs(theta=theta, theta_dot=theta_dot)
    return np.stack(chain.bias(chain.pose(*_split(theta)), *_split(w)), axis=-1)


def forward(
    leg: FiveBar,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    tau: ArrayLike,
    foot_force: ArrayLike | None = None,
    *,
    assembly: int | None = None,
    payload: float = 0.0,
    friction: float = 0.0,
) -> Array:
    """Return the motor accelerations under given torques; `inverse` turned round.

        theta_ddot = M^-1 (tau - friction sign(theta_dot) - bias + J^T F)

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        theta_dot: [rad/s], broadcasts with theta.
        tau: (tau_A, tau_E) [N m], broadcasts with theta.
        foot_force: (x, z) that the world exerts on the foot F [N], broadcasts with theta; None: 0.
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].
        friction: Coulomb friction of each motor's gear [N m]; none at rest.

    Returns:
        theta_ddot [rad/s^2], (..., 2).

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where B, C and D are in line.
        ArgumentError: As `inverse`.
    """
    chain = Chain.of(leg, assembly, payload)
    check_number("friction", friction, "N m", low=0.0)
    force = (0.0, 0.0) if foot_force is None else foot_force
    theta, w, tau, F = _pairs(theta=theta, theta_dot=theta_dot, tau=tau, foot_force=force)
    p = chain.pose(*_split(theta))
    driven = _split(tau - friction * np.sign(w))
    return np.stack(chain.accelerations(p, _split(w), driven, _split(F)), axis=-1)


def energy(
    leg: FiveBar,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    *,
    assembly: int | None = None,
    payload: float = 0.0,
) -> Energy:
    """Return the energy: psi_dot^T H psi_dot / 2 (as theta_dot^T M theta_dot / 2), -sum m g . p.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        theta_dot: [rad/s], broadcasts with theta.
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Returns:
        (kinetic, potential) [J], each (...).

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where B, C and D are in line.
        ArgumentError: As `inverse`.
    """
    chain = Chain.of(leg, assembly, payload)
    theta, w = _pairs(theta=theta, theta_dot=theta_dot)
    p = chain.pose(*_split(theta))
    w1, w4 = _split(w)
    rates = w1, p.a2 * w1 + p.b2 * w4, p.a3 * w1 + p.b3 * w4, w4
    kinetic, potential = chain.energies(p, rates)
    return Energy(np.asarray(kinetic), np.asarray(potential))


def reflected_inertia(
    leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None, payload: float = 0.0
) -> Array:
    """Return the inertia that the world feels at the foot: J^-T M J^-1.

    A force F on the foot of a leg at rest, motors free, no weight, moves it by F_ddot with
    F = J^-T M J^-1 F_ddot.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Returns:
        [kg], symmetric and positive definite, (..., 2, 2), axes (x, z) of the hip frame.

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where B, C and D, or A, B and F, or E, D and C are in line.
        ArgumentError: As `inverse`.
    """
    chain = Chain.of(leg, assembly, payload)
    (theta,) = _pairs(theta=theta)
    p = chain.pose(*_split(theta))
    rho = float(np.hypot(*leg.foot_offset))
    _refuse(cross(p.e1, placed(p.e2, leg.foot_offset)) / rho, "A, B and F are in line")
    _refuse(cross(p.e4, p.e3), "E, D and C are in line")
    M = mass_matrix(leg, theta, assembly=assembly, payload=payload)
    J_inv = np.linalg.inv(kinematics.jacobian(leg, theta, assembly))
    product = np.einsum("...ji,...jk,...kl->...il", J_inv, M, J_inv)
    return 0.5 * (product + np.swapaxes(product, -1, -2))  # they differ by rounding


def _pairs(**values: ArrayLike) -> list[Array]:
    """Return the values as finite pairs of one shape (..., 2); ArgumentError if they are not."""
    return together(**{name: finite(as_pairs(v, name), name) for name, v in values.items()})


def _split(pairs: Array) -> Vector:
    """Return the two coordinates of pairs, each (...)."""
    return pairs[..., 0], pairs[..., 1]


def _refuse(sine: Array, where: str) -> None:
    """Raise if the sine of the angle between two links is no more than rounding."""
    singular = np.logical_not(np.abs(sine) > SINGULAR)
    if singular.any():
        index = first_index(singular)
        count = f"{int(singular.sum())} of {singular.size} poses are" if index else "the pose is"
        raise SingularError(
            f"{count} singular: {where}, the foot's inertia is infinite{at(index)}", index
        )
