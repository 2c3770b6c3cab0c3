"""The tables [constraints] and [search] of a design task."""

from __future__ import annotations

from typing import Literal

import msgspec

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError

JOINTS = ("A", "B", "C", "D", "E")
"""Joints with stops; the angle at C is from L3's direction to L2's."""

Method = Literal["nsga2", "nsga3", "cma-es", "grid", "sobol"]


class Constraints(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What a design must keep to, in every sample of every motion and region.

    Attributes:
        reach: Least distance of the foot from the edge of what the leg reaches [m]; with L6 > 0,
            of C from the edge of what side E reaches, and of F from that of side A.
        singular: Least sine of the angles at B, C and D, in the leg's own modes.
        condition: Largest condition number of the foot's Jacobian.
        line: How near a motor may come to its torque-speed line: on it is 1. Only where the servo
            has a limit.
        stops: Range of each joint's angle [rad], as in a record; A and E in any turn.
        knees: Least height of the knees' rims above the ground [m].
        ground: Height of the ground [m], hip frame; None: what the foot stands on at its lowest.
        apart: Least gap between links that share no joint [m].
        most: Upper bounds of objectives, by name.
        least: Lower bounds of objectives, by name.
    """

    reach: float = 0.0
    singular: float = 0.05
    condition: float | None = None
    line: float = 1.0
    stops: dict[str, tuple[float, float]] = {}
    knees: float | None = None
    ground: float | None = None
    apart: float | None = None
    most: dict[str, float] = {}
    least: dict[str, float] = {}

    def __post_init__(self) -> None:
        check_number("reach", self.reach, "m", low=0.0)
        check_number("singular", self.singular, "", low=0.0, high=1.0, strict=True)
        if self.condition is not None:
            check_number("condition", self.condition, "", low=1.0)
        check_number("line", self.line, "", low=0.0, strict=True)

        for key in ("knees", "ground", "apart"):
            if getattr(self, key) is not None:
                check_number(key, getattr(self, key), "m")
        for joint, (low, high) in self.stops.items():
            if joint not in JOINTS:
                raise ArgumentError(f"stops: no joint {joint!r}; joints: {', '.join(JOINTS)}")
            if not low < high:
                raise ArgumentError(f"stops.{joint} must be [low, high] rad, got [{low}, {high}]")


class Search(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How designs are searched.

    Attributes:
        method: "nsga2" or "nsga3" breeds whole populations; "cma-es" follows one objective; "grid"
            tries all combinations of evenly spaced values, "sobol" a sample that fills the space.
        seed: Seed of all random numbers.
        population: Designs in a generation of a breeding method.
        generations: Number of generations.
        points: Values of each variable in a grid; one number for all, or one each by key.
        designs: Number of designs of a Sobol sample.
        spare: The search asks for this much more than the constraints `reach`, `singular` and
            `condition`, as a fraction, so that what it finds keeps to them between the samples too.
        best: At most how many designs of the front are certified and written as presets.
    """

    method: Method = "nsga2"
    seed: int = 0
    population: int = 200
    generations: int = 50
    points: int | dict[str, int] = 11
    designs: int = 4096
    spare: float = 0.02
    best: int = 10

    def __post_init__(self) -> None:
        check_number("seed", self.seed, "", low=0.0, high=2.0**32 - 1)
        check_number("population", self.population, "", low=4, high=1e6)
        check_number("designs", self.designs, "", low=1, high=1e10)
        check_number("generations", self.generations, "", low=1, high=1e6)
        check_number("spare", self.spare, "", low=0.0, high=1.0)
        check_number("best", self.best, "", low=0, high=1e5)
        points = self.points if isinstance(self.points, dict) else {"points": self.points}
        for key, value in points.items():
            check_number(key, value, "", low=1, high=1e6)
