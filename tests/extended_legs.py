"""Random legs with an extension, of every topology, and a search for their workspace's boundary."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.geometry import FiveBar

Draw = Callable[[np.random.Generator], FiveBar]


def leg_of(rng: np.random.Generator, L: Array, L5: float, L6: float | None = None) -> FiveBar:
    """Return a leg of links L, with an extension of 1 mm to 0.2 m, a bend and a tilt."""
    bend, tilt = rng.uniform(-3.0, 3.0, 2).tolist()
    drawn = 10.0 ** float(rng.uniform(-3.0, -0.7))
    L1, L2, L3, L4 = L.tolist()
    return FiveBar(L1, L2, L3, L4, float(L5), drawn if L6 is None else L6, bend, tilt)


def any_leg(rng: np.random.Generator) -> FiveBar:
    L = rng.uniform(0.02, 0.1, 4)
    return leg_of(rng, L, rng.uniform(max(0.0, 2.0 * L.max() - L.sum()), L.sum()))


def coaxial(rng: np.random.Generator) -> FiveBar:
    return leg_of(rng, rng.uniform(0.05, 0.1, 4), 0.0)


def no_hole(rng: np.random.Generator) -> FiveBar:
    """Return a leg of which neither F's ring about A nor C's about E has a hole."""
    a, b, c, bend = *rng.uniform(0.03, 0.1, 3).tolist(), float(rng.uniform(0.5, 2.5))
    rho = a * math.sqrt(2.0 - 2.0 * math.cos(math.pi - bend))  # of L2 = L6 = a, turned by bend
    return FiveBar(rho, a, b, b, 0.5 * c, a, bend, float(rng.uniform(-3.0, 3.0)))


def containing(rng: np.random.Generator) -> FiveBar:
    """Return a leg whose reach about E lies wholly inside C's disc about A."""
    a, c, d, gap = rng.uniform(0.1, 0.12), *rng.uniform(0.02, 0.04, 2), rng.uniform(0.01, 0.1)
    return leg_of(rng, np.array([a, a, c, d]), gap)


def narrow(rng: np.random.Generator) -> FiveBar:
    """Return a leg of two narrow rings, which cross in separate quadrangles."""
    a, b = rng.uniform(0.09, 0.11, 2)
    c, d = rng.uniform(0.01, 0.015, 2)
    return leg_of(rng, np.array([a, c, d, b]), rng.uniform(0.09, 0.12), float(c) * 0.5)


def multiples(rng: np.random.Generator) -> FiveBar:
    """Return a leg whose links are small multiples of one length: what can be in line, is."""
    while True:
        L = rng.integers(1, 9, 6) / 64.0
        L[4] *= rng.integers(0, 4) > 0
        if 2.0 * L[:5].max() < L[:5].sum():
            L1, L2, L3, L4, L5, L6 = L.tolist()
            return FiveBar(L1, L2, L3, L4, L5, L6)


def sliver(rng: np.random.Generator) -> FiveBar:
    """Return a leg that is stretched to within 1e-3 to 1e-5 of its size."""
    L = rng.uniform(0.03, 0.1, 4)
    return leg_of(rng, L, (1.0 - 10.0 ** rng.uniform(-5.0, -3.0)) * L.sum())


TOPOLOGIES = [any_leg, coaxial, no_hole, containing, narrow, sliver]

CORNER_CASES = {
    "B rests on E": FiveBar(0.05, 0.09, 0.04, 0.05, 0.05, 0.03, 0.7, 0.3),
    "B almost rests on E": FiveBar(0.05, 0.09, 0.04, 0.05 + 1e-11, 0.05 + 3e-11, 0.03, 0.7, 0.3),
    "C rests on A": FiveBar(0.05, 0.05, 0.03, 0.04, 0.07, 0.03, 0.7, 0.3),
    "C rests on A, folded": FiveBar(0.05, 0.05, 0.03, 0.07, 0.04, 0.03, 0.7, 0.3),
    "rhombus": FiveBar(0.05, 0.05, 0.02, 0.03, 0.05, 0.03, 0.7, 0.3),
    "double point": FiveBar(0.05, 0.06, 0.03, 0.04, 0.08, 0.03, 0.9, 0.3),
    "near a double point": FiveBar(0.05, 0.06, 0.03, 0.04, 0.08 - 1e-9, 0.03, 0.9, 0.3),
    "foot on A": FiveBar(0.05, 0.03, 0.04, 0.06, 0.03, 0.04, 0.5 * math.pi, 0.3),
    "equal coaxial": FiveBar(0.05, 0.05, 0.05, 0.05, 0.0, 0.05, math.pi * 2.0 / 3.0, 0.3),
    "no hole about E": FiveBar(0.05, 0.06, 0.05, 0.05, 0.08, 0.03, 0.9, 0.3),
    "long extension": FiveBar(0.04, 0.06, 0.055, 0.045, 0.03, 1.0, 0.9, 0.3),
    "foot near B": FiveBar(0.04, 0.06, 0.055, 0.045, 0.03, 0.06 * (1.0 + 1e-5), math.pi, 0.3),
    "fine side E": FiveBar(0.05, 0.06, 0.09, 0.001, 0.08, 0.03, 0.9, 0.3),
}


