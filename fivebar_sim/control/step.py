"""The control step: what the sensors show, and what of a command reaches the motors.

Scenario controllers and learning agents both observe and command through this one class.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.checks import LARGEST, check_number
from fivebar_sim.control import delay
from fivebar_sim.control.bus import Bus, Steps
from fivebar_sim.control.interface import Observation
from fivebar_sim.control.noise import Noise
from fivebar_sim.control.sensors import Sensors
from fivebar_sim.control.servo import Drive, Servo, check_alike
from fivebar_sim.errors import ArgumentError


def check_whole_steps(name: str, seconds: float, timestep: float) -> None:
    """Raise unless a time is a whole number of timesteps, at least one.

    Raises:
        ArgumentError: It is not a whole number of timesteps, or below one.
    """
    check_number(name, seconds, "s", low=0.0, strict=True)
    # Over a tiny timestep the quotient can be infinite, which round refuses.
    steps = round(min(seconds / timestep, LARGEST))
    # Decimals are rounded as floats, 0.3 / 0.1 is 2.9999...: so a part in a million is let pass.
    if steps < 1 or abs(steps * timestep - seconds) > 1e-6 * seconds:
        raise ArgumentError(
            f"{name} must be a whole number of timesteps of {timestep:g} s, got {seconds!r} s"
        )


def whole_steps(name: str, seconds: float, timestep: float) -> int:
    """Return a time in whole timesteps.

    Raises:
        ArgumentError: It is not a whole number of timesteps, or below one.
    """
    check_whole_steps(name, seconds, timestep)
    return round(min(seconds / timestep, LARGEST))


class ControlStep:
    """Observations and commands of legs that share their sensors and their kind of servo.

    A control step at k, every `every` timesteps, is `observe(k)`, then `send(k, command)`; the
    steps that follow are reported to `moved`. After a `restart` some legs are at another step than
    the others.

    Args:
        servo: One servo for all legs, or one for each; those may differ only in gains, bus rate
            and delay.
        sensors: The sensors, the same for all legs.
        drive: Whether commands are angles or torques.
        timestep: h [s].
        every: Timesteps in a control period.
        steps: Timesteps in the run.
        start: (theta_A, theta_E) at rest at the start [rad], (nsim, 2).
        seeds: Seed of each leg's sensor noise, (nsim,).
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
        check_alike(servos)
        self.every = every
        # A torque goes through a driver that makes up for it; see `send`.
        self._back_emf = servos[0].back_emf if drive == "torque" else 0.0
        self._sensors = sensors
        self._drive = drive
        self._h = timestep
        # A delay longer than the run shows only the start, and would need a longer buffer.
        late, self._part = delay.in_steps(sensors.delay, timestep, steps)
        # The last states: the last row is the present, and `delay` ago is at row 0, or between it
        # and row 1.
        rows = late + 1 + (self._part > 0.0)
        self._theta = np.empty((nsim, rows, 2))
        self._theta_dot = np.zeros_like(self._theta)
        self._turning: Array | None = None
        noisy = sensors.noise > 0.0 or sensors.rate_noise > 0.0
        self._noise = Noise(nsim) if noisy else None
        self._is_exact = not noisy and sensors.resolution == 0.0 and self._part == 0.0
        self._bus = Bus(servos, drive, timestep=timestep, steps=steps, every=every)
        self.restart(np.arange(nsim), start, seeds)

    def restart(self, rows: NDArray[np.int64], start: Array, seeds: Sequence[int]) -> None:
        """Put some legs back to step 0.

        Args:
            rows: Indices of those legs, (n,).
            start: (theta_A, theta_E) at rest [rad], (n, 2).
            seeds: Seed of each one's sensor noise, (n,).
        """
        self._theta[rows] = start[:, None]
        self._theta_dot[rows] = 0.0
        self._measure()
        # Until a command arrives a servo holds where it stands, and a bare motor gives nothing.
        self._bus.restart(rows, start if self._drive == "position" else np.zeros_like(start))
        if self._noise is not None:
            self._noise.restart(rows, seeds)

    def moved(self, theta: Array, theta_dot: Array) -> None:
        """Store the motor angles [rad] and rates [rad/s] of the last n steps, (nsim, n, 2)."""
        self._theta = _last(self._theta, theta)
        self._theta_dot = _last(self._theta_dot, theta_dot)
        self._measure()

    def _measure(self) -> None:
        """Have the driver measure the motors' rates: an agent may write over what it is shown."""
        if self._back_emf:
            self._turning = self._back_emf * self._theta_dot[:, -1:]

    def observe(self, k: Steps, rows: NDArray[np.int64] | None = None) -> Observation:
        """Return what the sensors show at step k; the time is (nsim,) if k is.

        Args:
            k: The step.
            rows: Only the sensors of these legs are read; the others' noise goes on where it was.
                None: those of all legs.
        """
        time = cast(float, k * self._h)
        if self._is_exact:
            return Observation(time, self._theta[:, 0], self._theta_dot[:, 0])

        sensors = self._sensors
        theta = self._seen(self._theta)
        theta_dot = self._seen(self._theta_dot)
        if self._noise is not None:
            drawn = self._noise.draw(rows)
            theta = theta + sensors.noise * drawn[:, 0]
            theta_dot = theta_dot + sensors.rate_noise * drawn[:, 1]
        # After the noise: an encoder counts the angle that it sees, noise included.
        if sensors.resolution > 0.0:
            theta = np.round(theta / sensors.resolution) * sensors.resolution
        return Observation(time, theta, theta_dot)

    def _seen(self, states: Array) -> Array:
        """Return what was there `delay` ago, given the last states, (nsim, 2)."""
        if self._part == 0.0:
            return states[:, 0]
        return states[:, 1] + self._part * (states[:, 0] - states[:, 1])

    def send(self, k: Steps, command: Array) -> Array:
        """Return what reaches the motors in each step until the next control step, (nsim, n, 2).

        A torque goes through a driver that makes up for the back-EMF it measures, so that the
        motor gives it up to its torque-speed line.

        Args:
            k: The step.
            command: (A, E) [rad or N m], (nsim, 2).
        """
        sent = self._bus.send(k, command)
        if self._turning is None:
            return sent
        # The driver sits on the motor and knows its present rate, without the sensors' delay.
        return sent + self._turning


def _last(before: Array, new: Array) -> Array:
    """Return the last n of the old and new steps, as many as the old ones were, (nsim, n, 2).

    Always a copy.
    """
    if new.shape == before.shape:
        return new.copy()
    keep = before.shape[1]
    if new.shape[1] >= keep:
        return new[:, new.shape[1] - keep :].copy()
    return np.concatenate([before[:, new.shape[1] :], new], axis=1)
