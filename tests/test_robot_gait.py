"""Gaits: four feet on one path, each at its own phase and stride."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths import Gait as Steps
from fivebar_sim.paths import Step
from fivebar_sim.robots import LEGS, Gait, Hip, Robot

Q8BOT = Robot.load("q8bot")
STEP = Steps(frequency=2.0, centre=(0.005, -0.045), stride=0.03, lift=0.01, ramp=0.2)
TROT = {"FL": 0.0, "FR": 0.5, "RL": 0.5, "RR": 0.0}
LATE = np.linspace(0.2, 2.0, 181)
"""Times after the ramp [s]."""


def test_leg_is_ahead_by_its_phase() -> None:
    gait = Gait(path=STEP, phases={"FL": 0.0, "FR": 0.5, "RL": 0.75, "RR": -0.25})
    paths = gait.paths(Q8BOT)
    for leg in LEGS:
        wanted = STEP.at(LATE + gait.phases[leg] % 1.0 * 0.5)
        for got, expected in zip(paths[leg].at(LATE), wanted, strict=True):
            np.testing.assert_allclose(got, expected, atol=1e-12)
    np.testing.assert_array_equal(paths["RL"].at(LATE).position, paths["RR"].at(LATE).position)


def test_feet_start_from_rest_at_their_phases() -> None:
    paths = Gait(path=STEP, phases=TROT).paths(Q8BOT)
    for leg in LEGS:
        start = paths[leg].at(0.0)
        np.testing.assert_array_equal(start.velocity, 0.0)
        np.testing.assert_allclose(start.position, STEP.nominal(TROT[leg] * 0.5).position)


def test_stride_scales_x_about_the_middle() -> None:
    gait = Gait(path=STEP, phases=TROT, strides={"FL": 0.5, "FR": 1.0, "RL": -1.0, "RR": 0.0})
    paths = gait.paths(Q8BOT)
    straight = Gait(path=STEP, phases=TROT).paths(Q8BOT)
    for leg, stride in (gait.strides or {}).items():
        x, z = paths[leg].at(LATE).position.T
        x_full, z_full = straight[leg].at(LATE).position.T
        np.testing.assert_allclose(x - 0.005, stride * (x_full - 0.005), atol=1e-8)
        np.testing.assert_array_equal(z, z_full)


def test_mirrored_leg_steps_the_same_way_in_the_world() -> None:
    """Its hip frame is turned round, so that x in it is minus x along the trunk."""
    hips = {**Q8BOT.hips, "RR": Hip(pos=Q8BOT.hips["RR"].pos, mirrored=True)}
    turned = Gait(path=STEP, phases=TROT).paths(msgspec.structs.replace(Q8BOT, hips=hips))
    straight = Gait(path=STEP, phases=TROT).paths(Q8BOT)
    for got, expected in zip(turned["RR"].at(LATE), straight["RR"].at(LATE), strict=True):
        np.testing.assert_allclose(got, expected * [-1.0, 1.0], atol=1e-15)


@pytest.mark.parametrize("leg", LEGS)
def test_velocity_is_the_derivative_within_ramp_and_after(leg: str) -> None:
    gait = Gait(path=STEP, phases=TROT, strides=dict(zip(LEGS, (1.0, -0.5, 2.0, 0.3), strict=True)))
    path = gait.paths(Q8BOT)[leg]
    time = np.linspace(0.01, 1.0, 331)
    d = 1e-6
    slope = (path.at(time + d).position - path.at(time - d).position) / (2.0 * d)
    np.testing.assert_allclose(path.at(time).velocity, slope, atol=2e-6)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"phases": {"FL": 0.0}}, r"phases\.FR is missing"),
        ({"phases": {**TROT, "BL": 0.0}}, "phases: unknown leg 'BL'"),
        ({"phases": {**TROT, "RR": "half"}}, r"phases\.RR must be in \[-10, 10\], got 'half'"),
        ({"strides": {**TROT, "RR": 11.0}}, r"strides\.RR must be in \[-10, 10\], got 11\.0"),
    ],
)
def test_refusal(keys: dict, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Gait(**{"path": STEP, "phases": TROT, **keys})


def test_path_with_phases_must_repeat() -> None:
    once = Step(start=(0.0, -0.045), stop=(0.01, -0.045), lift=0.005, seconds=0.5)
    with pytest.raises(ArgumentError, match=r"phases must all be 0: the path"):
        Gait(path=once, phases=TROT)
