"""Metrics against limits and baselines: what passes, fails, and is better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from judged import PROVENANCE, judged

from fivebar_sim import metrics
from fivebar_sim.metrics.catalogue import ABSOLUTE, LESS_IS_BETTER, SHOWN
from fivebar_sim.metrics.columns import Record
from fivebar_sim.metrics.guards import Guard
from fivebar_sim.regression import baseline, comparison
from fivebar_sim.regression.baseline import RELATIVE, Baseline, Recorded
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario

SCENARIO = Scenario.load("rail-hop")
KEYS = sorted(ABSOLUTE)
COLUMNS = ("foot_x", "foot_z", "target_x", "target_z")
AT_REST: Record = {name: np.zeros(SCENARIO.steps) for name in COLUMNS}
"""What a result's warnings look at."""


def result(
    values: dict[str, float | None],
    limits: dict[str, Any] | None = None,
    *,
    guards: Sequence[Guard] = (),
    provenance: Mapping[str, Any] = PROVENANCE,
) -> Result:
    """Return a result with some metrics."""
    measured = judged(values, guards=guards, provenance=provenance)
    return Result(SCENARIO, AT_REST, measured, metrics.judge(measured.table, limits or {}))


def recorded(values: dict[str, float | None], relative: float = RELATIVE) -> Baseline:
    """Return a baseline of some metrics."""
    each = {key: Recorded(value, ABSOLUTE[key], relative) for key, value in values.items()}
    return Baseline(baseline.Made(**PROVENANCE), each)


def verdict(key: str, then: float | None, now: float | None) -> str:
    checked = comparison.compare(result({key: now}), recorded({key: then}))
    assert [row.key for row in checked.rows] == [key]
    assert bool(checked.failures) == (checked.rows[0].verdict == comparison.FAIL)
    return checked.rows[0].verdict


@given(key=st.sampled_from(KEYS), then=st.floats(-1e3, 1e3), part=st.floats(-0.999, 0.999))
@example(key="tracking.rms", then=0.0, part=0.0)
def test_within_the_tolerance_passes(key: str, then: float, part: float) -> None:
    now = then + part * (ABSOLUTE[key] + RELATIVE * abs(then))
    assert verdict(key, then, now) == "pass"


@given(key=st.sampled_from(KEYS), then=st.floats(0.0, 1e3), times=st.floats(1.001, 1e6))
def test_beyond_the_tolerance_fails_or_is_better(key: str, then: float, times: float) -> None:
    moved = times * (ABSOLUTE[key] + RELATIVE * then)
    assert verdict(key, then, then + moved) == "FAIL"
    better = key.startswith(LESS_IS_BETTER)
    assert verdict(key, then, then - moved) == ("better" if better else "FAIL")


def test_what_may_not_fall_either_is_known() -> None:
    both = [key for key in KEYS if not key.startswith(LESS_IS_BETTER)]
    assert both == [
        "ground.flight_max",
        "ground.foot_height_max",
        "ground.foot_share",
        "ground.force_max.x",
        "ground.force_max.z",
        "ground.stance_share",
        "load.share_A",
        "load.thermal_share_A",
        "load.torque_rms.A",
        "load.torque_rms.E",
        "robot.agility",
        "robot.body_lengths_per_second",
        "robot.drift",
        "robot.jump_height",
        "robot.speed",
        "robot.turn_rate",
    ]


@pytest.mark.parametrize("key", KEYS)
def test_ten_percent_worse_fails_and_rounding_does_not(key: str) -> None:
    then = 100.0 * ABSOLUTE[key]
    assert verdict(key, then, 1.1 * then) == "FAIL"
    assert verdict(key, then, then * (1.0 + 5e-6)) == "pass"  # the six digits of a baseline


def test_what_is_undefined_on_one_side_fails() -> None:
    assert verdict("load.share_A", None, None) == "pass"
    assert verdict("load.share_A", 0.5, None) == "FAIL"
    assert verdict("load.share_A", None, 0.5) == "FAIL"
    gone = comparison.compare(result({}), recorded({"ground.slip": 1e-3}))  # it was a rail, once
    assert gone.failures == ["slip, all stances: undefined, baseline 1 mm"]


