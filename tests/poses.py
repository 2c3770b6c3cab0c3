"""Random legs and poses for the tests of kinematics."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics import Points
from fivebar_sim.kinematics.planar import cross, turned

RIGID = FiveBar(0.05, 0.04, 0.035, 0.07, 0.09, 0.02, 0.5, 0.3)  # nothing equal; has all branches
LINE = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)
"""A leg with B, C and D in line at (pi, 0)."""

RIGHT = FiveBar(0.03, 0.04, 0.04, 0.03, 0.06)  # has poses of 3-4-5 triangles
BATCHES = [(), (1,), (3, 1, 4)]

FAR = np.full((2, 3, 2), [0.0, -0.04])
"""Feet [m], two of which no leg above reaches."""
FAR[1, 0] = (0.0, -0.5)
FAR[1, 2] = (np.nan, 0.0)

WIDE = ((-20.0, 20.0), (-20.0, 20.0))
"""Joint limits that every pose is within [rad]."""


def random_leg(rng: np.random.Generator) -> FiveBar:
    """Return a leg of unequal links that can close; a third is coaxial, a third has no L6."""
    while True:
        L1, L2, L3, L4, L5, L6 = rng.uniform(0.02, 0.1, 6).tolist()
        L5 = L5 * float(rng.integers(3) > 0)
        L6 = L6 * float(rng.integers(3) > 0)
        if 2.0 * max(L1, L2, L3, L4, L5) < L1 + L2 + L3 + L4 + L5:
            bend, tilt = rng.uniform(-3.0, 3.0, 2).tolist()
            return FiveBar(L1, L2, L3, L4, L5, L6, bend, tilt)


def pose(leg: FiveBar, foot: Array, theta: Array) -> Points:
    """Return the joints, with C from B and F alone, so of either assembly."""
    B, D = kinematics.knees(leg, theta)
    BF = leg.L2 + leg.L6 * np.exp(1j * leg.bend)  # in the frame of L2
    C = B + turned(foot - B, -float(np.angle(BF))) * (leg.L2 / abs(BF))
    return Points(B, C, C, D, foot)


def sine(a: Array, b: Array) -> Array:
    return np.abs(cross(a, b)) / (length(a) * length(b))


def length(v: Array) -> Array:
    return np.hypot(v[..., 0], v[..., 1])


def sample(
    leg: FiveBar, batch: tuple[int, ...], mode: Mode = (-1, 1), assembly: int = -1
) -> tuple[Array, Array]:
    """Return feet and angles of a branch where all three passive angles' sines are above 0.4."""
    foot, theta = _sampled(leg, mode, assembly)
    rows = slice(math.prod(batch))
    shape = (*batch, 2)
    return foot[rows].reshape(shape).copy(), theta[rows].reshape(shape).copy()


@cache
def _sampled(leg: FiveBar, mode: Mode, assembly: int) -> tuple[Array, Array]:
    """Return all that `sample` takes its first rows of."""
    foot = np.random.default_rng(1).uniform(-1.0, 1.0, (20_000, 2)) * leg.size
    theta = kinematics.inverse_all(leg, foot)[:, MODES.index(mode)]
    ok = np.isfinite(theta[:, 0])
    foot = foot[ok]
    theta = theta[ok]
    p = pose(leg, foot, theta)
    A, E = kinematics.bases(leg)
    BC = p.C_left - p.B
    DC = p.C_right - p.D
    sines = np.min([sine(BC, DC), sine(p.B - A, foot - p.B), sine(p.D - E, DC)], axis=0)
    good = (sines > 0.4) & (kinematics.branch(leg, p).assembly == assembly)
    return foot[good], theta[good]
