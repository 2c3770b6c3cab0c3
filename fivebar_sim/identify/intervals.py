"""How sure the numbers of a fit are, where its residuals are not white.

An encoder's counts repeat while a joint stands, and friction that the model does not know lasts.
So the covariance of the numbers is that of Newey and West, whose middle has the products of
gradients (row of J times residual) up to a lag m apart:

    cov = (J^T J)^-1 S (J^T J)^-1,   S = sum_t g_t g_t^T
                                         + sum_l (1 - l / (m + 1)) sum_t (g_t g_(t+l)^T + transpose)

S itself is known from few stretches of length m + 1 only, so that an error is not a normal one in
these standard deviations. How many of them a 95 % interval takes depends on b = (m + 1) / n:

    1.96 + 2.9694 b + 0.4160 b^2 - 0.5324 b^3

See: Newey and West 1987; Kiefer and Vogelsang 2005, A new asymptotic theory for
heteroskedasticity-autocorrelation robust tests, the Bartlett kernel at 97.5 % in table 1. We
simulated their limit with 40,000 series of 500: 1 to 2 % below the polynomial up to b = 0.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools

NORMAL = 1.96
"""Half-width of a 95 % interval in standard deviations that are known."""

LASTING = 10
"""The lag, in first lags at which residuals no longer hang together."""

MOST = 0.25
"""Longest lag, as a part of a log."""


class Spread(NamedTuple):
    """How far from the truth a fit's numbers may be.

    Attributes:
        covariance: Of the numbers, in their units squared, (p, p); infinite of one that
            no residual depends on.
        sure: Half of each 95 % interval, in standard deviations, (p,).
    """

    covariance: Array
    sure: Array

    @property
    def half_widths(self) -> Array:
        """Half of each 95 % interval, in the numbers' units, (p,)."""
        return self.sure * np.sqrt(np.diag(self.covariance))


def quantile(b: Array) -> Array:
    """Return the half-widths of 95 % intervals in standard deviations, by b = (m + 1) / n."""
    return NORMAL + 2.9694 * b + 0.4160 * b**2 - 0.5324 * b**3


def newey_west(J: Array, r: Array, lengths: Sequence[int]) -> Spread:
    """Return how far the numbers of a fit may be off.

    Args:
        J: Derivatives of the weighted residuals by the numbers, (m, p).
        r: The weighted residuals, (m,): one stretch of time after the other.
        lengths: Samples of each stretch; their sum is m.
    """
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-14, hermitian=True)
    free = len(r) / max(len(r) - J.shape[1], 1)
    parts = []
    begin = 0
    for n in lengths:
        residuals = r[begin : begin + n]
        window = lag(residuals) + 1
        middle = _middle(J[begin : begin + n] * residuals[:, None], window)
        parts.append((free * inverse @ middle @ inverse, window / n))
        begin += n

    lasting: Array = np.sum([part for part, _ in parts], axis=0)
    own = np.maximum(np.diag(lasting), 1e-300)
    # Stretches are independent: each one's share in the variance scatters with its own b.
    b = np.sum([(np.diag(part) / own) ** 2 * part_b for part, part_b in parts], axis=0)
    white = free * float(r @ r) / len(r) * np.diag(inverse)
    # Of residuals that are white after all the estimate scatters: it must not be the surer one.
    wider = np.sqrt(np.maximum(white / own, 1.0))
    covariance = lasting * np.outer(wider, wider)

    # The inverse knows nothing of what nothing depends on, and would call it exact.
    dead = np.flatnonzero(unmoved(J))
    covariance[dead, dead] = np.inf
    return Spread(covariance, quantile(b))


def unmoved(J: Array) -> Bools:
    """Return which numbers no residual depends on, (p,); J are the derivatives, (m, p)."""
    return np.asarray(~J.any(axis=0))


def _middle(g: Array, window: int) -> Array:
    """Return S of one stretch, (p, p).

    The triangle of weights is what sums over a sliding window have: S = sum_t w_t w_t^T / window,
    where w_t sums the gradients of the window that ends at t, in part before or after the stretch.
    """
    empty = np.zeros((window, g.shape[1]))
    total = np.cumsum(np.concatenate([empty, g, empty[:-1]]), axis=0)
    w = total.copy()
    w[window:] -= total[:-window]
    return w.T @ w / window


def lag(r: Array) -> int:
    """Return over how many samples gradients are taken to hang together.

    `LASTING` times the first lag at which the residuals do not, whose correlation is then within
    that of white ones, 2 / sqrt(n); so long, since weights fall from lag 1 on.

    Args:
        r: Residuals of one stretch, (n,).
    """
    most = max(1, int(MOST * len(r)))
    centred = r - r.mean()
    power = float(centred @ centred)
    if power == 0.0:
        return 1
    small = 2.0 / np.sqrt(len(r))
    for k in range(1, most):
        if abs(float(centred[:-k] @ centred[k:])) / power < small:
            return min(LASTING * k, most)
    return most
