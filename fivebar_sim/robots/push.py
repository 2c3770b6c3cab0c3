"""Pushes on the trunk of a robot: a force for some time, and how the robot gets over it."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.geometry import LONGEST
from fivebar_sim.robots.measure import Trunk, lean
from fivebar_sim.scenario.forces import STRONGEST

OVER = float(np.deg2rad(1.0))
"""A trunk that leans by so much more than before the push is not over it [rad]."""

Vector = tuple[float, float, float]


class Push(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A constant force of the world on the trunk, in steps that begin within its time.

    Attributes:
        time: When it begins [s].
        duration: How long it lasts [s].
        force: Along the axes of the floor [N]: x where the robot faced at the start, y to the left.
        at: Where it acts, in the trunk's frame [m].
    """

    time: float
    duration: float
    force: Vector
    at: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check_number("time", self.time, "s", low=0.0, high=1e4)
        check_number("duration", self.duration, "s", low=0.0, high=1e4, strict=True)
        for value in self.force:
            check_number("force", value, "N", low=-STRONGEST, high=STRONGEST)
        for value in self.at:
            check_number("at", value, "m", low=-LONGEST, high=LONGEST)

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return self.time + self.duration

    def rows(self, timestep: float) -> slice:
        """Return the steps in which it acts: whole ones, at least one.

        Args:
            timestep: [s].
        """
        begin = round(self.time / timestep)
        return slice(begin, max(round(self.end / timestep), begin + 1))


def forces(pushes: Sequence[Push], steps: int, timestep: float) -> Array:
    """Return the force of each push in every step [N], (N, 3 pushes).

    Args:
        pushes: The pushes.
        steps: N.
        timestep: [s].
    """
    found = np.zeros((steps, 3 * len(pushes)))
    for k, push in enumerate(pushes):
        found[push.rows(timestep), 3 * k : 3 * k + 3] = push.force
    return found


def recovery(trunk: Trunk, pushes: Sequence[Push], *, fell: bool) -> float | None:
    """Return how long after the end of the last push the trunk is up as before for good [s].

    It is up as long as it leans by at most `OVER` more than it ever did before the first push.

    Args:
        trunk: The trunk after each step.
        pushes: At least one push.
        fell: Whether the robot fell.

    Returns:
        The time; None where it fell, or was not up again by the end of the run.
    """
    if fell:
        return None
    leaning = lean(trunk.quaternion)
    before = trunk.time <= min(push.time for push in pushes)
    after = trunk.time > max(push.end for push in pushes)
    bound = OVER + float(leaning[before].max(initial=0.0))
    off = np.flatnonzero(after & (leaning > bound))
    if not after.any() or (off.size and off[-1] == len(leaning) - 1):
        return None

    last = off[-1] if off.size else int(np.argmax(after)) - 1
    return max(0.0, float(trunk.time[last]) - max(push.end for push in pushes))
