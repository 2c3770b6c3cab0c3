"""Intervals of a fit: Newey and West's covariance, and how many deviations an interval takes."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim.arrays import Array
from fivebar_sim.identify.intervals import NORMAL, lag, newey_west, quantile


def lasting(rng: np.random.Generator, count: int, n: int, rho: float) -> Array:
    """Return noise that forgets its past by a factor a sample, as it is after long, (count, n)."""
    r = rng.standard_normal((count, n))
    r[:, 0] /= np.sqrt(1.0 - rho**2)
    for k in range(1, n):
        r[:, k] += rho * r[:, k - 1]
    return r


def test_the_middle_is_the_sum_of_products_up_to_a_lag_apart() -> None:
    rng = np.random.default_rng(0)
    J = rng.standard_normal((150, 3))
    r = lasting(rng, 1, 150, 0.8)[0]
    S = np.zeros((3, 3))
    for begin, n in ((0, 90), (90, 60)):
        m = lag(r[begin : begin + n])
        g = J[begin : begin + n] * r[begin : begin + n, None]
        S += g.T @ g
        for k in range(1, m + 1):
            product = g[:-k].T @ g[k:]
            S += (1.0 - k / (m + 1.0)) * (product + product.T)

    inverse = np.linalg.inv(J.T @ J)
    wanted = 150 / 147 * inverse @ S @ inverse
    white = 150 / 147 * float(r @ r) / 150 * np.diag(inverse)
    wider = np.sqrt(np.maximum(white / np.diag(wanted), 1.0))
    found = newey_west(J, r, [90, 60])
    np.testing.assert_allclose(found.covariance, wanted * np.outer(wider, wider), rtol=1e-9)


def test_intervals_of_white_noise_are_the_textbooks() -> None:
    rng = np.random.default_rng(1)
    J = rng.standard_normal((4000, 2))
    found = newey_west(J, rng.standard_normal(4000), [2000, 2000])
    wanted = 1.96 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    np.testing.assert_allclose(found.half_widths, wanted, rtol=0.1)


def test_intervals_know_noise_that_lasts() -> None:
    """Means of blocks of k equal residuals are sqrt(k) times less sure than as many white ones."""
    noise = np.repeat(np.random.default_rng(2).standard_normal(800), 10)
    found = newey_west(np.ones((8000, 1)), noise, [4000, 4000])
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(1.0 / np.sqrt(800.0), rel=0.25)


def test_quantiles_are_those_of_means_over_their_own_spread() -> None:
    """Kiefer and Vogelsang's limit, by 4000 series of 200 white numbers less their mean."""
    n = 200
    e = np.random.default_rng(3).standard_normal((4000, n))
    mean = e.mean(axis=1)
    for b in (0.05, 0.1, 0.25):
        window = round(b * n)
        total = np.cumsum(np.pad(e - mean[:, None], ((0, 0), (window, window - 1))), axis=1)
        total[:, window:] -= total[:, :-window].copy()
        spread = np.sqrt((total**2).sum(axis=1) / window) / n
        wanted = np.quantile(np.abs(mean) / spread, 0.95)
        # The quantile of 4000 scatters by 1.5 %; the polynomial is 2 % on the safe side.
        assert quantile(np.array(b)) == pytest.approx(wanted, rel=0.04), b
    assert quantile(np.array(0.0)) == NORMAL


def test_means_of_lasting_noise_lie_in_their_intervals() -> None:
    """Means of 400 numbers that forget a tenth a sample: some 92 of 100, by the normal law 82."""
    series = lasting(np.random.default_rng(4), 500, 400, 0.9)
    J = np.ones((400, 1))
    found = [newey_west(J, noise - noise.mean(), [400]) for noise in series]
    off = np.abs(series.mean(axis=1))
    inside = np.mean([o < f.half_widths[0] for o, f in zip(off, found, strict=True)])
    normal = np.mean(
        [o < NORMAL * np.sqrt(f.covariance[0, 0]) for o, f in zip(off, found, strict=True)]
    )
    # 500 series scatter by 1 of 100.
    assert 0.91 < inside < 0.98
    assert normal < 0.89
