"""How near a foot path comes to the edge of the workspace, and where it leaves it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.workspace import region


class Margin(NamedTuple):
    """The point of a path that is nearest to the edge, or farthest outside.

    Attributes:
        least: Its signed distance to the edge [m]: at least 0 where the foot reaches all of it.
        row: Its row in the path.
        left: First row that the foot cannot reach; None if it reaches all.
        outside: Part of the rows that it cannot reach.
    """

    least: float
    row: int
    left: int | None
    outside: float


def margin(leg: FiveBar, path: Array) -> Margin:
    """Return how near a path comes to the edge of what the foot reaches in its own working mode.

    Args:
        leg: The leg.
        path: Foot positions [m], hip frame, (n, 2), n at least 1.

    Raises:
        ArgumentError: Unless |x|, |z| < 1e150 m.
    """
    distance = region.distance(leg, path, mode=leg.mode)
    row = int(distance.argmin())
    lost = distance < 0.0
    left = int(lost.argmax()) if lost.any() else None
    return Margin(float(distance[row]), row, left, float(np.mean(lost)))
