"""What lies on the floor of a robot's scene: its heights, as numbers.

A kind is a frozen table; MuJoCo's bodies of it are made in `model.ground`.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import LONGEST

MOST = 1000
"""Cells along a side of rough ground, and steps of a stair: so many are still drawn."""

FINEST = 1e-4
"""Shortest length of a cell or of a step [m]."""

RINGS = np.sin(np.linspace(0.0, 0.5 * np.pi, 65))
"""Radii at which a ball's lower half is felt, as parts of its own: closest at its edge."""

ROUND = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
"""Directions in which it is felt [rad]."""


class Ground(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"
):
    """The ground; the base of every kind."""

    level: ClassVar[bool] = False
    """Whether it is the floor alone."""

    @property
    def words(self) -> str:
        """What it is, for reports: " with rough ground of 5 mm"; nothing of a flat floor."""
        return ""

    def heights(self, x: Array, y: Array) -> Array:
        """Return its height above the floor's zero at places [m], of their shape.

        Args:
            x: Forward from where the robot starts [m].
            y: To the left [m].
        """
        raise NotImplementedError

    def normals(self, x: Array, y: Array) -> Array:
        """Return which way is up from its surface at places, unit vectors, (..., 3)."""
        del y
        return np.broadcast_to((0.0, 0.0, 1.0), (*np.shape(x), 3))

    def lift(self, x: float, y: float, radius: float) -> float:
        """Return the height of a ball's lowest point where it comes to lie from above [m].

        Args:
            x: Of its middle [m].
            y: Of its middle [m].
            radius: Of the ball [m].
        """
        out = radius * RINGS[:, None]
        felt = self.heights(x + out * np.cos(ROUND), y + out * np.sin(ROUND))
        return float(np.max(felt + np.sqrt(radius**2 - out**2))) - radius


class Flat(Ground, frozen=True, tag="flat"):
    """The floor alone."""

    level: ClassVar[bool] = True

    def heights(self, x: Array, y: Array) -> Array:
        """Return zeros; see `Ground.heights`."""
        return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)), dtype=np.float64)


class Steps(Ground, frozen=True, tag="steps"):
    """A stair across the way: up, or with a negative height down.

    Attributes:
        height: Rise of each step [m]; negative: they go down.
        length: Length of each along x [m].
        start: Where the first one begins [m].
        count: How many there are; the last one goes on as far as the floor.
    """

    height: float = 0.01
    length: float = 0.1
    start: float = 0.1
    count: int = 5

    def __post_init__(self) -> None:
        check_number("height", self.height, "m", low=-LONGEST, high=LONGEST)
        check_number("length", self.length, "m", low=FINEST, high=LONGEST)
        check_number("start", self.start, "m", low=-LONGEST, high=LONGEST)
        check_number("count", self.count, "", low=1, high=MOST)

    @property
    def words(self) -> str:
        """How many steps, and how high; see `Ground.words`."""
        return f" with {self.count} steps of {units.text(1e3 * self.height, 'mm')}"

    @property
    def edges(self) -> Array:
        """Where each step begins [m], (count,)."""
        return self.start + self.length * np.arange(self.count, dtype=np.float64)

    def heights(self, x: Array, y: Array) -> Array:
        """Return the height of the step at x; see `Ground.heights`."""
        at = np.broadcast_arrays(x, y)[0]
        passed = np.searchsorted(self.edges, at, side="right")
        return np.asarray(self.height * passed, dtype=np.float64)


# dict=True: cached_property stores its value in the object's __dict__, which a Struct lacks.
class Rough(Ground, frozen=True, tag="rough", dict=True):
    """A square of triangles between points of random heights, about where the robot starts.

    Each cell is halved from the corner with the least x and y to the one with the greatest.

    Attributes:
        height: From the lowest point to the highest [m]; the lowest are at the floor's height.
        cell: Distance of neighbouring points along x and y [m].
        size: Side of the square [m]; beyond it is the floor.
        seed: Of the heights.
    """

    height: float = 0.005
    cell: float = 0.02
    size: float = 4.0
    seed: int = 0

    def __post_init__(self) -> None:
        check_number("height", self.height, "m", low=0.0, high=LONGEST, strict=True)
        check_number("cell", self.cell, "m", low=FINEST, high=LONGEST)
        check_number("size", self.size, "m", low=3.0 * self.cell, high=MOST * self.cell)
        if not 0 <= self.seed < 2**63:
            raise ArgumentError(f"seed must be in [0, 2^63), got {self.seed}")

    @property
    def words(self) -> str:
        """How high; see `Ground.words`."""
        return f" with rough ground of {units.text(1e3 * self.height, 'mm')}"

    @property
    def side(self) -> float:
        """Length of its side: whole cells [m]."""
        return self._cells * self.cell

    @property
    def _cells(self) -> int:
        """How many cells a side has."""
        return math.ceil(self.size / self.cell * (1.0 - 1e-9))

    @cached_property
    def points(self) -> NDArray[np.float32]:
        """Heights of the points as parts of `height`, rows along y, (n, n): as MuJoCo keeps them.

        Those of the rim are 0, as the floor beyond it.
        """
        inner = self._cells - 1
        drawn = np.random.default_rng(self.seed).uniform(size=(inner, inner)).astype(np.float32)
        # From 0 to 1, so that MuJoCo's own scaling leaves them what they are.
        return np.pad((drawn - drawn.min()) / np.ptp(drawn), 1)

    def heights(self, x: Array, y: Array) -> Array:
        """Return the height of the triangle at a place; see `Ground.heights`."""
        corner, along, across, u, v = self._triangles(x, y)
        return self.height * (corner + u * along + v * across)

    def normals(self, x: Array, y: Array) -> Array:
        """Return the normal of the triangle at a place; see `Ground.normals`."""
        _, along, across, _, _ = self._triangles(x, y)
        steep = self.height / self.cell
        up = np.stack([-steep * along, -steep * across, np.ones_like(along)], axis=-1)
        return up / np.linalg.norm(up, axis=-1, keepdims=True)

    def _triangles(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return the triangles at places: a corner, the rises over a cell along x and y, u and v.

        u and v are how far a place is from the corner along x and y, in cells.
        """
        points = self.points.astype(np.float64)
        last = self._cells - 1
        across_cells = np.asarray(y) / self.cell + 0.5 * self._cells
        along_cells = np.asarray(x) / self.cell + 0.5 * self._cells
        row = np.clip(np.floor(across_cells), 0, last).astype(int)
        column = np.clip(np.floor(along_cells), 0, last).astype(int)

        # Beyond the rim, where all is 0, as at the rim.
        u = np.clip(along_cells - column, 0.0, 1.0)
        v = np.clip(across_cells - row, 0.0, 1.0)
        near = points[row, column]
        far = points[row + 1, column + 1]
        right = points[row, column + 1]
        left = points[row + 1, column]
        below = u > v
        along = np.where(below, right - near, far - left)
        across = np.where(below, far - right, left - near)
        return near, along, across, u, v


AnyGround = Flat | Steps | Rough

KINDS: dict[str, type[Ground]] = {
    str(kind.__struct_config__.tag): kind for kind in (Flat, Steps, Rough)
}
