"""The text of a recording: verdicts, limits with their values, metrics side by side."""

from __future__ import annotations

import math
from pathlib import Path

from judged import judged
from recorded import LEG, MEASURED, METRICS, ellipse, read, written

from fivebar_sim.recording.summary import summary
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.leg_words import leg_words

LIMITS = {"tracking.rms": (-math.inf, 1e-3), "closure.max": (0.0, 1e-6), "load.share_A": (0.4, 0.6)}


def test_one_run_has_its_limits_its_metrics_and_its_provenance() -> None:
    lines = summary(["trot"], [MEASURED], [LIMITS]).splitlines()
    assert lines[:15] == [
        "## trot: FAIL",
        "",
        "| limit | allowed | value | verdict |",
        "|:--|--:|--:|:--|",
        "| tracking RMS | <= 1 mm | 0.1235 mm | pass |",
        "| loop gap max (run) | 0 to 1 um | 3 um | **FAIL** |",
        "| load share A | 40 to 60 % | undefined | **FAIL** |",
        "",
        "| metric | value |",
        "|:--|--:|",
        "| tracking RMS | 0.1235 mm |",
        "| tracking max | 0.3 mm |",
        "| loop gap RMS (run) | 0.1 um |",
        "| loop gap max | undefined |",
        "| loop gap max (run) | 3 um |",
    ]
    assert lines[-6:-2] == [
        "| branch flips (run) | 0 |",
        "| MuJoCo warnings (run) | 0 |",
        "",
        "*trot: mujoco 3.17, seed 0*",
    ]
    assert lines[-1].startswith(
        "**Colours**: motor A and L1 blue, L2 and angle B light blue, motor"
    )
    assert "| load share A | undefined |" in lines
    assert not any("slip" in line for line in lines)  # there was no ground


def test_several_runs_stand_side_by_side() -> None:
    calm = judged(METRICS | {"ground.slip": 1e-3, "closure.rms": 2e-6})
    lines = summary(["a | b\n", "calm"], [MEASURED, calm], [{}, LIMITS]).splitlines()
    assert lines[:3] == ["## a \\| b: FAIL", "", "No limits set: guards alone can fail the run."]
    assert "## calm: PASS" in lines
    assert "| metric | a \\| b | calm |" in lines
    assert "| loop gap RMS (run) | 0.1 um | 2 um |" in lines
    assert "| slip, all stances |  | 1 mm |" in lines
    assert lines[-1] == "**Colours**: a \\| b blue, calm orange."


def test_it_is_in_the_recording(tmp_path: Path) -> None:
    _, static = read(written(tmp_path / "a.rrd", LEG, ellipse(LEG, 5)))
    limits = Scenario.load("classic-ellipse").limits
    text = summary(["round and round"], [MEASURED], [limits], [leg_words(LEG)])
    assert static["/summary"]["TextDocument:text"] == [[text]]


def test_limit_on_what_was_not_measured_is_broken() -> None:
    text = summary(["air"], [MEASURED], [{"ground.slip": (0.0, 1.0)}])
    assert "| slip, all stances | 0 to 1 m | undefined | **FAIL** |" in text
