"""Steps of legs whose commands come a control period at a time, kept until they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.metrics.columns import MOTORS_FROM_END
from fivebar_sim.simulation.steps import Legs, States


class Taken(Protocol):
    """Some steps that follow each other."""

    def take(self, ctrl: Array) -> None:
        """Take the steps of a control period with finite commands, (nsim, n, nu)."""
        ...

    def latest(self) -> tuple[Array, Array]:
        """Return the motors' angles and rates after the steps of the last `take`, (nsim, n, 2).

        They may change with the next step.
        """
        ...

    def states(self) -> States:
        """Return the states after all steps, until MuJoCo first warned."""
        ...


class Singles:
    """Steps one by one, with nothing allocated in between.

    Args:
        legs: The legs; see `Legs.whole`.
        length: Most steps.
        every: Steps in a control period.
    """

    def __init__(self, legs: Legs, length: int, every: int = 1) -> None:
        self._legs = legs
        self._every = every
        self._count = 0
        live = legs.live()
        # Whole arrays, however little of them is needed: a call costs more than its bytes.
        self._pairs: list[Any] = [
            (np.empty((length, *now.shape), now.dtype), now) for now in (*live, legs.warned())
        ]
        kept = [each.swapaxes(0, 1) for each, _ in self._pairs]
        self._angles, self._rates = _motors(legs, kept[:-1])
        # Of a single step they are what MuJoCo has now: nothing is cut out of all steps.
        self._present = _motors(legs, [each[:, None] for each in live])

    def take(self, ctrl: Array) -> None:
        """Take the steps of a control period with finite commands, (nsim, n, nu)."""
        count = self._count
        for k in range(ctrl.shape[1]):
            self._legs.once(ctrl[:, k])
            for kept, now in self._pairs:
                kept[count] = now
            count += 1
        self._count = count

    def latest(self) -> tuple[Array, Array]:
        """Return the motors' angles and rates after the steps of the last `take`, (nsim, n, 2).

        They may change with the next step.
        """
        if self._every == 1:
            return self._present
        begin = (self._count - 1) // self._every * self._every
        return self._angles[:, begin : self._count], self._rates[:, begin : self._count]

    def states(self) -> States:
        """Return the states after all steps, until MuJoCo first warned."""
        warned = self._pairs[-1][0][: self._count, :, :, 1].any(axis=(1, 2))
        count = int(np.argmax(warned)) + 1 if warned.any() else self._count
        *arrays, warnings = (kept[:count].swapaxes(0, 1) for kept, _ in self._pairs)
        ctrl = arrays[0][..., -self._legs.nu :]
        return self._legs.states(arrays, ctrl, warnings[:, -1])


def _motors(legs: Legs, arrays: Sequence[Array]) -> tuple[Array, Array]:
    """Return the motors' angles and rates in what `Legs.live` lists, (nsim, n, 2)."""
    states = legs.states(arrays, arrays[0][..., -2:], legs.warned())
    return states.qpos[..., MOTORS_FROM_END], states.qvel[..., MOTORS_FROM_END]


class Periods:
    """Steps a period at a time.

    Args:
        legs: The legs.
    """

    def __init__(self, legs: Legs) -> None:
        self._legs = legs
        self._parts: list[States] = []

    def take(self, ctrl: Array) -> None:
        """Take some steps with finite commands, (nsim, n, nu)."""
        self._parts.append(self._legs.advance(ctrl))

    def latest(self) -> tuple[Array, Array]:
        """Return the motors' angles and rates after the last steps, (nsim, n, 2)."""
        last = self._parts[-1]
        return last.qpos[..., MOTORS_FROM_END], last.qvel[..., MOTORS_FROM_END]

    def states(self) -> States:
        """Return the states after all steps, until MuJoCo first warned."""
        warned = [bool(part.warnings.any()) for part in self._parts]
        count = warned.index(True) + 1 if any(warned) else len(warned)
        return States.joined(self._parts[:count])
