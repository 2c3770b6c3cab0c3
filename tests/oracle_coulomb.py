"""The oracle's floor with dry friction: stiff springs under a ball that sticks or slides.

It shares nothing with MuJoCo's contact: no solver, no impedance, no regularised cone. The ball of
radius r about F sinks in by d, and what touches moves along the floor at v:

    d = r - hip_z - F_z,   v = dF_x/dt + r dpsi_2/dt
    N = max(k d + c dd/dt, 0),   T = -clip(k s + c v, -mu N, mu N)
    ds/dt = v while it sticks, else s keeps to where the spring has the force of the sliding foot

A foot that sticks does not creep: at rest the spring holds T for ever. With stiffer springs it goes
to Coulomb's law on a rigid floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import oracle
import oracle_simulation
from oracle import Array, Leg
from oracle_simulation import Law, Pair, Path, integrated
from oracle_trunk import carried, solved

SETTLED = 1e-4
"""How fast the spring of a sliding foot takes up the force [s]."""


@dataclass(frozen=True, slots=True)
class Floor:
    """What the leg carries and stands on.

    Attributes:
        trunk: Mass on the slide besides the leg's own [kg].
        radius: r of the foot's ball [m].
        friction: mu.
        stiffness: k of both springs [N/m].
        damping: c of both [N s/m].
    """

    trunk: float
    radius: float
    friction: float = 1.0
    stiffness: float = 5e4
    damping: float = 30.0


class Touch(NamedTuple):
    """The contact: T and N on the foot [N], ds/dt of the spring [m/s], and whether it sticks."""

    T: float
    N: float
    rate: float
    sticks: bool


@dataclass(frozen=True, slots=True)
class Stance:
    """A simulated stance, one row a requested time.

    Attributes:
        time: [s], shape (N,).
        tau: Torques of the motors [N m], the kd term included, shape (N, 2).
        ground: What the ground does to the foot, (T, N) [N], shape (N, 2).
        slip: F_x + r psi_2 less its value at the start [m], shape (N,).
    """

    time: Array
    tau: Array
    ground: Array
    slip: Array


def touch(floor: Floor, depth: float, sinking: float, stretch: float, v: float) -> Touch:
    """Return the contact.

    Args:
        floor: The floor.
        depth: d [m].
        sinking: Its rate [m/s].
        stretch: s [m].
        v: How fast the touching point moves along the floor [m/s].
    """
    N = max(floor.stiffness * depth + floor.damping * sinking, 0.0) if depth > 0.0 else 0.0
    most = floor.friction * N
    pull = floor.stiffness * stretch + floor.damping * v
    if abs(pull) <= most:
        return Touch(-pull, N, v, True)

    T = -most if pull > 0.0 else most
    return Touch(T, N, (-T / floor.stiffness - stretch) / SETTLED, False)


def accelerations(
    leg: Leg,
    floor: Floor,
    psi: Sequence[float],
    psi_dot: Sequence[float],
    tau: Sequence[float],
    force: Touch,
) -> list[float]:
    """Return psi_ddot [rad/s^2] and hip_ddot_z [m/s^2], five, under a force of the floor.

    On the right of `oracle_trunk` stand J_z^T N + (J_x + r e_2)^T T, and N for the trunk.
    """
    own = carried(leg, floor.trunk, floor.radius, psi, psi_dot, tau)
    touched = zip(own.right, own.up, own.along, strict=True)
    right = [r + z * force.N + x * force.T for r, z, x in touched]
    loop, still = own.loop
    return solved(own.inertia, loop, right, still)[0]


def simulate(
    leg: Leg, floor: Floor, law: Law, path: Path, times: Array, *, drop: float = 1e-6
) -> Stance:
    """Return the stance from rest, the ball a little above the floor.

    Args:
        leg: The leg; its foot below the hip.
        floor: What it carries and stands on.
        law: Motor torques.
        path: The target of the law in the hip frame.
        times: Where the motion is wanted [s], growing from 0 or later.
        drop: Height of the ball above the floor at t = 0 [m].

    Raises:
        RuntimeError: The integrator gave up.
    """
    first = oracle.pose(leg, complex(*path(0.0)[0]))
    height = floor.radius + drop - oracle.position(oracle.foot(leg, first)).imag
    anchor = oracle.position(oracle.foot(leg, first)).real + floor.radius * first[1]

    def state(t: float, row: Array) -> tuple[list[float], list[float], Pair, Touch, float]:
        y = row.tolist()
        psi = oracle.closed(leg, y[0], y[1])
        psi_dot = oracle_simulation.knee_rates(leg, psi, y[2], y[3])
        tip = oracle.foot(leg, psi)
        F = oracle.position(tip)
        F_dot = oracle.velocity(tip[1], psi_dot)
        v = F_dot.real + floor.radius * psi_dot[1]
        contact = touch(floor, floor.radius - y[4] - F.imag, -y[5] - F_dot.imag, y[6], v)
        tau = law(leg, path, t, y[:2], y[2:4])
        return psi, psi_dot, tau, contact, F.real + floor.radius * psi[1] - anchor

    def slope(t: float, row: Array) -> list[float]:
        psi, psi_dot, tau, contact, _ = state(t, row)
        ddot = accelerations(leg, floor, psi, psi_dot, tau, contact)
        return [row[2], row[3], ddot[0], ddot[3], row[5], ddot[4], contact.rate]

    y0 = [first[0], first[3], 0.0, 0.0, height, 0.0, 0.0]
    states = integrated(slope, y0, times, rtol=1e-7, atol=1e-10)
    rows = [state(t, row) for t, row in zip(times.tolist(), states, strict=True)]
    return Stance(
        time=times,
        tau=np.array([row[2] for row in rows]),
        ground=np.array([[row[3].T, row[3].N] for row in rows]),
        slip=np.array([row[4] for row in rows]),
    )
