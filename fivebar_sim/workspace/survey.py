"""The workspace on a grid: the distance of each foot position from its edge."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.workspace import region

CELLS = 241
"""Grid points along the longer side of the map."""


class Map(NamedTuple):
    """Distances from the workspace's edge on a grid of foot positions, indexed [z, x].

    Attributes:
        x: Grid positions along x [m], hip frame, (m,).
        z: Grid positions along z [m], (n,).
        distance: Signed distance to the edge of the leg's own working mode's reach [m], (n, m).
    """

    x: Array
    z: Array
    distance: Array

    @property
    def area(self) -> float:
        """Area of the reachable region [m^2], to within a grid cell along its boundary."""
        cell = float((self.x[1] - self.x[0]) * (self.z[1] - self.z[0]))
        return cell * float((self.distance >= 0.0).sum())


def survey(leg: FiveBar, cells: int = CELLS, path: Array | None = None) -> Map:
    """Return the map of a leg's whole workspace.

    Args:
        leg: The leg.
        cells: Grid points along x and along z.
        path: Points that shall be on the map too [m], (n, 2).
    """
    A, _ = kinematics.bases(leg)
    # A little more than the foot can ever reach, whatever the angles.
    reach = 1.05 * (leg.L1 + leg.L2 + leg.L6 + float(np.hypot(*A)))
    seen = np.zeros((1, 2)) if path is None else path
    reach = max(reach, 1.05 * float(np.abs(seen).max()))
    line = np.linspace(-reach, reach, cells)
    foot = np.stack(np.meshgrid(line, line), axis=-1)
    distance = region.distance(leg, foot, mode=leg.mode)
    within = distance > 0.0
    columns, rows = (
        _span(np.any(within, axis=axis) | ((least <= line) & (line <= most)))
        for axis, least, most in zip((0, 1), seen.min(axis=0), seen.max(axis=0), strict=True)
    )
    return Map(line[columns], line[rows], distance[rows, columns])


def _span(found: ArrayLike) -> slice:
    """Return the slice from a margin before the first true value to a margin after the last."""
    where = np.flatnonzero(found)
    if not len(where):
        return slice(None)
    margin = np.size(found) // 20
    return slice(max(int(where[0]) - margin, 0), int(where[-1]) + margin + 1)
