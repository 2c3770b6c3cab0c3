"""The same experiment in shorter steps, or over a shorter time."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from fivebar_sim.errors import ConfigError
from fivebar_sim.integrator import Integrator
from fivebar_sim.metrics.columns import GROUND_COLUMNS, JOINT_COLUMNS, TORQUE_COLUMNS, Record
from fivebar_sim.scenario.scenario import Scenario
from fivebar_sim.scenario.together import MOST_STEPS

SAME = 1e-6
"""Part of a column's largest value by which one period may differ from another that it repeats."""

PERIODS = 3
"""Periods that tell of all others: the first, which has the start in it, and two that are alike."""


def refined(scenario: Scenario, parts: int, integrator: Integrator) -> Scenario:
    """Return the same experiment in finer steps.

    A bus's rate is rounded to whole timesteps; here to those of the scenario itself, so that
    commands come at the same times. Control periods are whole timesteps already, and delays need
    not be.

    Args:
        scenario: The experiment.
        parts: Into how many steps each of its timesteps is cut.
        integrator: MuJoCo's integrator.

    Raises:
        ConfigError: The run has too many steps.
    """
    h = scenario.sim.timestep
    if scenario.steps * parts > MOST_STEPS:
        raise ConfigError(
            f"{scenario.name}: a run may have {MOST_STEPS} steps, got {scenario.steps * parts} at "
            f"a timestep of {h / parts:g} s"
        )

    servo = scenario.servo
    if servo.rate is not None:
        # The least is one step: a bus may be as fast as the timesteps.
        period = max(h, _whole(1.0 / servo.rate, h))
        whole = math.isclose(1.0, servo.rate * period)
        servo = msgspec.structs.replace(servo, rate=servo.rate if whole else 1.0 / period)
    return msgspec.structs.replace(
        scenario,
        servo=servo,
        sim=msgspec.structs.replace(scenario.sim, timestep=h / parts, integrator=integrator),
    )


def _whole(seconds: float, timestep: float) -> float:
    """Return a time in whole timesteps [s]."""
    # Within rounding it is whole already: its last bits are the scenario's.
    steps = round(min(seconds / timestep, MOST_STEPS))
    return seconds if math.isclose(seconds, steps * timestep) else steps * timestep


def shortened(scenario: Scenario, steps: int) -> Scenario:
    """Return the beginning of an experiment: some steps, or as many as it takes to measure any.

    Args:
        scenario: The experiment; one that is no longer is returned itself.
        steps: Of the same timestep.
    """
    path = scenario.path
    h = scenario.sim.timestep
    # A period after the ramp; a path without one is measured from the ramp's end on.
    least = path.ramp + (path.period if path.period is not None else path.ramp)
    # 1e-9: rounding must not make it a step longer.
    duration = h * max(steps, math.ceil(least / h * (1.0 - 1e-9)))
    if duration >= scenario.duration:
        return scenario
    return msgspec.structs.replace(scenario, duration=duration)


def brief(scenario: Scenario) -> Scenario:
    """Return the beginning of an experiment, as far as it tells of one that `repeats` itself.

    One without a period is returned itself.
    """
    path = scenario.path
    if path.period is None:
        return scenario
    steps = (path.ramp + PERIODS * path.period) / scenario.sim.timestep
    # Up to the next whole step, but not because of rounding.
    return shortened(scenario, math.ceil(steps * (1.0 - 1e-9)))


def repeats(scenario: Scenario, record: Record) -> bool:
    """Return whether all of a run repeats its second period after the ramp.

    Then it has forgotten how it began, and what comes later is the same again.

    Args:
        scenario: The run's.
        record: Its columns; joints, torques and the ground's force are looked at.
    """
    if scenario.path.period is None:
        return False
    steps = scenario.path.period / scenario.sim.timestep
    period = round(steps)
    begin = round(scenario.path.ramp / scenario.sim.timestep) + period
    if not math.isclose(steps, period) or scenario.steps < begin + 2 * period:
        return False

    columns = (*JOINT_COLUMNS, *TORQUE_COLUMNS, *GROUND_COLUMNS)
    for column in (record[name] for name in columns if name in record):
        later = column[begin:]
        moved = np.abs(later - np.resize(later[:period], later.shape))
        if not moved.max() <= SAME * np.abs(column).max():
            return False
    return True
