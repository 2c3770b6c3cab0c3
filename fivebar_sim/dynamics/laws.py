"""The closed chain's equation of motion at given poses, rates and torques.

Each function calls the method of the same name of `LegDynamics`, for a single use.
"""

from __future__ import annotations

from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.dynamics.leg import Energy, LegDynamics
from fivebar_sim.geometry import FiveBar


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

    At rest it is the torque that holds the leg (-J^T F without weight): sticking is not modelled.

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
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line.
        ArgumentError: Shapes that do not broadcast, numbers that are not finite, unknown
            assembly, negative payload or friction.
    """
    model = LegDynamics(leg, assembly, payload)
    return model.inverse(theta, theta_dot, theta_ddot, foot_force, friction=friction)


def statics(
    leg: FiveBar, theta: ArrayLike, foot_force: ArrayLike, *, assembly: int | None = None
) -> Array:
    """Return the motor torques that hold a foot force at rest: tau = -J^T F.

    The links have no weight here; with their weight use `inverse` at zero rates.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        foot_force: (x, z) that the world exerts on the foot F [N], broadcasts with theta.
        assembly: +1 or -1; None is the leg's own.

    Returns:
        (tau_A, tau_E) [N m], (..., 2).

    Raises:
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line.
        ArgumentError: As `inverse`.
    """
    return LegDynamics(leg, assembly).statics(theta, foot_force)


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
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line, so M is infinite.
        ArgumentError: As `inverse`.
    """
    return LegDynamics(leg, assembly, payload).mass_matrix(theta)


def bias(
    leg: FiveBar,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    *,
    assembly: int | None = None,
    payload: float = 0.0,
) -> Array:
    """Return the torques needed at constant motor rates: centripetal terms and weight.

        bias = G^T (H g + c - Q)

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        theta_dot: [rad/s], broadcasts with theta.
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Returns:
        (..., 2) [N m]; at theta_dot = 0 the gradient of the potential energy.

    Raises:
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line.
        ArgumentError: As `inverse`.
    """
    return LegDynamics(leg, assembly, payload).bias(theta, theta_dot)


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
    """Return the motor accelerations under given torques, the inverse of `inverse`.

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
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line.
        ArgumentError: As `inverse`.
    """
    model = LegDynamics(leg, assembly, payload)
    return model.forward(theta, theta_dot, tau, foot_force, friction=friction)


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
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line.
        ArgumentError: As `inverse`.
    """
    return LegDynamics(leg, assembly, payload).energy(theta, theta_dot)


def reflected_inertia(
    leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None, payload: float = 0.0
) -> Array:
    """Return the inertia that the world feels at the foot: J^-T M J^-1.

    A force on the foot of a leg at rest, with free motors and no weight, accelerates it by a with
    force = J^-T M J^-1 a.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Returns:
        [kg], symmetric and positive definite, (..., 2, 2), axes (x, z) of the hip frame.

    Raises:
        LoopOpenError: The links do not meet.
        SingularError: B, C and D, or A, B and F, or E, D and C are in line.
        ArgumentError: As `inverse`.
    """
    return LegDynamics(leg, assembly, payload).reflected_inertia(theta)
