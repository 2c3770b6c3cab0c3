"""Steps of legs whose commands come a control period at a time, kept until they are asked for."""

from __future__ import annotations

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
        """Return the motors' angles and rates after the steps of the last `take`, (nsim, n, 2)."""
        ...

    def states(self) -> States:
        """Return the states after all steps, until MuJoCo first warned."""
        ...


class Singles:
    """Steps one by one, with nothing allocated in between.

    Args:
        legs: The legs; see `Legs.whole`.
        length: Most steps.
    """

    def __init__(self, legs: Legs, length: int) -> None:
        self._legs = legs
        self._count = 0
        live = legs.live()
        now = legs.states([each[:, None] for each in live], live[0][:, None, -2:], legs.warned())
        self._angles = now.qpos[..., MOTORS_FROM_END]
        self._rates = now.qvel[..., MOTORS_FROM_END]
        # Whole arrays, however little of them is needed: a call costs more than its bytes.
        self._pairs: list[Any] = [
            (np.empty((length, *now.shape), now.dtype), now) for now in (*live, legs.warned())
        ]

    def take(self, ctrl: Array) -> None:
        """Take one step with finite commands, (nsim, 1, nu)."""
        self._legs.once(ctrl[:, 0])
        for kept, now in self._pairs:
            kept[self._count] = now
        self._count += 1

    def latest(self) -> tuple[Array, Array]:
        """Return the motors' angles and rates, (nsim, 1, 2), which change with the next step."""
        return self._angles, self._rates

    def states(self) -> States:
        """Return the states after all steps, until MuJoCo first warned."""
        warned = self._pairs[-1][0][: self._count, :, :, 1].any(axis=(1, 2))
        count = int(np.argmax(warned)) + 1 if warned.any() else self._count
        *arrays, warnings = (kept[:count].swapaxes(0, 1) for kept, _ in self._pairs)
        ctrl = arrays[0][..., -self._legs.nu :]
        return self._legs.states(arrays, ctrl, warnings[:, -1])


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
