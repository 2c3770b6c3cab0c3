"""What the leg has to do: foot motions under a load, and regions that the foot must cover."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Literal, NamedTuple

import msgspec
import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.checks import check_number
from fivebar_sim.design.evaluation.legs import Rows
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import HEAVIEST
from fivebar_sim.paths import FootPath
from fivebar_sim.paths.base import FARTHEST, Pair, check_pair
from fivebar_sim.scenario.forces import FootForce


class FootMotion(NamedTuple):
    """A foot path with what loads the foot.

    Attributes:
        name: Name in the task's table [motion].
        path: The foot's path.
        force: Force of the world on the foot; None for none.
        payload: Point mass at the foot [kg].
        weight: Share of the time that the leg spends in it, relative to the others'.
    """

    name: str
    path: FootPath
    force: FootForce | None = None
    payload: float = 0.0
    weight: float = 1.0

    @property
    def span(self) -> tuple[float, float]:
        """First and last time that count [s]: one period after the ramp, or until it is at rest."""
        if self.path.period is not None:
            return self.path.ramp, self.path.ramp + self.path.period
        last = min(self.path.rest, self.path.end)
        if not math.isfinite(last):
            raise ArgumentError("a path must repeat or end, to be sampled")
        return 0.0, last

    def times(self, samples: int) -> Array:
        """Return the middles of equally long parts of the span [s], (samples,)."""
        first, last = self.span
        return first + (last - first) * (np.arange(samples) + 0.5) / samples


class Moving(NamedTuple):
    """A foot motion at its samples, the same for all designs (1, N) or of each (n, N).

    Attributes:
        x, z: The foot F [m], hip frame.
        x_dot, z_dot: [m/s].
        x_ddot, z_ddot: [m/s^2].
        Fx, Fz: Force of the world on the foot [N].
        seconds: How long it lasts [s], (1, 1) or (n, 1).
        payload: Point mass at the foot [kg], (1, 1) or (n, 1).
    """

    x: Array
    z: Array
    x_dot: Array
    z_dot: Array
    x_ddot: Array
    z_ddot: Array
    Fx: Array
    Fz: Array
    seconds: Array
    payload: Array

    def take(self, rows: Rows) -> Moving:
        """Return the motion of some of the designs."""
        return Moving(*(each if len(each) == 1 else each[rows] for each in self))


def sampled(motion: FootMotion, samples: int) -> Moving:
    """Return a motion at its samples, with one row for all designs."""
    time = motion.times(samples)
    foot = motion.path.at(time)
    force = np.zeros((samples, 2))
    if motion.force is not None:
        force = motion.force.at(time, motion.path)

    first, last = motion.span
    rows = [*foot.position.T, *foot.velocity.T, *foot.acceleration.T, *force.T]
    return Moving(
        *(np.ascontiguousarray(row)[None, :] for row in rows),
        seconds=np.array([[last - first]]),
        payload=np.array([[motion.payload]]),
    )


def stacked(each: list[Moving]) -> Moving:
    """Return the motions of n designs as one."""
    return Moving(*(np.concatenate(parts) for parts in zip(*each, strict=True)))


AFFINE = {
    *("centre", "radii", "radius", "start", "stop", "stride", "lift", "push", "x", "low", "high"),
    *("peak", "value", "payload"),
}
"""Keys of shipped paths, forces and regions in which all that is sampled is affine: it changes in
proportion to them."""


def blended(corners: Sequence[Sequence[Array]], shares: Array) -> list[Array]:
    """Return arrays that are affine in the shares of some ranges, (1, N) or (n, N) each.

        first + sum of share_k (corner_k - first)

    Args:
        corners: The arrays (1, N) with all shares 0, then with one of them 1 and the others 0.
        shares: Of n designs, (n, k).
    """
    first, *others = corners
    found = []
    for i, start in enumerate(first):
        total = start
        for k, corner in enumerate(others):
            # What does not change stays one row for all designs.
            if not np.array_equal(corner[i], start):
                total = total + shares[:, k : k + 1] * (corner[i] - start)
        found.append(total)
    return found


class Region(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"
):
    """A region that the foot must cover; the base of every kind."""

    convex: ClassVar[bool] = True

    def points(self, samples: int) -> Array:
        """Return points that fill the region, its edge included [m], (n, 2); n near `samples`."""
        raise NotImplementedError

    def box(self) -> tuple[Array, Array]:
        """Return the least and the greatest (x, z) of the region [m], each (2,)."""
        raise NotImplementedError

    def misses(self, low: Array, high: Array) -> Bools:
        """Return which boxes (n, 2) to (n, 2) [m] surely have no point of the region, (n,)."""
        raise NotImplementedError


class Box(Region, frozen=True, tag="box"):
    """An upright rectangle.

    Attributes:
        low: Least (x, z) [m].
        high: Greatest (x, z) [m].
    """

    low: Pair
    high: Pair

    def __post_init__(self) -> None:
        check_pair(self, "low", "m")
        check_pair(self, "high", "m")
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise ArgumentError(f"low must be below high, got {self.low} and {self.high} m")

    def points(self, samples: int) -> Array:
        """Return a grid, corners included; see `Region.points`."""
        count = max(2, round(math.sqrt(samples)))
        lines = [np.linspace(a, b, count) for a, b in zip(self.low, self.high, strict=True)]
        return np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)

    def box(self) -> tuple[Array, Array]:
        """Return its corners; see `Region.box`."""
        return np.array(self.low), np.array(self.high)

    def misses(self, low: Array, high: Array) -> Bools:
        """Return which boxes are outside; see `Region.misses`."""
        return np.any((high < np.array(self.low)) | (low > np.array(self.high)), axis=-1)


class HalfDisc(Region, frozen=True, tag="half-disc"):
    """Half a disc, above or below its centre.

    Attributes:
        centre: (x, z) of the middle of its straight side [m].
        radius: [m].
        side: "up": z >= that of the centre; "down": z <= it.
    """

    centre: Pair
    radius: float
    side: Literal["up", "down"] = "down"

    def __post_init__(self) -> None:
        check_pair(self, "centre", "m")
        check_number("radius", self.radius, "m", low=0.0, high=FARTHEST, strict=True)

    def points(self, samples: int) -> Array:
        """Return rays of points from the centre, the edge included; see `Region.points`."""
        rings = max(2, round(math.sqrt(samples / math.pi)))
        rays = max(3, round(samples / rings))
        r = self.radius * np.linspace(0.0, 1.0, rings)[:, None]
        turn = np.linspace(0.0, math.pi, rays)
        up = 1.0 if self.side == "up" else -1.0
        x = self.centre[0] + r * np.cos(turn)
        z = self.centre[1] + up * r * np.sin(turn)
        return np.stack([x, z], axis=-1).reshape(-1, 2)

    def box(self) -> tuple[Array, Array]:
        """Return the rectangle around it; see `Region.box`."""
        x, z = self.centre
        r = self.radius
        span = (z, z + r) if self.side == "up" else (z - r, z)
        return np.array([x - r, span[0]]), np.array([x + r, span[1]])

    def misses(self, low: Array, high: Array) -> Bools:
        """Return which boxes are outside; see `Region.misses`."""
        centre = np.array(self.centre)
        # The point of the box nearest to the centre; 1e-12 is far above its rounding.
        near = np.clip(centre, low, high) - centre
        far = np.hypot(near[:, 0], near[:, 1]) > self.radius * (1.0 + 1e-12)
        bottom, top = (part[1] for part in self.box())
        return far | (high[:, 1] < bottom) | (low[:, 1] > top)


REGIONS: dict[str, type[Region]] = {
    str(kind.__struct_config__.tag): kind for kind in (Box, HalfDisc)
}


class Cover(NamedTuple):
    """A region to cover, with its name in the task's table [region]."""

    name: str
    region: Region


def check_load(motion: FootMotion) -> None:
    """Raise unless payload and weight are in range, and path and force have a torque."""
    if motion.path.jumps:
        raise ArgumentError(
            'path.interpolation must be "cubic" or "linear", got "hold": no closed form has the '
            "torque of a foot that jumps"
        )
    check_number("payload", motion.payload, "kg", low=0.0, high=HEAVIEST)
    check_number("weight", motion.weight, "", low=0.0, strict=True)
    sampled(motion, 2)
