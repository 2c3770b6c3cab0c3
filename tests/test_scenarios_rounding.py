"""Other rounding: commands off by 1e-13, as on another processor, change no verdict and no guard.

A run may be chaotic and its numbers differ; what is said of it must not hang on its last bits.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shipped import NAMES, planned, shortened
from test_guards import CASES, CHATTER, hurried

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.steps import Legs

PART = 1e-13
"""By how much every command is off: that many rad or N m, and that part of it."""


def outcome(result: Result) -> tuple[str, list[str]]:
    """Return the verdict and the guards that tripped."""
    return result.verdict, [each["name"] for each in result.metrics["guards"] if not each["ok"]]


def nudged(plan: Plan, times: int) -> list[Result]:
    """Return what comes of a plan as it is, then some times with every command off.

    All commands pass `Legs.advance`, or `Legs.once` where a controller sends them one by one.
    """
    rng = np.random.default_rng(20240607)
    advance = Legs.advance
    once = Legs.once

    def off(ctrl: Array) -> Array:
        noise = rng.uniform(-PART, PART, ctrl.shape)
        noise[0] = 0.0
        return ctrl + noise * (1.0 + np.abs(ctrl))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Legs, "advance", lambda legs, ctrl: advance(legs, off(ctrl)))
        patch.setattr(Legs, "once", lambda legs, ctrl: once(legs, off(ctrl)))
        return rollout.run_all([plan] * (1 + times))


def unmoved(results: list[Result]) -> bool:
    """Return whether the outcome is that of the first; every run must really be another."""
    first = results[0]
    for other in results[1:]:
        assert (other.record["theta_A"] != first.record["theta_A"]).any()
    return all(outcome(other) == outcome(first) for other in results)


@cache
def guarded(case: int) -> Plan:
    """Return the plan of a case of tests/test_guards.py, without limits."""
    name, settings = (("airhockey-pd", CHATTER), *(each[:2] for each in CASES))[case]
    return rollout.plan(Scenario.load(name, ["limits={}", *settings]))


GUARDED = range(1 + len(CASES))


@pytest.mark.parametrize("case", GUARDED)
def test_same_guards_trip(case: int) -> None:
    results = nudged(guarded(case), 1)
    assert unmoved(results)
    expected = [CASES[case - 1][2]] if case else ["torque", "chatter"]
    assert outcome(results[0]) == ("fail", expected)


def test_same_guard_trips_of_a_solver_that_is_hurried() -> None:
    assert unmoved(nudged(hurried(), 1))


@pytest.mark.parametrize("name", NAMES)
def test_same_verdict_of_what_is_shipped_in_short(name: str) -> None:
    assert unmoved(nudged(rollout.plan(shortened(name)), 1))


@pytest.mark.long
@pytest.mark.parametrize("case", GUARDED)
def test_same_guards_trip_every_time(case: int) -> None:
    assert unmoved(nudged(guarded(case), 16))


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_same_verdict_of_what_is_shipped(name: str) -> None:
    results = nudged(planned(name), 4)
    assert unmoved(results)
    assert outcome(results[0]) == ("pass", [])


def test_bound_that_a_run_sits_on_is_seen() -> None:
    """With the energy's bound at just what it is, some of many runs are beyond it."""
    settings = ["limits={}", "duration=0.75"]
    measured = rollout.run(Scenario.load("classic-ellipse", settings)).metrics["guards"]
    value = next(each["value"] for each in measured if each["name"] == "energy")
    edge = Scenario.load("classic-ellipse", [*settings, f"guards.energy={value!r}"])
    results = nudged(rollout.plan(edge), 16)
    assert outcome(results[0]) == ("not judged", [])
    assert not unmoved(results)
