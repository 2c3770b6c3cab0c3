"""How high a robot jumps, and how soon it is up there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Bools
from fivebar_sim.robots.measure import Trunk

STILL = 0.01
"""Part of the largest speed of a jump below which the trunk has not set off yet."""


class Jump(NamedTuple):
    """A jump.

    Attributes:
        height: Rise of the trunk's origin from where it set off to its apogee [m].
        agility: That height by the time that the rise took, the mean vertical speed [m/s].
        begin: When the trunk set off [s].
        apogee: When it was highest [s].
    """

    height: float
    agility: float
    begin: float
    apogee: float


def jump(trunk: Trunk, stands: Bools) -> Jump | None:
    """Return the highest jump of a run; None where the robot never left the floor upward.

    Its apogee is the highest place of the trunk while no foot stands. The jump began when the
    trunk last rose with less than `STILL` of the largest speed on the way up: height and time are
    those of the whole push, as in Haldane's vertical jumping agility, "from onset of actuation to
    apogee".

    Args:
        trunk: The trunk after every step.
        stands: Whether any foot was on the floor in each step, (N,).
    """
    flying = np.flatnonzero(~stands)
    if not len(flying):
        return None
    z = trunk.position[:, 2]
    apogee = int(flying[np.argmax(z[flying])])
    speed = np.diff(z[: apogee + 1]) / float(trunk.time[0])
    # A robot that only sinks, or is still in its first step, has not jumped.
    if not len(speed) or not speed.max() > 0.0:
        return None

    fastest = int(np.argmax(speed))
    slow = np.flatnonzero(speed[:fastest] < STILL * speed[fastest])
    begin = int(slow[-1]) + 1 if len(slow) else 0
    height = float(z[apogee] - z[begin])
    seconds = float(trunk.time[apogee] - trunk.time[begin])
    return Jump(height, height / seconds, float(trunk.time[begin]), float(trunk.time[apogee]))