def search(leg: FiveBar, p: Array, inside: Bools, elbows: tuple[int, ...]) -> Array:
    """Return the least distance of p (n, 2) to the other side of the boundary, by scanning |AF|.

    1001 angles kappa between AB and BF, then four times 41 within two steps of the best. Every one
    is a circle about A on which C keeps its distance c from A, so E's reach cuts it in arcs whose
    ends the law of cosines gives. Points inside go to ends that no elbow covers and to points on
    their own ray that none reaches, those outside to any end, or to where their ray is reached.
    """
    z = ((p - kinematics.bases(leg)[0]) @ [1.0, 1j]) * np.exp(-1j * leg.tilt)
    offset = complex(*leg.foot_offset)
    kappa = np.linspace(0.0, math.pi, 1001)[None, :]
    width = math.pi / 1000
    gap = leg.L1 + abs(offset) - np.abs(z)
    if leg.L1 != pytest.approx(abs(offset), rel=1e-9):
        gap = np.minimum(gap, np.abs(z) - abs(leg.L1 - abs(offset)))
    best = np.where(inside, gap, np.inf)
    for _ in range(5):
        r = np.abs(leg.L1 + abs(offset) * np.exp(1j * kappa))
        C = []  # of a foot in direction 0; kappa > 0 is s_A = -1
        for s in elbows:
            BF = abs(offset) * np.exp(-1j * s * kappa)
            C.append((leg.L1 + BF * leg.L2 / offset) * np.conj(leg.L1 + BF) / np.maximum(r, 1e-99))
        ends = _ends(leg, C, np.angle(z)[:, None] + 0.0 * kappa)
        distances = [
            np.where(
                _counts(leg, C, angle, k, inside[:, None]),
                abs(z[:, None] - r * np.exp(1j * angle)),
                np.inf,
            )
            for k, angle in enumerate(ends)
        ]
        d = np.min(distances, axis=0)
        best = np.minimum(best, d.min(axis=1))
        middle = np.broadcast_to(kappa, d.shape)[np.arange(len(p)), d.argmin(axis=1)]
        kappa = np.clip(middle[:, None] + width * np.linspace(-2.0, 2.0, 41), 0.0, math.pi)
        width /= 10.0
    return best


def _ends(leg: FiveBar, C: list[Array], own: Array) -> list[Array]:
    """Return the directions in which arcs end, four for each elbow, after the points' own."""
    ends = [own]
    with np.errstate(divide="ignore", invalid="ignore"):
        for c in C:
            for radius in (abs(leg.L4 - leg.L3), leg.L4 + leg.L3):
                cosine = (abs(c) ** 2 + leg.L5**2 - radius**2) / (2.0 * abs(c) * leg.L5)
                ends += [s * np.arccos(cosine) - np.angle(c) + 0.0 * own for s in (1, -1)]
    return ends


def _counts(leg: FiveBar, C: list[Array], angle: Array, k: int, inside: Bools) -> Bools:
    """Return where direction k of `_ends` is on the other side of the boundary."""
    reach = [abs(c * np.exp(1j * angle) - leg.L5) for c in C]
    covered = [(abs(leg.L4 - leg.L3) <= x) & (x <= leg.L4 + leg.L3) for x in reach]
    if k == 0:
        return np.any(covered, axis=0) != inside
    # An end: its own elbow covers it but for rounding.
    own = (k - 1) // 4
    open_to = ~np.any(covered[:own] + covered[own + 1 :], axis=0)
    return np.isfinite(angle) & (open_to | ~inside)


def around(leg: FiveBar, rng: np.random.Generator, count: int) -> Array:
    return rng.uniform(-1.2, 1.2, (count, 2)) * (leg.size + 0.5 * leg.L5)


def length(v: Array) -> Array:
    return np.hypot(v[..., 0], v[..., 1])
