"""`LegDynamics` and the functions of `dynamics` answer alike, to the last bit."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from test_dynamics_laws import CLASSIC, HEAVY, H, planned, state

from fivebar_sim import dynamics
from fivebar_sim.errors import ArgumentError

PAYLOAD = 0.2
OTHER = dataclasses.replace(HEAVY, assembly=-HEAVY.assembly)


def asked() -> list[tuple[str, tuple[Any, ...], dict[str, Any]]]:
    """Return every method with arguments that no default hides."""
    theta, w, alpha, F = state(HEAVY)
    still = (theta[0], 0.1 * w[0])
    laws = (lambda t, q, w: -0.01 * w, {"foot_force": lambda t, q, w: 0.1 * q})
    return [
        ("inverse", (theta, w, alpha, F), {"friction": 0.01}),
        ("forward", (theta, w, alpha, F), {"friction": 0.01}),
        ("bias", (theta, w), {}),
        ("mass_matrix", (theta,), {}),
        ("energy", (theta, w), {}),
        ("reflected_inertia", (theta,), {}),
        ("simulate", (*still, 1e-4, 6, laws[0]), {**laws[1], "every": 2}),
        ("integrate", (*still, (0.0, 0.03), laws[0]), {**laws[1], "rtol": 1e-9, "atol": 1e-10}),
    ]


@pytest.mark.parametrize(("name", "args", "more"), asked(), ids=lambda each: str(each)[:12])
def test_method_is_the_function(name: str, args: Any, more: Any) -> None:
    """The leg itself is of the other assembly, so that a lost argument changes the answer."""
    leg = dynamics.LegDynamics(OTHER, HEAVY.assembly, PAYLOAD)
    alone = getattr(dynamics, name)(OTHER, *args, **more, assembly=HEAVY.assembly, payload=PAYLOAD)
    np.testing.assert_equal(getattr(leg, name)(*args, **more), alone)
    empty = dynamics.LegDynamics(OTHER, HEAVY.assembly)
    assert not np.array_equal(getattr(empty, name)(*args, **more)[-1], alone[-1])


@pytest.mark.parametrize(
    ("name", "args"), [row[:2] for row in asked()], ids=lambda each: str(each)[:12]
)
def test_what_a_method_is_not_told_is_what_the_function_is_not_told(name: str, args: Any) -> None:
    leg = dynamics.LegDynamics(HEAVY)
    alone = getattr(dynamics, name)(HEAVY, *args)
    np.testing.assert_equal(getattr(leg, name)(*args), alone)


def test_method_of_a_planned_motion_is_the_function() -> None:
    q = planned(CLASSIC)
    leg = dynamics.LegDynamics(CLASSIC, payload=PAYLOAD)
    force = (1.0, 2.0)
    alone = dynamics.step_torques(CLASSIC, q, H, force, payload=PAYLOAD, friction=0.01)
    np.testing.assert_array_equal(leg.step_torques(q, H, force, friction=0.01), alone)
    bare = dynamics.step_torques(CLASSIC, q, H, payload=PAYLOAD)
    np.testing.assert_array_equal(leg.step_torques(q, H), bare)
    soft = dynamics.soft_loop(CLASSIC, q, H, 0.05, payload=PAYLOAD)
    np.testing.assert_array_equal(leg.soft_loop(q, H, 0.05), soft)
    held = dynamics.statics(CLASSIC, q[:, ::2], force)
    np.testing.assert_array_equal(leg.statics(q[:, ::2], force), held)


def test_leg_is_checked_once_and_stays() -> None:
    leg = dynamics.LegDynamics(HEAVY, payload=PAYLOAD)
    assert leg == dynamics.LegDynamics(HEAVY, payload=PAYLOAD)
    assert leg != dynamics.LegDynamics(HEAVY)
    with pytest.raises(dataclasses.FrozenInstanceError):
        leg.payload = 0.0  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(ArgumentError, match="assembly must be -1 or 1, got 2"):
        dynamics.LegDynamics(HEAVY, 2)
    for payload in (-1.0, float("nan")):
        with pytest.raises(ArgumentError, match="payload must be"):
            dynamics.LegDynamics(HEAVY, payload=payload)
