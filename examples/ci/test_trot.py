"""The trot of our leg, on every push."""

import pytest
from my_leg import Lead


def test_trot(leg_run):
    """All limits of trot.toml hold."""
    leg_run("trot.toml").assert_limits()


def test_lag_without_lead(leg_run):
    """What the lead is for: without it the foot trails by 2.5 mm."""
    result = leg_run("trot.toml", controller=Lead(lead=0.0))
    result.assert_metric("tracking.rms", low=2e-3, high=3e-3)


@pytest.mark.parametrize("length", [0.084, 0.086])
def test_legs_as_they_are_printed(leg_run, length):
    """L2 and L3 that are 1 mm off cost no more tracking than the limit allows."""
    result = leg_run("trot.toml", settings=[f"leg.L2={length}", f"leg.L3={length}"])
    result.assert_metric("tracking.rms", high=0.1e-3)
