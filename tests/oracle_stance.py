"""The oracle's stance: the leg under a trunk on a vertical slide, its foot on a rigid level floor.

Trunk and ball are those of `oracle_trunk`. The ground pushes with (T, N) where the ball touches.
The floor keeps its height, and if it grips also its place as the ball rolls:

    hip_z + F_z = r,   and with grip F_x + r psi_2 = constant
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import oracle
import oracle_simulation
from oracle import Array, Leg
from oracle_simulation import Law, Path, integrated
from oracle_trunk import carried, solved


@dataclass(frozen=True, slots=True)
class Ground:
    """What the leg carries and stands on.

    Attributes:
        trunk: Mass on the slide besides the leg's own [kg].
        radius: r of the foot's ball [m].
        grips: Whether the foot rolls without slip; else the floor has no friction.
    """

    trunk: float
    radius: float
    grips: bool = False


@dataclass(frozen=True, slots=True)
class Stance:
    """A simulated stance, one row a requested time.

    Attributes:
        time: [s], shape (N,).
        theta: (theta_A, theta_E) [rad], continuous from (-pi, pi], shape (N, 2).
        foot: F [m] in the hip frame, shape (N, 2).
        hip_z: Height of the hip frame's origin above the floor [m], shape (N,).
        tau: Torques of the motors [N m], the kd term included, shape (N, 2).
        ground: What the ground does to the foot, (T, N) [N], shape (N, 2).
        energy: Kinetic and potential, of leg and trunk, zero with the trunk on the floor [J], (N,).
        slip: F_x + r psi_2 less its value at the start [m], shape (N,).
    """

    time: Array
    theta: Array
    foot: Array
    hip_z: Array
    tau: Array
    ground: Array
    energy: Array
    slip: Array


def forward_dynamics(
    leg: Leg, ground: Ground, psi: Sequence[float], psi_dot: Sequence[float], tau: Sequence[float]
) -> tuple[list[float], float, complex]:
    """Return psi_ddot [rad/s^2], hip_ddot_z [m/s^2] and the ground's force on the foot T + 1j N.

    To the equations of `oracle_trunk` it adds J_z^T N + (J_x + r e_2)^T T, and N for the trunk:

        J_z psi_ddot + hip_ddot = -(J_dot psi_dot)_z
        with grip (J_x + r e_2) psi_ddot = -(J_dot psi_dot)_x,   else T = 0

    Args:
        leg: The leg.
        ground: What it carries and stands on.
        psi: Angles [rad] that close the loop.
        psi_dot: Their rates [rad/s], which keep it closed (and the foot rolling, with grip).
        tau: Motor torques (tau_A, tau_E) [N m].
    """
    own = carried(leg, ground.trunk, ground.radius, psi, psi_dot, tau)
    loop, kept = own.loop
    held = [*loop, own.up]
    still = [*kept, -own.drift.imag]
    if ground.grips:
        held = [*held, own.along]
        still = [*still, -own.drift.real]

    ddot, force = solved(own.inertia, held, own.right, still)
    T = force[3] if ground.grips else 0.0
    return ddot[:4], ddot[4], complex(T, force[2])


def simulate(
    leg: Leg,
    ground: Ground,
    law: Law,
    path: Path,
    times: Array,
    *,
    start: complex | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
) -> Stance:
    """Return the stance from rest, under error control.

    Args:
        leg: The leg; its foot below the hip.
        ground: What it carries and stands on.
        law: Motor torques.
        path: The target of the law in the hip frame.
        times: Where the motion is wanted [s], growing from 0 or later.
        start: The foot at t = 0, x + 1j z [m]; None is path(0).
        rtol: Of the integrator.
        atol: Of the integrator [rad, rad/s].

    Raises:
        ValueError: The ground would have to pull, or the motion opens the loop.
        RuntimeError: The integrator gave up.
    """
    first = oracle.pose(leg, complex(*path(0.0)[0]) if start is None else start)

    def slope(t: float, row: Array) -> list[float]:
        y = row.tolist()
        tau = law(leg, path, t, y[:2], y[2:])
        psi_ddot, _, force = forward_dynamics(leg, ground, *_state(leg, y), tau)
        if not force.imag > 0.0:
            raise ValueError(f"the foot lifts off at t = {t:g} s: the ground does not pull")
        return [y[2], y[3], psi_ddot[0], psi_ddot[3]]

    y0 = [first[0], first[3], 0.0, 0.0]
    states = integrated(slope, y0, times, rtol, atol)
    rows = []
    for t, y in zip(times.tolist(), states.tolist(), strict=True):
        tau = law(leg, path, t, y[:2], y[2:])
        rows.append([*tau, *_row(leg, ground, *_state(leg, y), tau)])
    return _recorded(times, states[:, :2].copy(), np.array(rows), first, leg, ground)


def _state(leg: Leg, y: Sequence[float]) -> tuple[list[float], list[float]]:
    """Return psi and psi_dot of (theta_A, theta_E, theta_dot_A, theta_dot_E)."""
    psi = oracle.closed(leg, y[0], y[1])
    return psi, oracle_simulation.knee_rates(leg, psi, y[2], y[3])


def _recorded(
    time: Array, theta: Array, rows: Array, first: list[float], leg: Leg, ground: Ground
) -> Stance:
    """Return everything a stance holds; rows are tau and `_row`, first is psi at t = 0."""
    tau = rows[:, :2]
    foot = rows[:, 2:4]
    force = rows[:, 4:6]
    anchor = oracle.position(oracle.foot(leg, first)).real + ground.radius * first[1]
    hip_z = ground.radius - foot[:, 1]
    return Stance(time, theta, foot, hip_z, tau, force, rows[:, 6], rows[:, 7] - anchor)


def _row(
    leg: Leg, ground: Ground, psi: list[float], psi_dot: list[float], tau: Sequence[float]
) -> tuple[float, ...]:
    """Return foot x and z [m], ground force T and N [N], energy [J] and F_x + r psi_2 [m]."""
    point = oracle.foot(leg, psi)
    F = oracle.position(point)
    force = forward_dynamics(leg, ground, psi, psi_dot, tau)[2]
    # the leg seen from the floor: up by hip_z and at its rate
    z = ground.radius - F.imag
    rate = -oracle.velocity(point[1], psi_dot).imag
    momentum = sum(
        m * oracle.velocity(arms, psi_dot).imag
        for m, (_, arms) in zip(leg.mass, oracle.centres(leg, psi), strict=True)
    )
    mass = ground.trunk + sum(leg.mass)
    energy = oracle.energy(leg, psi, psi_dot) + rate * momentum
    energy += mass * (0.5 * rate**2 - leg.gravity.imag * z)
    return F.real, F.imag, force.real, force.imag, energy, F.real + ground.radius * psi[1]
