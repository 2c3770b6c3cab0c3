"""Torque limits at the end of every step: the torque that a motion needed is never beyond them."""

from __future__ import annotations

import limited
import numpy as np
import pytest

from fivebar_sim import rollout
from fivebar_sim.errors import FiveBarError
from fivebar_sim.scenario import Scenario

EXACT = 1e-6
"""Of the limit: the momentum's balance cancels forces that are many times as large."""

RAIL_LANDING = [
    "path.ramp=0.05",
    "servo={kp=60.0, kd=0.5, limit=0.4, speed=25.0}",
    "controller.feedforward=torque",
]
CASES = {
    "kd against the line": ("rail-landing", RAIL_LANDING),
    "stiff": ("rail-hop", ["servo={kp=100.0, kd=0.002, limit=0.7}", "duration=1.0"]),
    "kd alone": ("rail-landing", ["servo={kp=8.0, kd=0.05, limit=0.32}"]),
    "no mode agrees": (
        "classic-ellipse",
        [
            "duration=0.75",
            "servo={kp=8.0, kd=0.045, limit=0.01, speed=2.0}",
            "sim.integrator=implicitfast",
            "controller.feedforward=velocity",
        ],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_no_step_is_beyond_the_limit(case: str) -> None:
    name, sets = CASES[case]
    ran = limited.run(name, [*sets, "limits={}"])
    assert limited.beyond(ran) < EXACT
    assert limited.untold(ran) < EXACT
    clips = ran.result.metrics["load"]["saturated"]
    assert 0.0 < max(clips["A"], clips["E"]) < 1.0


def check_random(seed: int) -> bool:
    """Return whether a random scenario ran and was clipped; fail if a step lies."""
    try:
        ran = limited.run(*limited.settings(seed))
    except FiveBarError:
        return False
    if ran.result.verdict != "fail":
        assert limited.beyond(ran) < 1e-3, seed
        assert limited.untold(ran) < 1e-3, seed
    clips = ran.result.metrics["load"]["saturated"]
    return ran.result.verdict != "fail" and max(clips["A"], clips["E"]) > 0.0


def test_random_limits_are_kept() -> None:
    for seed in (1, 6, 13):
        assert check_random(seed), seed


@pytest.mark.long
def test_many_random_limits_are_kept() -> None:
    """500 scenarios; about a fifth are clipped and pass."""
    clipped = sum(check_random(seed) for seed in range(500))
    assert clipped > 50


def test_a_torque_that_is_not_asked_for_is_not_clipped() -> None:
    """MuJoCo counts kp h v and kd v as torque: beyond the limit here, and not asked for."""
    sets = ["controller.feedforward=velocity", "servo.limit=0.05", "duration=0.75", "limits={}"]
    metrics = rollout.run(Scenario.load("classic-ellipse", sets)).metrics
    free = rollout.run(Scenario.load("classic-ellipse", [sets[0], *sets[2:]])).metrics
    assert metrics["load"]["saturated"] == {"A": 0.0, "E": 0.0}
    assert metrics["tracking"]["rms"] == pytest.approx(free["tracking"]["rms"], rel=1e-3)


def test_the_same_bits_alone_and_beside_others() -> None:
    name, sets = CASES["stiff"]
    more = [*sets, "limits={}", "duration=0.6"]
    servos = ["servo.limit=0.3", "servo.limit=0.7", "servo={kp=8.0, kd=0.05}"]
    plans = [rollout.plan(Scenario.load(name, [*more, servo])) for servo in servos]
    for together, plan in zip(rollout.run_all(plans, nthread=2), plans, strict=True):
        alone = rollout.execute(plan)
        for column, values in alone.record.items():
            np.testing.assert_array_equal(together.record[column], values, column)
