"""The shipped scenarios of legs, and what comes of them, simulated once for all tests.

Those of robots, whose names begin with "robot-", have tests of their own.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import tomli_w
from shared import once

from fivebar_sim import rollout
from fivebar_sim.files import resources
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.runs import directory
from fivebar_sim.runs.anew import beside
from fivebar_sim.scenario import Scenario

NAMES = sorted(name for name in resources.shipped("scenarios") if not name.startswith("robot-"))
SCENARIOS = {name: Scenario.load(name) for name in NAMES}


@cache
def shortened(name: str) -> Scenario:
    """Return a scenario with the shortest run that is measured at all: its ramp and a period."""
    path = SCENARIOS[name].path
    return Scenario.load(name, [f"duration={path.ramp + (path.period or 0.3)}"])


@cache
def planned(name: str) -> Plan:
    return rollout.plan(SCENARIOS[name])


@cache
def results() -> dict[str, Result]:
    """Return what comes of all scenarios, simulated together on two threads."""
    return once("shipped", _simulated)


@cache
def in_short(name: str) -> Result:
    """Return what comes of a scenario in its shortest form, by itself."""
    return once(f"in-short-{name}", lambda: rollout.run(shortened(name)))


def _simulated() -> dict[str, Result]:
    return dict(zip(NAMES, rollout.run_all([planned(n) for n in NAMES], nthread=2), strict=True))


def written(name: str, folder: Path) -> Path:
    """Return a folder with what a run directory holds besides the recording, which takes longer."""
    result = results()[name]
    text = tomli_w.dumps(result.scenario.table())
    (folder / "scenario.toml").write_text(text, encoding="utf-8")
    for name, content in result.scenario.files.items():
        (folder / name).write_bytes(content)
    (folder / "metrics.json").write_text(json.dumps(result.metrics), encoding="utf-8")
    others = ["scenario.toml", "metrics.json", *result.scenario.files]
    directory.write_record(folder, result.record, others, beside.written(result.measured))
    return folder
