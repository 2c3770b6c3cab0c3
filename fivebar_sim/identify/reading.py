"""Logs of real legs as `identify` needs them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fivebar_sim import logs
from fivebar_sim.errors import ConfigError
from fivebar_sim.identify.measured import Measured, check
from fivebar_sim.scenario import Scenario

NEEDED = ("theta_A", "theta_E", "ctrl_A", "ctrl_E")
"""The channels without which nothing can be identified."""


def read(source: str, scenario: Scenario) -> Measured:
    """Return a log of a leg that was sent angles.

    Args:
        source: A data file, or a TOML file with a table [log]; see `logs.load`.
        scenario: The leg that it should be of; its kt makes currents of logged torques.

    Raises:
        ConfigError: The log cannot be read, lacks a channel, or is read in a wrong unit.
        LoopOpenError: It is another leg's.
    """
    found = logs.load(Path(source))
    missing = [name for name in NEEDED if not found.has(name)]
    if missing:
        raise ConfigError(
            f"{source}: {', '.join(missing)} is missing: identify compares the motors' angles with "
            "the angles that they were sent"
        )
    kt = scenario.servo.kt
    names = [*NEEDED]
    scale = 1.0
    if found.has("current_A", "current_E"):
        names += ["current_A", "current_E"]
    elif found.has("torque_A", "torque_E") and kt is not None:
        names += ["torque_A", "torque_E"]
        scale = kt

    rows = np.stack([found.channels[name] for name in names], axis=-1)
    there = np.isfinite(rows).all(axis=-1)
    if not there.any():
        raise ConfigError(f"{source}: no row has all of {', '.join(names)}")
    time = found.time[there]
    values = rows[there]
    log = Measured(
        name=Path(source).name,
        time=time - time[0],
        theta=values[:, 0:2],
        ctrl=values[:, 2:4],
        current=values[:, 4:6] / scale if len(names) > len(NEEDED) else None,
    )
    check(log, scenario.leg)
    return log
