"""What a robot's own sensors would have logged of a run: late, noisy, in steps, at the bus's rate.

The servo's delay is taken out of the commands: a log has them as they were sent.
"""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control.interface import Feedback
from fivebar_sim.errors import ConfigError
from fivebar_sim.logs import Log
from fivebar_sim.metrics.columns import Record, motors
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario


def log_of(scenario: Scenario, record: Record, name: str = "") -> Log:
    """Return the log of a run, with the scenario's sensors: their delay, noise and resolution.

    Args:
        scenario: What was run; its seed is that of the noise.
        record: The run's record.
        name: What the log is called in messages.

    Raises:
        ConfigError: A robot's run.
    """
    check_leg(scenario)
    h = scenario.sim.timestep
    sensors = scenario.sensors
    every = scenario.command
    time: Array = np.arange(every, scenario.steps + 1, every, dtype=np.float64) * h
    random = np.random.default_rng(scenario.sim.seed)
    theta = _at(record, "theta", time - sensors.delay)
    theta = theta + sensors.noise * random.standard_normal(theta.shape)
    if sensors.resolution:
        theta = sensors.resolution * np.round(theta / sensors.resolution)
    rate = _at(record, "theta_dot", time - sensors.delay)
    rate = rate + sensors.rate_noise * random.standard_normal(rate.shape)

    found = {"theta": theta, "theta_dot": rate}
    controller = scenario.controller
    if not isinstance(controller, Feedback) or controller.drive == "position":
        found["ctrl"] = _sent(scenario, record, time)
    # A servo answers with its current beside its angle.
    torque = _at(record, "torque", time - sensors.delay)
    found["torque"] = torque
    if scenario.servo.kt is not None:
        found["current"] = torque / scenario.servo.kt
    channels = {
        f"{name}_{motor}": values[:, k]
        for name, values in found.items()
        for k, motor in enumerate("AE")
    }
    return Log(name or scenario.name, time - time[0], channels, every * h)


def check_leg(scenario: Scenario) -> None:
    """Raise for a robot: a log is one leg's.

    Raises:
        ConfigError: It is a robot's.
    """
    if isinstance(scenario, RobotScenario):
        raise ConfigError(f"logs are of one leg, and {scenario.name} is a robot's scenario")


def _at(record: Record, name: str, time: Array) -> Array:
    """Return columns of A and E at some times, on straight lines between the steps, (n, 2)."""
    return np.stack(
        [np.interp(time, record["time"], column) for column in motors(record, name).T], axis=-1
    )


def _sent(scenario: Scenario, record: Record, time: Array) -> Array:
    """Return the commands that were sent last at some times [rad], (n, 2).

    Row k of a record is the step from k h to (k + 1) h; what acts there was sent a delay before.
    """
    h = scenario.sim.timestep
    # A tenth of a step: a time that is a step's begin belongs to that step, however it is rounded.
    step = np.floor((time + scenario.servo.delay) / h + 0.1).astype(np.int64)
    return motors(record, "ctrl")[np.clip(step, 0, scenario.steps - 1)]
