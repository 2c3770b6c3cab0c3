"""The path "sine": the tables of two robots, and rates that are rates."""

from __future__ import annotations

import numpy as np
import pytest

from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths import Sine

DOGGO = Sine(centre=(0.0, -0.17), stride=0.15, lift=0.06, push=0.04, duty=0.65, frequency=2.0)


def test_table_is_the_one_that_the_q8bot_plays() -> None:
    """TROT of its gait_manager.py, written out: 15 steps of lift, 30 of stance, 200 a second."""
    path = Sine(centre=(0.0, -0.04336), stride=0.04, lift=0.02, duty=30 / 45, frequency=200 / 45)
    lift = [(-20 + 40 * i / 15, -43.36 + 20 * np.sin(np.pi * i / 15)) for i in range(15)]
    down = [(20 - 40 * i / 30, -43.36) for i in range(30)]
    table = 1e-3 * np.array([*down, *lift])
    # The path begins in the middle of the stance.
    steps = np.arange(45)
    played = path.nominal(steps / 200.0).position
    np.testing.assert_allclose(played, np.roll(table, -15, axis=0), atol=1e-15)


def test_doggo_pushes_below_and_lifts_above_its_line() -> None:
    x, z = DOGGO.nominal(np.linspace(0.0, 0.5, 2001)).position.T
    assert z.min() == pytest.approx(-0.21, abs=1e-6)
    assert z.max() == pytest.approx(-0.11, abs=1e-6)
    assert np.ptp(x) == pytest.approx(0.15, abs=1e-4)
    assert np.mean(z < -0.17) == pytest.approx(0.65, abs=2e-3)
    assert DOGGO.stance_speed == pytest.approx(0.15 * 2.0 / 0.65)


def test_rates_are_derivatives_between_the_seams() -> None:
    h = 1e-6
    time = np.array([0.01, 0.1, 0.2, 0.25, 0.3, 0.45])
    now = DOGGO.nominal(time)
    before = DOGGO.nominal(time - h)
    after = DOGGO.nominal(time + h)
    np.testing.assert_allclose(
        (after.position - before.position) / (2 * h), now.velocity, atol=1e-6
    )
    slope = (after.velocity - before.velocity) / (2 * h)
    np.testing.assert_allclose(slope, now.acceleration, atol=1e-4)


@pytest.mark.parametrize(("key", "value"), [("duty", 1.0), ("lift", -0.01), ("push", -0.01)])
def test_what_no_foot_can_do_is_refused(key: str, value: float) -> None:
    numbers = {"centre": (0.0, -0.1), "stride": 0.05, "lift": 0.02, "frequency": 1.0}
    with pytest.raises(ArgumentError, match=f"{key} must be in"):
        Sine(**{**numbers, key: value})
