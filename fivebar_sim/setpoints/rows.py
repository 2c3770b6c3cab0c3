"""The motor angles along a path, at equal steps of time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError
from fivebar_sim.scenario import Scenario

MOST = 100_000
"""Rows of the longest table; a microcontroller has room for fewer."""

WHOLE = 1e-6
"""How far a number of rows may be from a whole one: the rounding of decimals, such as 1 / 3 Hz."""


class Rows(NamedTuple):
    """Setpoints at equal steps of time.

    Attributes:
        name: Name of the scenario.
        leg: Name of the leg.
        rate: Rows a second [Hz].
        periodic: Whether the first row comes again after the last.
        theta: (theta_A, theta_E) [rad], continuous, (n, 2).
    """

    name: str
    leg: str
    rate: float
    periodic: bool
    theta: Array


def rows(scenario: Scenario, rate: float) -> Rows:
    """Return the motor angles along a scenario's path.

    A path that repeats gives one period at its own speed, without the ramp; any other its whole
    way from rest, to where it is held or the scenario ends.

    Args:
        scenario: The scenario; leg and path are used.
        rate: Rows a second [Hz].

    Raises:
        ArgumentError: A rate outside its range, or with no whole number of rows in a period.
        UnreachableError: The path leaves the workspace.
    """
    check_number("rate", rate, "Hz", low=0.0, high=1e5, strict=True)
    path = scenario.path
    period = path.period
    seconds = min(path.rest, path.end, scenario.duration) if period is None else period
    count = seconds * rate
    if count > MOST:
        raise ArgumentError(
            f"a table has at most {MOST} rows, got {count:.0f}: {rate:g} Hz for {seconds:g} s"
        )

    if period is None:
        # The last row is the last setpoint of the path, or just before its end.
        times = np.arange(math.floor(count + WHOLE) + 1) / rate
        foot = path.at(np.minimum(times, seconds)).position
    else:
        _check_whole(count, rate, period)
        foot = path.nominal(np.arange(round(count)) / rate).position

    if len(foot) < 2:
        raise ArgumentError(f"rate must give at least 2 rows in {seconds:g} s, got {rate:g} Hz")
    if path.outside == "nearest":
        foot = workspace.nearest(scenario.leg, foot)
    theta = np.unwrap(kinematics.inverse(scenario.leg, foot), axis=0)
    return Rows(scenario.name, scenario.leg.name, rate, period is not None, theta)


def _check_whole(count: float, rate: float, period: float) -> None:
    """Raise unless a period has a whole number of rows: else the path would jump at its end."""
    if round(count) >= 1 and abs(count - round(count)) <= WHOLE * count:
        return
    near = sorted({max(math.floor(count), 2), max(math.ceil(count), 2)})
    hint = " or ".join(f"{n / period:.9g}" for n in near)
    raise ArgumentError(
        f"rate must give a whole number of rows in the path's period of {period:g} s, got "
        f"{rate:g} Hz, {count:g} rows; use {hint} Hz"
    )
