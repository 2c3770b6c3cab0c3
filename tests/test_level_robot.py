"""The closed loop over a whole robot: level on a slope, by joint angles and a noisy IMU."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

SCRIPT = runpy.run_path(str(Path(__file__).parents[1] / "scripts" / "level_robot.py"))
SLOPE = np.radians(6.0)


def test_trunk_is_level_and_as_high_as_it_was() -> None:
    """Within a third of a degree of noise; e^-4.5 of the slope's 6 degrees are left."""
    pitch, sunk = SCRIPT["settled"](SLOPE, held=True, seconds=1.5)
    assert np.degrees(pitch) == pytest.approx(0.0, abs=0.4)
    assert sunk == pytest.approx(0.0, abs=0.1e-3)


def test_trunk_of_held_motors_leans_as_the_floor() -> None:
    """Nose up, down points backward; and the servos' springs give way."""
    pitch, sunk = SCRIPT["settled"](SLOPE, held=False, seconds=0.3)
    assert np.degrees(pitch) == pytest.approx(-6.2, abs=0.3)
    assert 0.2e-3 < sunk < 0.5e-3
