"""A leg's dynamics as one object: the leg, its assembly mode and its payload."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, as_pairs, broadcast, finite
from fivebar_sim.checks import check_number
from fivebar_sim.dynamics import motion, stepwise
from fivebar_sim.dynamics.chain import Chain, Pose, kept
from fivebar_sim.dynamics.motion import Law, Motion
from fivebar_sim.dynamics.plane import Vector, cross, placed, split
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.rates import check_sine


class Energy(NamedTuple):
    """The mechanical energy of moving poses.

    Attributes:
        kinetic: Kinetic energy of links, payload and rotors [J], (...).
        potential: Potential energy of links and payload, zero at O, the hip frame's origin [J],
            (...).
    """

    kinetic: Array
    potential: Array


@dataclass(frozen=True, slots=True)
class LegDynamics:
    """The dynamics of one leg with one payload, checked and prepared once.

    Arguments, units and errors of each method are those of the function of the same name in
    `fivebar_sim.dynamics`, without leg, assembly and payload.

    Attributes:
        leg: The leg.
        assembly: +1 or -1; None is the leg's own.
        payload: Point mass at F [kg].

    Raises:
        ArgumentError: Unknown assembly, or a payload that is not finite or negative.
    """

    leg: FiveBar
    assembly: int | None = None
    payload: float = 0.0
    _chain: Chain = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        # A frozen class sets its own fields only like this; `Chain.of` checks the other three.
        object.__setattr__(self, "_chain", kept(self.leg, self.assembly, self.payload))

    def inverse(
        self,
        theta: ArrayLike,
        theta_dot: ArrayLike,
        theta_ddot: ArrayLike,
        foot_force: ArrayLike | None = None,
        *,
        friction: float = 0.0,
    ) -> Array:
        """Return the motor torques (tau_A, tau_E) that a motion needs [N m], (..., 2)."""
        check_number("friction", friction, "N m", low=0.0)
        force = (0.0, 0.0) if foot_force is None else foot_force
        theta, w, alpha, F = _pairs(
            theta=theta, theta_dot=theta_dot, theta_ddot=theta_ddot, foot_force=force
        )
        # Controllers ask for one leg at a time: plain numbers take a third of the time for it.
        if theta.shape == (1, 2):
            p = self._chain.pose_of_one(theta)
            tau = np.array([_torques(self._chain, p, *(split(each[0]) for each in (w, alpha, F)))])
        else:
            p = self._chain.pose(*split(theta))
            tau = np.stack(_torques(self._chain, p, split(w), split(alpha), split(F)), axis=-1)
        return tau + friction * np.sign(w)

    def statics(self, theta: ArrayLike, foot_force: ArrayLike) -> Array:
        """Return the motor torques that hold a foot force at rest, without weight [N m]."""
        theta, F = _pairs(theta=theta, foot_force=foot_force)
        if theta.shape == (1, 2):
            p = self._chain.pose_of_one(theta)
            return -np.array([self._chain.foot_torques(p, split(F[0]))])
        f_A, f_E = self._chain.foot_torques(self._chain.pose(*split(theta)), split(F))
        return np.stack([-f_A, -f_E], axis=-1)

    def mass_matrix(self, theta: ArrayLike) -> Array:
        """Return the mass matrix in motor coordinates [kg m^2], (..., 2, 2)."""
        (theta,) = _pairs(theta=theta)
        M_AA, M_AE, M_EE = self._chain.mass(self._chain.pose(*split(theta)))
        return np.stack([np.stack([M_AA, M_AE], -1), np.stack([M_AE, M_EE], -1)], -2)

    def bias(self, theta: ArrayLike, theta_dot: ArrayLike) -> Array:
        """Return the motor torques needed at constant motor rates [N m], (..., 2)."""
        theta, w = _pairs(theta=theta, theta_dot=theta_dot)
        return np.stack(self._chain.bias(self._chain.pose(*split(theta)), *split(w)), axis=-1)

    def forward(
        self,
        theta: ArrayLike,
        theta_dot: ArrayLike,
        tau: ArrayLike,
        foot_force: ArrayLike | None = None,
        *,
        friction: float = 0.0,
    ) -> Array:
        """Return the motor accelerations under given torques [rad/s^2], (..., 2)."""
        check_number("friction", friction, "N m", low=0.0)
        force = (0.0, 0.0) if foot_force is None else foot_force
        theta, w, tau, F = _pairs(theta=theta, theta_dot=theta_dot, tau=tau, foot_force=force)
        p = self._chain.pose(*split(theta))
        # Coulomb friction works against the motion; at rest sign(0) = 0 leaves it out.
        driven = tau - friction * np.sign(w)
        # Not plain numbers, which raise an error where the links are too light to divide by.
        torque = driven[..., 0], driven[..., 1]
        return np.stack(self._chain.accelerations(p, split(w), torque, split(F)), axis=-1)

    def energy(self, theta: ArrayLike, theta_dot: ArrayLike) -> Energy:
        """Return the kinetic and the potential energy [J], each (...)."""
        theta, w = _pairs(theta=theta, theta_dot=theta_dot)
        p = self._chain.pose(*split(theta))
        w1, w4 = split(w)
        rates = w1, p.a2 * w1 + p.b2 * w4, p.a3 * w1 + p.b3 * w4, w4
        kinetic, potential = self._chain.energies(p, rates, self._chain.moments(p))
        return Energy(np.asarray(kinetic), np.asarray(potential))

    def reflected_inertia(self, theta: ArrayLike) -> Array:
        """Return the inertia that the world feels at the foot [kg], (..., 2, 2)."""
        (theta,) = _pairs(theta=theta)
        p = self._chain.pose(*split(theta))
        # Where the foot cannot move in some direction the world feels an infinite mass.
        rho = float(np.hypot(*self.leg.foot_offset))
        reach = cross(p.e1, placed(p.e2, self.leg.foot_offset)) / rho
        check_sine(reach, "A, B and F are in line, the foot's inertia is infinite")
        check_sine(cross(p.e4, p.e3), "E, D and C are in line, the foot's inertia is infinite")
        M = self.mass_matrix(theta)
        J_inv = np.linalg.inv(kinematics.jacobian(self.leg, theta, self.assembly))
        product = np.einsum("...ji,...jk,...kl->...il", J_inv, M, J_inv)
        # The product is symmetric but for rounding; callers may rely on it.
        return 0.5 * (product + np.swapaxes(product, -1, -2))

    def simulate(
        self,
        theta: ArrayLike,
        theta_dot: ArrayLike,
        timestep: float,
        steps: int,
        torque: Law | None = None,
        *,
        foot_force: Law | None = None,
        every: int = 1,
    ) -> Motion:
        """Return the motion of any number of legs by the Runge-Kutta method of order 4."""
        return motion.simulate_chain(
            self._chain, theta, theta_dot, timestep, steps, torque, foot_force, every
        )

    def integrate(
        self,
        theta: ArrayLike,
        theta_dot: ArrayLike,
        times: ArrayLike,
        torque: Law | None = None,
        *,
        foot_force: Law | None = None,
        rtol: float = 1e-12,
        atol: float = 1e-13,
    ) -> Motion:
        """Return the motion of one leg to high precision."""
        return motion.integrate_chain(
            self._chain, theta, theta_dot, times, torque, foot_force, rtol, atol
        )

    def step_torques(
        self,
        q: ArrayLike,
        timestep: float,
        foot_force: ArrayLike | None = None,
        *,
        friction: float = 0.0,
    ) -> Array:
        """Return the motor torques for MuJoCo's own steps along a motion [N m], (..., N, 2)."""
        return stepwise.step_chain(self._chain, q, timestep, foot_force, friction)

    def soft_loop(self, q: ArrayLike, timestep: float, damping: float) -> Array:
        """Return the motion with the loop gap that `implicitfast` needs [rad], (N + 1, 4)."""
        return stepwise.soften(self._chain, q, timestep, damping)


def _torques(chain: Chain, p: Pose, w: Vector, alpha: Vector, force: Vector) -> Vector:
    """Return the motor torques M theta_ddot + bias - J^T F [N m]."""
    M_AA, M_AE, M_EE = chain.mass(p)
    h_A, h_E = chain.bias(p, *w)
    f_A, f_E = chain.foot_torques(p, force)
    tau_A = M_AA * alpha[0] + M_AE * alpha[1] + h_A - f_A
    tau_E = M_AE * alpha[0] + M_EE * alpha[1] + h_E - f_E
    return tau_A, tau_E


def _pairs(**values: ArrayLike) -> list[Array]:
    """Return the values broadcast to finite pairs (..., 2); ArgumentError if they are not."""
    return broadcast(**{name: finite(as_pairs(v, name), name) for name, v in values.items()})
