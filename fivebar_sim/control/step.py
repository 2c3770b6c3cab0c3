"""The control step: what is seen, and what of a command reaches the motors. Written once.

Whoever drives a leg in the loop, a scenario's controller or an agent, observes and commands here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.checks import LARGEST, check_number
from fivebar_sim.control.bus import Bus, Steps
from fivebar_sim.control.interface import Observation
from fivebar_sim.control.noise import Noise
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Drive, Servo, ServoArrays
from fivebar_sim.errors import ArgumentError


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
    """Observations and commands of legs of one set of sensors and one servo, or one each.

    A control step at k, every `every` timesteps, is `observe(k)`, then `send(k, command)`; the
    steps that follow are reported to `moved`. Legs that `restart` are at other steps than the rest.

    Args:
        servo: Of all the legs, or one each; then they differ in gains, bus and delay alone.
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
        servo: Servo | Sequence[Servo],
        sensors: Sensors,
        drive: Drive,
        *,
        timestep: float,
        every: int,
        steps: int,
        start: Array,
        seeds: Sequence[int],
    ) -> None:
        nsim = len(start)
        servos = [servo] * nsim if isinstance(servo, Servo) else list(servo)
        ServoArrays.of(servos)  # refuses servos that differ in more than gains and bus
        self.every = every
        self._back_emf = servos[0].back_emf
        self._sensors = sensors
        self._drive = drive
        self._h = timestep
        late = round(min(sensors.delay / timestep, steps))  # later, only the start would be seen
        self._theta = np.empty((nsim, late + 1, 2))
        self._theta_dot = np.zeros_like(self._theta)
        noisy = sensors.noise > 0.0 or sensors.rate_noise > 0.0
        self._noise = Noise(nsim) if noisy else None
        self._bus = Bus(servos, drive, timestep=timestep, steps=steps, every=every)
        self.restart(np.arange(nsim), start, seeds)

    def restart(self, rows: NDArray[np.int64], start: Array, seeds: Sequence[int]) -> None:
        """Put some legs back to step 0.

        Args:
            rows: Which, (n,).
            start: (theta_A, theta_E) at rest [rad], (n, 2).
            seeds: Of their noise, (n,).
        """
        self._theta[rows] = start[:, None]
        self._theta_dot[rows] = 0.0
        self._bus.restart(rows, start if self._drive == "position" else np.zeros_like(start))
        if self._noise is not None:
            self._noise.restart(rows, seeds)

    def moved(self, theta: Array, theta_dot: Array) -> None:
        """Take note of the motor angles [rad] and rates [rad/s] of the last steps, (nsim, n, 2)."""
        self._theta = _last(self._theta, theta)
        self._theta_dot = _last(self._theta_dot, theta_dot)

    def observe(self, k: Steps) -> Observation:
        """Return what is seen at step k; the time is (nsim,) if k is."""
        sensors = self._sensors
        time = cast(float, k * self._h)
        theta = self._theta[:, 0]
        theta_dot = self._theta_dot[:, 0]
        if self._noise is not None:
            drawn = self._noise.draw()
            theta = theta + sensors.noise * drawn[:, 0]
            theta_dot = theta_dot + sensors.rate_noise * drawn[:, 1]
        if sensors.resolution > 0.0:
            theta = np.round(theta / sensors.resolution) * sensors.resolution
        return Observation(time, theta, theta_dot)

    def send(self, k: Steps, command: Array) -> Array:
        """Return what reaches the motors in each step until the next control step, (nsim, n, 2).

        A torque goes through a driver that makes up for the back-EMF it measures, so that the
        motor gives it up to its torque-speed line.

        Args:
            k: The step.
            command: (A, E) [rad or N m], (nsim, 2).
        """
        sent = self._bus.send(k, command)
        if self._drive == "position":
            return sent
        return sent + self._back_emf * self._theta_dot[:, -1:]


def _last(before: Array, new: Array) -> Array:
    """Return as many of the last steps as there were before, (nsim, n, 2), in memory of its own."""
    keep = before.shape[1]
    if new.shape[1] >= keep:
        return new[:, new.shape[1] - keep :].copy()
    return np.concatenate([before[:, new.shape[1] :], new], axis=1)
