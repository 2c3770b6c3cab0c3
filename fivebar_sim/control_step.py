"""The control step: what is seen, and what of a command reaches the motors. Written once.

Whoever drives a leg in the loop, a scenario's controller or an agent, observes and commands here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.checks import LARGEST, check_number
from fivebar_sim.control import Drive, Observation
from fivebar_sim.errors import ArgumentError
from fivebar_sim.sensors import Sensors
from fivebar_sim.servo import Servo


def whole_steps(name: str, seconds: float, timestep: float) -> int:
    """Return a time in whole timesteps.

    Raises:
        ArgumentError: It is none, or less than one.
    """
    check_number(name, seconds, "s", low=0.0, strict=True)
    steps = round(min(seconds / timestep, LARGEST))
    if steps < 1 or abs(steps * timestep - seconds) > 1e-6 * seconds:
        raise ArgumentError(
            f"{name} must be a whole number of timesteps of {timestep:g} s, got {seconds!r} s"
        )
    return steps


class ControlStep:
    """Observations and commands of legs of one servo and one set of sensors.

    A control step at k, every `every` timesteps, is `observe(k)`, then `send(k, command)`; the
    steps that follow are reported to `moved`.

    Args:
        servo: Of all the legs.
        sensors: Of all the legs.
        drive: What the commands are.
        timestep: h [s].
        every: Timesteps of a control period.
        steps: Timesteps of the run.
        start: (theta_A, theta_E) at rest at the start [rad], (nsim, 2).
        seeds: Of each leg's noise, (nsim,).
    """

    def __init__(
        self,
        servo: Servo,
        sensors: Sensors,
        drive: Drive,
        *,
        timestep: float,
        every: int,
        steps: int,
        start: Array,
        seeds: Sequence[int],
    ) -> None:
        self.every = every
        self._servo, self._sensors, self._drive, self._h = servo, sensors, drive, timestep
        late = round(min(sensors.delay / timestep, steps))  # later, only the start would be seen
        self._theta = np.repeat(start[:, None], late + 1, axis=1)
        self._theta_dot = np.zeros_like(self._theta)
        self._noise = [np.random.default_rng(seed) for seed in seeds]
        self._latched = servo.latched(steps, timestep)
        rest = start if drive == "position" else np.zeros_like(start)
        self._commands = np.empty((len(start), steps + 1, 2))
        self._commands[:, -1] = rest  # row -1: before the first command has arrived

    def moved(self, theta: Array, theta_dot: Array) -> None:
        """Take note of the motor angles [rad] and rates [rad/s] of the last steps, (nsim, n, 2)."""
        keep = self._theta.shape[1]
        self._theta = np.concatenate([self._theta, theta], axis=1)[:, -keep:]
        self._theta_dot = np.concatenate([self._theta_dot, theta_dot], axis=1)[:, -keep:]

    def observe(self, k: int) -> Observation:
        """Return what is seen at step k."""
        sensors = self._sensors
        theta, theta_dot = self._theta[:, 0], self._theta_dot[:, 0]
        if sensors.noise > 0.0 or sensors.rate_noise > 0.0:
            drawn = np.stack([rng.standard_normal((2, 2)) for rng in self._noise])
            theta = theta + sensors.noise * drawn[:, 0]
            theta_dot = theta_dot + sensors.rate_noise * drawn[:, 1]
        if sensors.resolution > 0.0:
            theta = np.round(theta / sensors.resolution) * sensors.resolution
        return Observation(k * self._h, theta, theta_dot)

    def send(self, k: int, command: Array) -> Array:
        """Return what reaches the motors in each step until the next control step, (nsim, n, 2).

        A torque goes through a driver that makes up for the back-EMF it measures, so that the
        motor gives it up to its torque-speed line.

        Args:
            k: The step.
            command: (A, E) [rad or N m], (nsim, 2).
        """
        stop = min(k + self.every, self._commands.shape[1] - 1)
        self._commands[:, k:stop] = command[:, None]
        sent = self._commands[:, self._latched[k:stop]]
        if self._drive == "position":
            return self._servo.rounded(sent)
        return sent + self._servo.back_emf * self._theta_dot[:, -1:]