def test_limits_count_beside_baselines() -> None:
    values: dict[str, float | None] = {"tracking.rms": 1e-3, "closure.max": 1e-7}
    limits = {"tracking.rms": (-float("inf"), 0.9e-3), "warnings": (-float("inf"), 0.0)}
    checked = comparison.compare(result({**values, "warnings": 0}, limits), recorded(values))
    assert [(row.key, row.verdict) for row in checked.rows] == [
        ("tracking.rms", "FAIL"),  # as good as ever, and that is not good enough
        ("closure.max", "pass"),
        ("warnings", "pass"),
    ]
    assert checked.failures == ["tracking RMS: 1 mm, limit <= 0.9 mm"]


def test_rows_come_in_the_order_of_every_table() -> None:
    values: dict[str, float | None] = dict.fromkeys(reversed(KEYS), 1.0)
    rows = comparison.compare(result(values), recorded(values)).rows
    assert [row.key for row in rows] == [key for key in SHOWN if key in ABSOLUTE]


def test_tripped_guards_are_failures() -> None:
    passed = [
        Guard(name="branch", value=1.0, high=0.0, time=0.25, ok=False),
        Guard(name="loop", value=1e-3, high=2e-3, time=None, ok=True),
        Guard(name="torque", value=0.7, high=0.5, time=0.6, ok=False),
    ]
    checked = comparison.compare(result({"tracking.rms": 1e-3}, guards=passed), None)
    assert checked.failures == [
        "guard branch: the leg left its branch at t = 0.25 s; guard torque: a motor's torque had "
        "been clipped for more than 50 % of a second at t = 0.6 s, for 70 % at worst"
    ]


def test_failures_say_how_far_and_remarks_what_else() -> None:
    then = recorded({"tracking.rms": 1e-3, "closure.max": 2e-6})
    measured: dict[str, float | None] = {"tracking.rms": 1.1e-3, "closure.max": 1e-6}
    here = result(measured)
    checked = comparison.compare(here, then)
    assert checked.failures == ["tracking RMS: 1.1 mm, baseline 1 mm (+10.0 %; 5.001 um allowed)"]
    assert checked.remarks == ["better than its baseline: loop gap max (run); --update records it"]
    here = result(measured, provenance=PROVENANCE | {"mujoco": "3.18.0"})
    note = "its baseline was made with mujoco 3.17.0, now 3.18.0"
    assert comparison.compare(here, then).notes == [note]
    assert "no baseline" in comparison.compare(here, None).notes[0]


def test_metrics_that_a_baseline_lacks_are_named() -> None:
    measured: dict[str, float | None] = {"tracking.rms": 1e-3, "closure.max": 2e-6}
    here = result({**measured, "load.share_A": 0.6, "load.thermal_share_A": None})
    checked = comparison.compare(here, recorded({"tracking.rms": 1e-3}))
    assert checked.failures == []
    assert checked.remarks == [
        "its baseline lacks 2 of this run's metrics, which it judges by limits alone: "
        "closure.max, load.share_A; --update records them"
    ]


@pytest.mark.parametrize(
    ("then", "now", "change"),
    [
        (1.0, 1.1, "+10.0 %"),
        (1.0, 0.5, "-50.0 %"),
        (1.0, 1.0 + 1e-9, "0.0 %"),
        (1.0, 1.0 - 1e-9, "0.0 %"),
        (0.0, 0.0, "0.0 %"),
        (0.0, 0.01, "+1 %"),  # in the metric's unit, which is percent
        (None, 0.01, ""),
        (0.01, None, ""),
    ],
)
def test_change_is_in_percent(then: float | None, now: float | None, change: str) -> None:
    rows = comparison.compare(
        result({"load.saturated.A": now}), recorded({"load.saturated.A": then})
    ).rows
    assert rows[0].change == change


def test_accepted_differences_fail_no_more() -> None:
    then = recorded({"tracking.rms": 1e-3, "closure.max": 2e-6, "closure.rms": 1e-6})
    here = result({"tracking.rms": 1.1e-3, "closure.max": 1e-6, "closure.rms": 1e-6})
    accepted = comparison.accept(comparison.compare(here, then))
    assert [row.verdict for row in accepted.rows] == ["new", "pass", "new"]
    assert (accepted.failures, accepted.remarks) == ([], [])
