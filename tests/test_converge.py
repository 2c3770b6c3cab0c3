"""The command `fivebar converge`: what it finds, prints and refuses."""

from __future__ import annotations

import json

import pytest
from run_once import run_once
from shell import Shell

from fivebar_sim import rollout
from fivebar_sim.errors import DivergedError
from fivebar_sim.metrics.catalogue import ABSOLUTE

WRONG = (
    "treadmill-trot",
    *("--set", "sim.integrator=implicitfast"),
    *("--set", "sim.timestep=0.00016"),
    *("--set", "duration=0.8"),
)
"""A run whose share is wrong by a seventh."""


def test_wrong_share_is_seen(shell: Shell) -> None:
    """The guard contact sees it in each run; three runs give the limit that `discrete` has too."""
    said = shell("converge", *WRONG, "--json")
    found = json.loads(said.out)
    assert said.status == 1
    assert found["timesteps"] == [1.6e-4, 0.8e-4, 0.4e-4]
    assert [len(run) for run in found["tripped"]] == [1, 1, 1]
    assert all("guard contact: a foot that should stick" in run[0] for run in found["tripped"])
    share = found["metrics"]["load.share_A"]
    torque = found["metrics"]["load.torque_rms.E"]
    assert share["value"] > 0.6
    assert share["limit"] == pytest.approx(0.5245, abs=4e-3)
    assert share["order"] == pytest.approx(1.2, abs=0.2)
    assert share["error"] > 0.12
    assert torque["limit"] == pytest.approx(0.2125, rel=0.02)
    other = found["other"]
    assert other["integrator"] == "discrete"
    assert other["metrics"]["load.share_A"]["limit"] == pytest.approx(0.5245, abs=4e-3)
    assert {"load.share_A", "load.torque_rms.E"} <= set(found["failed"])


@pytest.fixture
def each_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulate no run again: what a command says of it is asked."""
    execute = rollout.execute
    monkeypatch.setattr(
        rollout, "execute", lambda plan: run_once(plan.scenario, lambda: execute(plan))
    )


@pytest.mark.usefixtures("each_once")
def test_table_says_what_the_json_says(shell: Shell) -> None:
    args = ("converge", "short.toml", "--alone")
    said = shell(*args)
    found = json.loads(shell(*args, "--json").out)
    assert said.status == 0
    assert (found["failed"], found["other"]) == ([], None)
    assert set(found["metrics"]) == {
        key for key in ABSOLUTE if key.split(".")[0] in ("tracking", "load", "whole")
    }
    row = next(line for line in said.out.splitlines() if "tracking RMS" in line)
    value = found["metrics"]["tracking.rms"]["value"]
    assert f"{1e3 * value:.4g} mm" in row
    assert row.rstrip().endswith("pass")
    assert "…" not in said.out
    assert shell(*args, "--quiet").out == ""


@pytest.mark.usefixtures("each_once")
def test_bar_and_table_decide(shell: Shell) -> None:
    tight = ("converge", "short.toml", "--alone", "--bar", "1e-9")
    assert shell(*tight).status == 1
    failed = json.loads(shell(*tight, "--json").out)["failed"]
    allowed = [part for key in failed for part in ("--set", f"converge.{key}=1.0")]
    assert shell(*tight, *allowed).status == 0
    assert shell(*tight, *allowed[:-2]).status == (1 if len(failed) else 0)


def test_what_cannot_be_tried_is_refused(shell: Shell) -> None:
    few = shell("converge", "short.toml", "--halvings", "1")
    assert (few.status, few.err) == (2, "fivebar: short.toml: halvings must be 2 to 6, got 1\n")
    below = shell("converge", "short.toml", "--bar=-1")
    assert (below.status, below.err) == (2, "fivebar: --bar must be in [0, inf) %, got -1\n")
    key = shell("converge", "short.toml", "--set", "converge.tracking=1")
    assert key.status == 2
    assert "unknown key 'tracking'" in key.err
    low = shell("converge", "short.toml", "--set", "converge.tracking.rms=[0.1,1]")
    assert "must be a relative error in [0, inf), got [0.1, 1.0]" in low.err


def test_run_that_breaks_down_is_named(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    executed = rollout.execute

    def broken(planned: rollout.Plan) -> rollout.Result:
        if planned.scenario.sim.integrator == "implicitfast":
            raise DivergedError("short: it flew apart", 0.1)
        return executed(planned)

    monkeypatch.setattr(rollout, "execute", broken)
    beside = shell("converge", "short.toml")
    assert beside.status == 0
    line = "fivebar: implicitfast at a timestep of 0.001 s: short: it flew apart\n"
    assert beside.err == line
    own = shell("converge", "short.toml", "--set", "sim.integrator=implicitfast")
    assert (own.status, own.err) == (1, line)
