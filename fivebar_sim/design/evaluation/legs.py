"""Many legs as one object: every number of `FiveBar` is a column with one row for each design."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.dynamics.chain import Chain
from fivebar_sim.dynamics.plane import Vector
from fivebar_sim.geometry import CLOSING, FiveBar
from fivebar_sim.links import Link, ball, capsule, combined, moved, rod

TUPLES = ("mode", "gravity", "mass", "com", "com_across", "inertia")
"""Keys of a leg with several numbers; the k-th is KEY.k."""

Rows = Bools | NDArray[np.int_] | slice
"""A choice of designs."""

WORDS = ("name", "scale")
"""Keys of a leg that are no numbers."""


def numbers(leg: FiveBar) -> dict[str, float]:
    """Return every number of a leg by its key: "L1", "mode.0"; those that are None are left out."""
    found: dict[str, float] = {}
    for key, value in leg_table(leg).items():
        if key in TUPLES:
            found |= {f"{key}.{k}": float(each) for k, each in enumerate(value)}
        elif key not in WORDS:
            found[key] = float(value)
    return found


def leg_table(leg: FiveBar) -> dict[str, Any]:
    """Return the TOML table of a leg, without the keys that are None."""
    return {key: value for key, value in asdict(leg).items() if value is not None}


@dataclass(frozen=True)
class Legs:
    """n legs; the attributes are those of `FiveBar`, each (n, 1), to broadcast against samples.

    Attributes:
        columns: Every number by its key, as `numbers` names them, each (n, 1).
    """

    columns: Mapping[str, Array]

    def __getattr__(self, name: str) -> Array:
        # Only the numbers of a leg: anything else that is missing is a mistake.
        if name == "columns" or name not in self.columns:
            raise AttributeError(name)
        return self.columns[name]

    def __len__(self) -> int:
        return len(self.columns["L1"])

    def take(self, rows: Rows) -> Legs:
        """Return some of the legs."""
        return Legs({key: column[rows] for key, column in self.columns.items()})

    @property
    def mode(self) -> Vector:
        """Working mode (s_A, s_E), each (n, 1)."""
        return self.columns["mode.0"], self.columns["mode.1"]

    @property
    def gravity(self) -> Vector:
        """(x, z) in the hip frame [m/s^2]."""
        return self.columns["gravity.0"], self.columns["gravity.1"]

    @property
    def foot_offset(self) -> Vector:
        """F in the frame of L2 (along, across) [m], from B."""
        return self.L2 + self.L6 * np.cos(self.bend), self.L6 * np.sin(self.bend)

    @property
    def size(self) -> Array:
        """As in `FiveBar` [m]."""
        return np.maximum(self.L1 + self.L2 + self.L6, self.L4 + self.L3)

    @property
    def longest(self) -> Array:
        """Longest of the bars L1..L4; L2 goes on to the foot [m]."""
        far = np.hypot(*self.foot_offset)
        return np.maximum.reduce([self.L1, self.L2, far, self.L3, self.L4])

    @property
    def E(self) -> Vector:
        """Axis of motor E [m], hip frame; that of A is opposite."""
        return 0.5 * self.L5 * np.cos(self.tilt), 0.5 * self.L5 * np.sin(self.tilt)

    @property
    def closes(self) -> Array:
        """By how much the longest side is shorter than the rest together [m], (n,); >= 0 closes."""
        sides = np.stack([self.L1, self.L2, self.L3, self.L4, self.L5])[..., 0]
        longest = sides.max(axis=0)
        others = sides.sum(axis=0) - longest
        return others * (1.0 + CLOSING) - longest

    @cached_property
    def links(self) -> tuple[Link, Link, Link, Link]:
        """The inertias of L1..L4; the foot and the extension belong to L2."""
        if "mass.0" in self.columns:
            one, two, three, four = (self._explicit(k) for k in range(4))
            return one, two, three, four

        one, two, three, four = (
            capsule(L, self.radius, self.density) for L in (self.L1, self.L2, self.L3, self.L4)
        )
        extension = capsule(self.L6, self.radius, self.density)
        # A leg without an extension has no capsule of length 0 either.
        there = self.L6 > 0.0
        extension = extension._replace(
            mass=there * extension.mass, inertia=there * extension.inertia
        )
        foot = ball(self.foot_radius, self.density)
        parts = (
            moved(foot, self.foot_offset),
            moved(extension, (self.L2, 0.0), self.bend),
        )
        return one, combined(two, *parts), three, four

    def _explicit(self, k: int) -> Link:
        """Return link k = 0..3 of the masses, centres and inertias that are given."""
        mass = self.columns[f"mass.{k}"]
        length = (self.L1, self.L2, self.L3, self.L4)[k]
        link = rod(mass, length)
        if k == 1:
            # One rod bent at C, of the same mass per length all along.
            part = self.L6 / (self.L2 + self.L6)
            straight = rod(mass * (1.0 - part), self.L2)
            extension = moved(rod(mass * part, self.L6), (self.L2, 0.0), self.bend)
            link = combined(straight, extension)._replace(mass=mass)
        if "com.0" in self.columns:
            across = self.columns.get(f"com_across.{k}", 0.0)
            link = link._replace(com=(self.columns[f"com.{k}"], across))
        if "inertia.0" in self.columns:
            link = link._replace(inertia=self.columns[f"inertia.{k}"])
        return link

    def chain(self, payload: Array | float) -> Chain:
        """Return the constants of the closed chains with a point mass at F [kg], each (n, 1)."""
        return Chain.assembled(self, self.assembly, self.links, self.E, payload)


def columns(base: Mapping[str, float], varied: Mapping[str, Any], rows: int) -> dict[str, Array]:
    """Return the columns (n, 1) of legs: the base's numbers, but for those that are varied.

    Args:
        base: The numbers of the leg that everything starts from.
        varied: Values of each design by key, each (n,).
        rows: n.
    """
    whole = {key: np.full((rows, 1), value) for key, value in base.items()}
    return whole | {key: np.asarray(each, dtype=float)[:, None] for key, each in varied.items()}
