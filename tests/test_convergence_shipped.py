"""The shipped scenarios are as good as their limits, or say in [converge] where not."""

from __future__ import annotations

import pytest
from shipped import NAMES, SCENARIOS

from fivebar_sim.regression import convergence

BAR = 0.02
"""What `fivebar converge` lets pass by default."""

QUICK = "classic-edge-line"
EACH = [name if name == QUICK else pytest.param(name, marks=pytest.mark.long) for name in NAMES]


@pytest.mark.parametrize("name", EACH)
def test_metrics_are_within_what_the_scenario_says(name: str) -> None:
    scenario = SCENARIOS[name]
    own = convergence.plans(scenario, convergence.FEWEST, scenario.sim.integrator)
    found = convergence.study(own)
    assert convergence.failures(found, BAR, scenario.converge) == []
    # What it says is needed, and no wider than it must be.
    assert set(scenario.converge) <= set(convergence.failures(found, BAR, {}))
    for key, allowed in scenario.converge.items():
        error = found.metrics[key].error
        assert error is not None
        assert allowed < 1.4 * error
