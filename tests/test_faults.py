"""Seeded faults: `fivebar check` of the shipped scenarios turns red for each, and for nothing else.

The short form runs the one scenario that a fault names, for its ramp and a period, against a
baseline of the same run without it that has the shipped one's tolerances. The long form runs all of
them whole for every fault, and prints who notices; it also looks for false alarms, under load and
with other rounding.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
from faults import MODEL, Fault
from faults_program import PROGRAM
from shell import Shell
from shipped import NAMES, in_short, shortened

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.errors import FiveBarError
from fivebar_sim.metrics import look_up
from fivebar_sim.regression import baseline, comparison
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.steps import Legs

FAULTS = (*MODEL, *PROGRAM)

REFUSED = {"knees on the wrong side", "sign of theta_B"}
"""Faults that leave nothing to simulate: the path is refused, by name, with exit status 2."""

WHOLE = REFUSED | {
    *("half the timestep", "torque limit left out"),
    *("delay of the servo ignored", "saturation not seen"),
}
"""Faults that the command is asked for, with the whole scenario: in a part of it none shows."""


def test_faults_are_many_and_each_is_one() -> None:
    assert len({fault.what for fault in FAULTS}) == len(FAULTS) >= 25
    assert {fault.seen_by for fault in FAULTS} <= set(NAMES)
    assert WHOLE <= {fault.what for fault in FAULTS}


def brief(name: str) -> Scenario:
    """Return a scenario of its ramp and a period, without limits, which are for all of it."""
    return Scenario.load(name, [f"duration={shortened(name).duration}", "limits={}"])


@cache
def without_fault(name: str) -> baseline.Baseline:
    """Return the baseline of a brief run, with the shipped one's tolerances."""
    shipped = baseline.read(baseline.place(name))
    right = in_short(name)._replace(limits=[])  # they are for all of it
    recorded = baseline.record(right.metrics, shipped)
    assert shipped is not None
    assert comparison.compare(right, recorded).failures == []
    return recorded


@pytest.mark.parametrize(
    "fault", [fault for fault in FAULTS if fault.what not in WHOLE], ids=attrgetter("what")
)
def test_fault_breaks_the_baseline(monkeypatch: pytest.MonkeyPatch, fault: Fault) -> None:
    recorded = without_fault(fault.seen_by)
    fault.put(monkeypatch)
    assert comparison.compare(rollout.run(brief(fault.seen_by)), recorded).failures != []


@pytest.mark.parametrize(
    "fault", [fault for fault in FAULTS if fault.what in WHOLE], ids=attrgetter("what")
)
@pytest.mark.usefixtures("light")
def test_fault_turns_the_check_red(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, fault: Fault
) -> None:
    monkeypatch.setattr(Result, "write", lambda result, path: path)  # what is kept is no matter
    fault.put(monkeypatch)
    said = shell("check", fault.seen_by)
    if fault.what in REFUSED:
        assert said.status == 2
        assert said.err.startswith(f"fivebar: {fault.seen_by}: path ")
        assert said.err.count("\n") == 1
    else:
        assert said.status == 1
        assert f"FAIL: {fault.seen_by}: " in said.out


# who notices what


def notices(name: str) -> bool:
    """Return whether a scenario fails its check, or cannot be run."""
    try:
        result = rollout.run(Scenario.load(name))
    except FiveBarError:
        return True
    return bool(comparison.compare(result, baseline.read(baseline.place(name))).failures)


def table(seen: dict[str, set[str]]) -> Iterator[str]:
    """Yield who notices what: a column for each scenario, a line for each fault."""
    for i, name in enumerate(NAMES):
        yield f"{'| ' * i}{name}"
    for what, by in seen.items():
        marks = " ".join("x" if name in by else "." for name in NAMES)
        yield f"{marks}  {len(by):2d}  {what}"


@pytest.mark.long
def test_every_scenario_against_every_fault(capsys: pytest.CaptureFixture[str]) -> None:
    assert [name for name in NAMES if notices(name)] == []  # without a fault nothing is red
    seen: dict[str, set[str]] = {}
    for fault in FAULTS:
        with pytest.MonkeyPatch.context() as patch:
            fault.put(patch)
            seen[fault.what] = {name for name in NAMES if notices(name)}
    with capsys.disabled():
        print("", *table(seen), sep="\n")  # noqa: T201
    assert [fault.what for fault in FAULTS if fault.seen_by not in seen[fault.what]] == []
    counts = {name: sum(name in by for by in seen.values()) for name in NAMES}
    assert min(counts.values()) >= 15, counts


# no false alarm

CHECKS = 50


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """Keep all processors busy with something else."""
    command = [sys.executable, "-c", "while True: pass"]
    others = [subprocess.Popen(command) for _ in range(processes)]
    try:
        yield
        assert [other.poll() for other in others] == processes * [None]
    finally:
        for other in others:
            other.kill()
            other.wait()


@pytest.mark.long
def test_no_alarm_in_many_checks_under_load(shell: Shell) -> None:
    first = shell("check", "--junit", "first.xml")
    with busy(os.cpu_count() or 1):
        for i in range(CHECKS):
            said = shell("check", "--junit", "again.xml")
            assert said == first, i
            assert said.status == 0, said.out
            assert Path("again.xml").read_bytes() == Path("first.xml").read_bytes()


def off(values: Array, rng: np.random.Generator) -> Array:
    """Return values that are off by a part of 1e-14, as where a processor rounds otherwise."""
    return values * (1.0 + rng.uniform(-1e-14, 1e-14, values.shape))


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_other_rounding_is_no_alarm(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator, name: str
) -> None:
    """Every command, and the start, off by 1e-14: no metric uses a thousandth of its tolerance."""
    scenario = Scenario.load(name)
    right = rollout.run(scenario).metrics
    advance = Legs.advance
    begin = Legs.__init__
    once = Legs.once
    monkeypatch.setattr(Legs, "advance", lambda legs, ctrl: advance(legs, off(ctrl, rng)))
    monkeypatch.setattr(Legs, "once", lambda legs, ctrl: once(legs, off(ctrl, rng)))
    monkeypatch.setattr(
        Legs, "__init__", lambda legs, m, q, *rest: begin(legs, m, off(q, rng), *rest)
    )
    for _ in range(3):
        metrics = rollout.run(scenario).metrics
        assert metrics != right
        for key, each in baseline.record(right).metrics.items():
            then = look_up(right, key)
            now = look_up(metrics, key)
            assert (then is None) == (now is None), key
            if then is not None and now is not None:
                assert abs(now - then) <= 1e-3 * each.tolerance, key
