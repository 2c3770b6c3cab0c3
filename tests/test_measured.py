"""All of metrics.json with types: one way out, one way in, and what the catalogue adds."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Mapping

import msgspec
import pytest
from judged import judged

from fivebar_sim import run
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import Limit, measured
from fivebar_sim.metrics.catalogue import Metric
from fivebar_sim.metrics.guards import Guard
from fivebar_sim.metrics.measured import Judged, with_verdict
from fivebar_sim.scenario import Scenario

HELD = Guard(name="loop", value=0.0, high=1.0, time=None, ok=True)
TRIPPED = Guard(name="loop", value=2.0, high=1.0, time=0.5, ok=False)


def test_result_travels_between_processes() -> None:
    result = run(Scenario.load("classic-ellipse", ["duration=0.8"]))
    for again in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
        assert again.measured == result.measured
        assert again.metrics == result.metrics
    assert result.metrics is result.metrics  # what a user changes there stays changed


def test_upper_bound_alone_is_written_without_a_lower_one() -> None:
    limits = [
        Limit("tracking.rms", -math.inf, 2e-3, 1e-3, True),
        Limit("load.share_A", 0.4, 0.6, None, False),
    ]
    assert with_verdict(judged({}), limits, {}).table["limits"] == [
        {"key": "tracking.rms", "low": None, "high": 2e-3, "value": 1e-3, "ok": True},
        {"key": "load.share_A", "low": 0.4, "high": 0.6, "value": None, "ok": False},
    ]


def test_rows_of_the_catalogue_come_first_and_extend_any_table() -> None:
    def some(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float:
        raise NotImplementedError

    keys = ("tracking.rms", "ground.depth", "load.jerk", "mine.worst")
    rows = [Metric(key, key, 1.0, "m", function=some, low=0.0) for key in keys]
    tables = measured.kinds(rows)
    kind = measured.with_rows("Mine", Judged, tables)
    fields = kind.__struct_fields__
    assert fields[:2] == ("tracking", "mine")
    assert sorted(fields[2:]) == sorted(Judged.__struct_fields__)
    assert {"load", "ground"} < set(fields)
    assert tables["load"].__struct_fields__[-2:] == ("saturated", "jerk")
    assert tables["ground"].__struct_fields__[0] == "force_max"
    with pytest.raises(msgspec.ValidationError, match=r">= 0\.0 - at `\$\.worst`"):
        msgspec.convert({"worst": -1.0}, tables["mine"])


@pytest.mark.parametrize(
    ("guard", "ok", "verdict"),
    [(HELD, True, "pass"), (HELD, False, "fail"), (TRIPPED, True, "fail")],
)
def test_verdict_needs_limits_and_guards(guard: Guard, ok: bool, verdict: str) -> None:
    found = judged({}, guards=[guard])
    limit = Limit("tracking.rms", 0.0, 1.0, 0.5 if ok else 2.0, ok)
    assert with_verdict(found, [limit], {}).verdict == verdict


@pytest.mark.parametrize(("guard", "verdict"), [(HELD, "not judged"), (TRIPPED, "fail")])
def test_verdict_without_limits_judges_nothing(guard: Guard, verdict: str) -> None:
    assert with_verdict(judged({}, guards=[guard]), [], {}).verdict == verdict
