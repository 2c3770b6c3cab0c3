"""Other rounding: commands off by 1e-13, as on another processor, change no verdict and no guard.

A run may be chaotic and its numbers differ; what is said of it must not hang on its last bits.
"""

from __future__ import annotations

import numpy as np
import pytest
from shipped import NAMES, in_short, planned, results
from test_guards import CASES, CHATTER, ended, hurried

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
    """Return what comes of a plan some times, with every command off.

    All commands pass `Legs.advance`, or `Legs.once` where a controller sends them one by one.
    """
    rng = np.random.default_rng(20240607)
    advance = Legs.advance
    once = Legs.once

    def off(ctrl: Array) -> Array:
        return ctrl + rng.uniform(-PART, PART, ctrl.shape) * (1.0 + np.abs(ctrl))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Legs, "advance", lambda legs, ctrl: advance(legs, off(ctrl)))
        patch.setattr(Legs, "once", lambda legs, ctrl: once(legs, off(ctrl)))
        return rollout.run_all([plan] * times)


def unmoved(first: Result, others: list[Result]) -> bool:
    """Return whether all outcomes are that of the first; every run must really be another."""
    for other in others:
        assert (other.record["theta_A"] != first.record["theta_A"]).any()
    return all(outcome(other) == outcome(first) for other in others)


GUARDED = range(len(CASES))


@pytest.mark.parametrize("case", GUARDED)
def test_same_guards_trip(case: int) -> None:
    first = ended(case)
    assert outcome(first) == ("fail", [CASES[case][2]])
    assert unmoved(first, nudged(rollout.plan(first.scenario), 1))


def test_same_two_guards_trip() -> None:
    plan = rollout.plan(Scenario.load("airhockey-pd", ["limits={}", *CHATTER]))
    first = rollout.execute(plan)
    assert outcome(first) == ("fail", ["torque", "chatter"])
    assert unmoved(first, nudged(plan, 1))


def test_same_guard_trips_of_a_solver_that_is_hurried() -> None:
    plan = hurried()
    assert unmoved(rollout.execute(plan), nudged(plan, 1))


@pytest.mark.parametrize("name", NAMES)
def test_same_verdict_of_what_is_shipped_in_short(name: str) -> None:
    first = in_short(name)
    assert unmoved(first, nudged(rollout.plan(first.scenario), 1))


@pytest.mark.long
@pytest.mark.parametrize("case", GUARDED)
def test_same_guards_trip_every_time(case: int) -> None:
    first = ended(case)
    assert unmoved(first, nudged(rollout.plan(first.scenario), 16))


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_same_verdict_of_what_is_shipped(name: str) -> None:
    first = results()[name]
    assert unmoved(first, nudged(planned(name), 4))
    assert outcome(first) == ("pass", [])


def test_bound_that_a_run_sits_on_is_seen() -> None:
    """With the energy's bound at just what it is, some of many runs are beyond it."""
    settings = ["limits={}", "duration=0.75"]
    measured = rollout.run(Scenario.load("classic-ellipse", settings)).metrics["guards"]
    value = next(each["value"] for each in measured if each["name"] == "energy")
    edge = rollout.plan(Scenario.load("classic-ellipse", [*settings, f"guards.energy={value!r}"]))
    first = rollout.execute(edge)
    assert outcome(first) == ("not judged", [])
    assert not unmoved(first, nudged(edge, 16))
