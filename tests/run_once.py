"""Runs that are asked for again and again, and simulated once for all tests of a file."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario

DONE: list[tuple[Scenario, Result]] = []
"""Scenarios that allow no metric a part of its own, and what came of them."""


def run_once(scenario: Scenario, run: Callable[[], Result]) -> Result:
    """Run a scenario, or take what came of it before, whatever it allowed its metrics then.

    Args:
        scenario: The scenario.
        run: Runs it.
    """
    plain = msgspec.structs.replace(scenario, converge={})
    for done, result in DONE:
        if done == plain:
            return result._replace(scenario=scenario)
    result = run()
    DONE.append((plain, result))
    return result
