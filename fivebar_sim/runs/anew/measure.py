"""The metrics of a run, from its record and its scenario alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fivebar_sim.arrays import Bools
from fivebar_sim.errors import FiveBarError, RunDirectoryError
from fivebar_sim.metrics.columns import Record
from fivebar_sim.metrics.limits import judge
from fivebar_sim.metrics.measured import Judged, with_verdict
from fivebar_sim.robots import measured as robots_measured
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.runs.anew import legs, robots
from fivebar_sim.runs.anew.beside import Beside
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import measure as of_leg
from fivebar_sim.simulation.plan import plan
from fivebar_sim.simulation.recorder import Recorder
from fivebar_sim.walking.measure import measure as measure_robot
from fivebar_sim.walking.plan import plan_scenario

NEAR = 1e-9
"""By how much a column may differ from what states of other columns give, as a part of it."""


def measured(file: Path, record: Record, scenario: Scenario, beside: Beside | None) -> Judged:
    """Return all that metrics.json said, computed anew.

    Args:
        file: The record's file, for messages.
        record: Its columns.
        scenario: What was run.
        beside: What its metadata has besides them.

    Raises:
        RunDirectoryError: The metadata lacks it, or the record is of no run of the scenario.
    """
    if beside is None:
        raise RunDirectoryError(
            f"{file.with_name('metrics.json')} is missing, and {file} is of a version that did not "
            "keep what measuring anew needs: run scenario.toml again"
        )

    unsolved = beside.steps(scenario.steps, scenario.sim.timestep)
    try:
        # A record that was made up may hold anything.
        with np.errstate(all="raise", under="ignore"):
            if isinstance(scenario, RobotScenario):
                return _of_robot(scenario, record, unsolved, beside)
            return _of_leg(scenario, record, unsolved, beside)
    except (FiveBarError, FloatingPointError) as error:
        raise RunDirectoryError(
            f"{file.with_name('metrics.json')} is missing, and the record cannot be measured: "
            f"{error}"
        ) from None


def _of_leg(scenario: Scenario, record: Record, unsolved: Bools, beside: Beside) -> Judged:
    """Return what a leg's run came to."""
    planned = plan(scenario)
    recorder = Recorder(planned)
    recorder.add(legs.states(planned, record, unsolved))
    if recorder.error is not None:
        raise recorder.error
    _check_alike(record, recorder.record)
    found = of_leg.measure(scenario, record, recorder.unrecorded)
    return with_verdict(found, judge(found.table, scenario.limits), beside.provenance)


def _of_robot(scenario: RobotScenario, record: Record, unsolved: Bools, beside: Beside) -> Judged:
    """Return what a robot's run came to."""
    went = robots.walk(plan_scenario(scenario), record, unsolved)
    _check_alike(record, went.record)
    found = measure_robot(went._replace(record=record))
    limits = judge(found.table, scenario.limits)
    return robots_measured.with_verdict(found, limits, beside.provenance)


def _check_alike(record: Record, again: Record) -> None:
    """Raise unless columns are those that the states of a run have.

    Raises:
        RunDirectoryError: Names the column.
    """
    for name, column in record.items():
        least = NEAR * float(np.abs(column).max())
        if not np.allclose(again[name], column, rtol=NEAR, atol=least):
            raise RunDirectoryError(f"its column {name} does not follow from the others")
