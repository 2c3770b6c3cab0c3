"""What a log says of a leg, ready to be compared with simulated legs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.commanded import check_commands
from fivebar_sim.kinematics.logged import check_mostly
from fivebar_sim.logs.clock import check_follows

SETTLED = 1.0
"""Time after which a leg has forgotten how it was held before [s]: until a joint has moved in both
directions its friction remembers."""

LEAST = 200
"""Samples that a log must have."""


class Measured(NamedTuple):
    """A log of a leg that is sent angles.

    Attributes:
        name: The log's name.
        time: From 0 [s], (n,).
        theta: Angles of A and E [rad], (n, 2).
        ctrl: The angles that they were sent, each acting until the next [rad], (n, 2).
        current: What the motors drew [A], (n, 2); None where it is not known.
    """

    name: str
    time: Array
    theta: Array
    ctrl: Array
    current: Array | None = None

    @property
    def used(self) -> Bools:
        """Which samples are compared: those after the leg has settled, (n,)."""
        return self.time >= min(SETTLED, 0.25 * float(self.time[-1]))

    @property
    def start(self) -> Array:
        """The angles before the first command that is another one, their mean [rad], (2,)."""
        same = (self.ctrl == self.ctrl[0]).all(axis=1)
        count = len(same) if same.all() else int(same.argmin())
        return self.theta[:count].mean(axis=0)

    @property
    def interval(self) -> float:
        """Time between two samples [s]."""
        return float(np.median(np.diff(self.time)))


def check(log: Measured, leg: FiveBar) -> None:
    """Raise unless a log can be used for a leg.

    Raises:
        ConfigError: Too short, too slow, motors that are never moved, or sent what they never do.
        LoopOpenError: More than a few of its angles cannot be the leg's.
    """
    if len(log.time) < LEAST:
        raise ConfigError(
            f"{log.name}: identify needs at least {LEAST} samples, got {len(log.time)}"
        )
    still = np.ptp(log.ctrl, axis=0) == 0.0
    if still.all():
        raise ConfigError(f"{log.name}: the commands never change: nothing can be identified")
    check_follows(log.interval, log.name)
    check_mostly(leg, log.time, log.theta, log.name)
    check_commands(log.theta, log.ctrl, log.name)
