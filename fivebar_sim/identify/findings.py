"""What a fit could tell, and what not: what cannot be told apart, what moves together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.identify.fit import Fit
from fivebar_sim.identify.intervals import NORMAL, unmoved
from fivebar_sim.identify.parameters import Parameter

CORRELATED = 0.9
"""Correlation of two numbers from which on it is worth a word."""

AT_END = 1e-3
"""How near the end of its range a number is that has run into it, in doubts."""

WORTH = 0.25
"""Smallest share of a number in a combination that is named."""


class Combination(NamedTuple):
    """A sum of numbers that the motion does not tell.

    Attributes:
        shares: Share of each number, in doubts, by key; the largest first.
        half_width: Half of its 95 % interval, in doubts: above 1.
    """

    shares: dict[str, float]
    half_width: float

    @property
    def words(self) -> str:
        """Such as "0.71 leg.L1 - 0.70 leg.L4"."""
        parts = [f"{'-' if s < 0.0 else '+'} {abs(s):.2f} {key}" for key, s in self.shares.items()]
        return " ".join(parts).removeprefix("+ ")


def untold(fit: Fit) -> list[Combination]:
    """Return what the motion does not tell: directions wider than what was in doubt beforehand.

    They are those of small singular values of the derivatives, in doubts and noise; what makes the
    intervals wider than white residuals would is put on top.
    """
    _, s, rows = np.linalg.svd(fit.jacobian, full_matrices=False)
    wider = inflation(fit)
    found = []
    for size, row in zip(s, rows, strict=True):
        half = NORMAL * wider / max(float(size), 1e-300)
        if half <= 1.0:
            continue
        order = np.argsort(-np.abs(row))
        # The largest share is positive: a combination has no sign of its own.
        signed = row * np.sign(row[order[0]])
        shares = {fit.parameters[i].key: float(signed[i]) for i in order if abs(row[i]) >= WORTH}
        found.append(Combination(shares, half))
    return found


def inflation(fit: Fit) -> float:
    """Return by how much intervals are wider than of known white residuals, the median."""
    known = ~unmoved(fit.jacobian)
    if not known.any():
        return 1.0

    doubt = np.array([each.doubt for each in fit.parameters])
    white = np.linalg.pinv(fit.jacobian.T @ fit.jacobian, rcond=1e-14, hermitian=True)
    plain = np.sqrt(np.maximum(np.diag(white), 1e-300)) * doubt
    return float(np.median((fit.half_widths / (NORMAL * plain))[known]))


def remarks(fit: Fit) -> list[str]:
    """Return a word on each number that is not to be trusted, "" for the others."""
    words = []
    unclear = {key for each in untold(fit) for key in each.shares}
    for each, value, half in zip(fit.parameters, fit.values, fit.half_widths, strict=True):
        said = ""
        if each.key in unclear or half > each.doubt:
            said = "not identified"
        elif min(value - each.low, each.high - value) < AT_END * each.doubt:
            said = "at the end of its range"
        words.append(said)
    return words


def correlated(fit: Fit) -> list[tuple[Parameter, Parameter, float]]:
    """Return pairs of numbers that move together, strongest first."""
    rho: Array = fit.correlations
    found = [
        (fit.parameters[i], fit.parameters[j], float(rho[i, j]))
        for i in range(len(rho))
        for j in range(i)
        if abs(rho[i, j]) >= CORRELATED
    ]
    return sorted(found, key=lambda each: -abs(each[2]))
