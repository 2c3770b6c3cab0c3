"""What passes through the gears at A and E: a step's constraint forces, told apart.

MuJoCo sums the joint forces of all constraints. Those of B and D, which have no gears, give the
force f at C that holds the loop, from L3 on L2; with g, the ground's force at the foot's lowest
point P, and a x b = a_x b_z - a_z b_x,

    k_B = BC x f + BP x g      k_A - k_B = AB x (f + g) + gear A
    k_D = -DC x f              k_E - k_D = -ED x f + gear E

Stops of B, D and C would count as the loop's: a run that uses them is not to be trusted anyway.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar

Pair = tuple[Array, Array]
"""A vector's x and z."""


class Bars(NamedTuple):
    """What of legs places their joints; numbers, or arrays that broadcast with the poses.

    Attributes:
        L1, L2, L3, L4: Lengths [m].
        along, across: Where the foot is on L2, from B [m].
        base: Of A along x of the hip frame [m].
        height: Of A above the hip frame's origin [m].
        foot_radius: Of the foot's ball [m].
    """

    L1: float | Array
    L2: float | Array
    L3: float | Array
    L4: float | Array
    along: float | Array
    across: float | Array
    base: float | Array
    height: float | Array
    foot_radius: float | Array


class Foot(NamedTuple):
    """What the ground does to a foot, along the hip frame's x and z.

    Attributes:
        force: Of the ground [N], (..., 2).
        arm: From the ball's middle to where it acts [m], (..., 2).
    """

    force: Array
    arm: Array


class Through(NamedTuple):
    """Torques at the joints A and E, (..., 2) each.

    Attributes:
        gear: Of the gears' dry friction [N m].
        outer: Of the loop and the ground [N m].
    """

    gear: Array
    outer: Array


def bars(leg: FiveBar) -> Bars:
    """Return what of a leg places its joints."""
    x, z = kinematics.bases(leg)[0]
    return Bars(leg.L1, leg.L2, leg.L3, leg.L4, *leg.foot_offset, x, z, leg.foot_radius)


def through(bars: Bars, q: Array, constraint: Array, foot: Foot | None) -> Through:
    """Return the constraint forces at A and E, told apart.

    Args:
        bars: The legs.
        q: (theta_A, theta_B, theta_E, theta_D) before the step [rad], (..., 4).
        constraint: Joint forces of all constraints in the step [N m], (..., 4).
        foot: What the ground does to the foot; None without a ground.
    """
    L1 = _along(bars.L1, q[..., 0])
    BC = _along(bars.L2, q[..., 0] + q[..., 1])
    ED = _along(bars.L4, q[..., 2])
    DC = _along(bars.L3, q[..., 2] + q[..., 3])
    k_A, k_B, k_E, k_D = (constraint[..., i] for i in range(4))

    g: Pair = (np.zeros_like(k_A), np.zeros_like(k_A))
    at_B = k_B
    if foot is not None:
        g = (foot.force[..., 0], foot.force[..., 1])
        x, z = _ball(bars, q)
        at_B = k_B - _cross((x + foot.arm[..., 0], z + foot.arm[..., 1]), g)

    # A leg that has come to lie in line has lost its branch: its loop's force is not known.
    det = BC[0] * DC[1] - BC[1] * DC[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        f_x = (at_B * DC[0] + k_D * BC[0]) / det
        f_z = (at_B * DC[1] + k_D * BC[1]) / det
    f = (np.where(np.isfinite(f_x), f_x, 0.0), np.where(np.isfinite(f_z), f_z, 0.0))

    outer_A = k_B + _cross(L1, (f[0] + g[0], f[1] + g[1]))
    outer_E = k_D - _cross(ED, f)
    gear = np.stack([k_A - outer_A, k_E - outer_E], axis=-1)
    return Through(gear, np.stack([outer_A, outer_E], axis=-1))


def standing(bars: Bars, q: Array, force: Array, hip: Array) -> Foot | None:
    """Return what level ground does to the foot of a leg that hangs upright.

    Args:
        bars: The legs.
        q: As in `through`.
        force: Force (x, z) of the ground on the foot [N], (..., 2); (..., 0) without one.
        hip: Height of the hip frame above the ground [m], (...).
    """
    if not force.shape[-1]:
        return None
    z = _ball(bars, q)[1]
    L1 = _along(bars.L1, q[..., 0])
    lowest = hip + bars.height + L1[1] + z - bars.foot_radius
    # MuJoCo has the contact in the middle of the overlap.
    down = bars.foot_radius + 0.5 * np.minimum(lowest, 0.0)
    return Foot(force, np.stack([np.zeros_like(down), -down], axis=-1))


def foot_place(bars: Bars, q: Array) -> Array:
    """Return the middle of the foot's ball in the hip frame [m], (..., 2).

    Args:
        bars: The legs.
        q: As in `through`.
    """
    L1 = _along(bars.L1, q[..., 0])
    x, z = _ball(bars, q)
    return np.stack([bars.base + L1[0] + x, bars.height + L1[1] + z], axis=-1)


def _ball(bars: Bars, q: Array) -> Pair:
    """Return the middle of the foot's ball, from B [m]."""
    psi = q[..., 0] + q[..., 1]
    c = np.cos(psi)
    s = np.sin(psi)
    return bars.along * c - bars.across * s, bars.along * s + bars.across * c


def _along(length: float | Array, psi: Array) -> Pair:
    """Return a link of some length [m] and direction [rad]."""
    return np.asarray(length) * np.cos(psi), np.asarray(length) * np.sin(psi)


def _cross(a: Pair, b: Pair) -> Array:
    """Return the torque of a force b at an arm a."""
    return a[0] * b[1] - a[1] * b[0]
