"""The bus to the servos: which command acts in each step, and to which angle it is rounded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Drive, Servo

Steps = int | NDArray[np.int64]
"""One step for all legs, or the step of each leg, (nsim,)."""


class Bus:
    """Commands on their way to the servos: delayed, sent at the bus's rate, rounded.

    One command is given every `every` timesteps, and `Servo.latched` says which of them acts.
    Angles are rounded to what can be commanded; torques are not. Where a delay ends within a step,
    the step gets the mean of the command before and the one after, by the time that each acts.

    Args:
        servos: One for each leg; they may differ only in gains, rate and delay.
        drive: Whether commands are angles or torques.
        timestep: h [s].
        steps: Timesteps in the run.
        every: Timesteps in a control period.
    """

    def __init__(
        self, servos: Sequence[Servo], drive: Drive, *, timestep: float, steps: int, every: int = 1
    ) -> None:
        # Used for its resolution alone, which all servos of a group share.
        self._servo = servos[0]
        self._drive = drive
        self._every = every
        self._steps = steps
        self._legs = np.arange(len(servos))
        self._rest = np.zeros((len(servos), 2))

        # Thousands of legs may have few distinct buses: one row of steps for each kind.
        kinds = {(servo.rate, servo.delay): servo for servo in servos}
        numbers = {kind: number for number, kind in enumerate(kinds)}
        self._kind = np.array([numbers[servo.rate, servo.delay] for servo in servos])
        latched = np.stack([servo.latched(steps, timestep) for servo in kinds.values()])
        older = np.stack([servo.latched(steps, timestep, 1) for servo in kinds.values()])
        # The control period whose command acts in each step; -1 before the first arrives.
        self._period = latched // every
        self._older = older // every
        self._part = np.array([servo.late(steps, timestep)[1] for servo in kinds.values()])
        self._is_split = bool(self._part.any())

        # If every command acts at once and until the next one, none needs to be stored.
        at_once = bool((self._period == np.arange(steps) // every).all())
        self._prompt = at_once and not self._is_split
        periods = 0 if self._prompt else -(-steps // every)
        self._commands = np.zeros((len(servos), periods, 2))

    def restart(self, rows: NDArray[np.int64], rest: Array) -> None:
        """Put some legs back to step 0.

        Args:
            rows: Indices of those legs, (n,).
            rest: Commands that act until the first one arrives [rad or N m], (n, 2).
        """
        self._rest[rows] = rest

    def send(self, k: Steps, command: Array) -> Array:
        """Return the commands that act from step k on, until the next one is sent, (nsim, n, 2).

        Args:
            k: The step.
            command: (A, E) [rad or N m], (nsim, 2). What is returned may be a view of it.
        """
        latest = k if isinstance(k, int) else int(k.max())
        n = min(self._every, self._steps - latest)
        if self._prompt:
            # As it is, in a tenth of the time that `repeat` takes.
            held = command[:, None] if n == 1 else np.repeat(command[:, None], n, axis=1)
            return self._round(held)

        if isinstance(k, int):
            self._commands[:, k // self._every] = command
            return self._look_up(np.arange(k, k + n)[None])
        self._commands[self._legs, k // self._every] = command
        return self._look_up(k[:, None] + np.arange(n))

    def send_all(self, commands: Array) -> Array:
        """Return the commands that act in each step of the run, (nsim, N, 2).

        Args:
            commands: The commands of all control periods [rad or N m], (nsim, periods, 2).
        """
        self._commands = commands
        return self._look_up(np.arange(self._steps)[None])

    def _look_up(self, k: NDArray[np.int64]) -> Array:
        """Return the commands that act in some steps, (nsim, n, 2)."""
        kind = self._kind[:, None]
        acting = self._of(self._period[kind, k])
        if not self._is_split:
            return acting
        part = self._part[self._kind][:, None, None]
        older = self._of(self._older[kind, k])
        # Legs whose delay is whole keep their bits beside others.
        return np.where(part > 0.0, acting + part * (older - acting), acting)

    def _of(self, period: NDArray[np.int64]) -> Array:
        """Return the commands of control periods (nsim, n); in period -1 the one at rest."""
        # Index -1 reads the last command, a legal place; the next line throws it away.
        sent = self._commands[self._legs[:, None], period]
        acting = np.where(period[..., None] < 0, self._rest[:, None], sent)
        return self._round(acting)

    def _round(self, acting: Array) -> Array:
        return self._servo.rounded(acting) if self._drive == "position" else acting
