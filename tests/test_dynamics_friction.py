"""Gear friction in the laws of poses: it resists the motion, and `forward` undoes `inverse`."""

from __future__ import annotations

import math

import numpy as np
import pytest
from poses import RIGID, sample

from fivebar_sim import dynamics
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError

FRICTION = 0.3
"""[N m]."""


def motions(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    theta = sample(RIGID, (40,))[1]
    w = rng.uniform(-20.0, 20.0, theta.shape)
    alpha = rng.uniform(-900.0, 900.0, theta.shape)
    w[::4, 0] = 0.0
    return theta, w, alpha


# law


def test_friction_resists_the_motion_and_not_the_rest(rng: np.random.Generator) -> None:
    theta, w, alpha = motions(rng)
    free = dynamics.inverse(RIGID, theta, w, alpha)
    tau = dynamics.inverse(RIGID, theta, w, alpha, friction=FRICTION)
    np.testing.assert_allclose(tau - free, FRICTION * np.sign(w), rtol=0, atol=1e-13)
    assert (np.sum((tau - free) * w, -1) > 0.0).all()


def test_forward_undoes_inverse(rng: np.random.Generator) -> None:
    theta, w, alpha = motions(rng)
    tau = dynamics.inverse(RIGID, theta, w, alpha, friction=FRICTION)
    again = dynamics.forward(RIGID, theta, w, tau, friction=FRICTION)
    np.testing.assert_allclose(again, alpha, rtol=0, atol=1e-9)  # of 900, times M's condition
    slower = dynamics.forward(RIGID, theta, w, tau, friction=2.0 * FRICTION)
    M = dynamics.mass_matrix(RIGID, theta)
    lost = np.einsum("...ij,...j->...i", M, again - slower)
    np.testing.assert_allclose(lost, FRICTION * np.sign(w), rtol=0, atol=1e-12)


# refusal


@pytest.mark.parametrize("friction", [-1.0, math.nan, math.inf])
def test_bad_friction_is_refused(friction: float) -> None:
    theta = sample(RIGID, ())[1]
    still = (0.0, 0.0)
    for ask in (dynamics.inverse, dynamics.forward):
        with pytest.raises(ArgumentError, match=r"friction must be in \[0, inf\) N m, got"):
            ask(RIGID, theta, still, still, friction=friction)
