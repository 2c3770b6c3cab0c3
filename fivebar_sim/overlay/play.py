"""The commands of a log played through the simulated leg: `played(scenario, log)`."""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.logs import Log
from fivebar_sim.motion import Motion
from fivebar_sim.paths import Angles
from fivebar_sim.scenario import Scenario

ROUNDING = 1e-9
"""Times of a log this close before a step count as its begin [s]."""


class Played(msgspec.Struct, frozen=True):
    """A controller that sends what a log says was sent, each command until the next.

    Attributes:
        time: When each was sent [s], (n,).
        ctrl: (theta_A, theta_E) [rad], (n, 2).
    """

    reads: ClassVar[str] = "log"

    time: Array
    ctrl: Array

    def setpoints(
        self, leg: FiveBar, servo: Servo, motion: Motion, integrator: Integrator
    ) -> Array:
        """Return the last command sent at the begin of each step [rad], (N, 2)."""
        del leg, servo, integrator  # what was sent is known
        begins = motion.time[:-1] + ROUNDING
        last = np.searchsorted(self.time, begins, side="right") - 1
        return self.ctrl[np.maximum(last, 0)]


def played(scenario: Scenario, log: Log) -> Scenario:
    """Return a scenario in which a leg is sent a log's commands, from its first pose, at rest.

    The servo's own delay, rate and resolution act on them as on any command. The path is that of
    the log's angles.

    Args:
        scenario: Leg, servo, scene and step.
        log: With theta and ctrl of both motors.

    Raises:
        ConfigError: The log is too short, or lacks one of these.
        LoopOpenError: The leg cannot have the log's angles.
    """
    for name in ("theta_A", "theta_E", "ctrl_A", "ctrl_E"):
        if not log.has(name):
            raise ConfigError(
                f"{log.where}: {name} is missing: to play a log it must have all four"
            )

    time, ctrl = log.complete("ctrl_A", "ctrl_E")
    # The run begins with the first row that has both angles.
    begin = log.complete("theta_A", "theta_E")[0][0]
    path = Angles.of_log(log)
    h = scenario.sim.timestep
    steps = int(path.span / h * (1.0 + 1e-9))
    if steps < 2:
        raise ConfigError(f"{log.where}: lasts {path.span:g} s, less than two timesteps")

    return msgspec.structs.replace(
        scenario,
        path=path,
        controller=Played(time - begin, ctrl),
        controller_name="log",
        duration=steps * h,
        limits={},
    )
