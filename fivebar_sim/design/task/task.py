"""A design task: what varies, what the leg has to do, what counts as good, what is forbidden."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from fivebar_sim import paths
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.design.evaluation.legs import Legs, columns, leg_table, numbers
from fivebar_sim.design.evaluation.motors import Motors, through
from fivebar_sim.design.task import parts, reading
from fivebar_sim.design.task.motions import (
    Cover,
    FootMotion,
    Moving,
    Region,
    blended,
    sampled,
    stacked,
)
from fivebar_sim.design.task.options import Constraints, Search
from fivebar_sim.design.task.variation import Variation, put
from fivebar_sim.geometry import FiveBar


@dataclass(frozen=True, eq=False)
class Task:
    """A design task, checked; a design is a row of values, one for each variable.

    Attributes:
        name: Name of the task.
        where: Its file, for messages.
        table: The whole file.
        leg: The leg that everything starts from.
        rotor: Whether the leg's armature is its own; else it is the servo's.
        servos: The servos to choose from: one if none varies.
        gear: Ratio between servo and joint, on top of the servo's own gear.
        motions: Foot motions with their loads.
        covers: Regions that the foot must cover.
        variation: What varies, and what is tied to it.
        objectives: Names of the objectives; see `objectives.CATALOGUE`.
        constraints: What is forbidden.
        search: How to search.
        samples: Samples of each motion and of each region.
    """

    name: str
    where: str
    table: dict[str, Any]
    leg: FiveBar
    rotor: bool
    servos: tuple[Servo, ...]
    gear: float
    motions: tuple[FootMotion, ...]
    covers: tuple[Cover, ...]
    variation: Variation
    objectives: tuple[str, ...]
    constraints: Constraints
    search: Search
    samples: int
    _fixed: dict[str, Moving] = field(default_factory=dict, repr=False)
    _ends: dict[str, list[Sequence[Array]]] = field(default_factory=dict, repr=False)

    @classmethod
    def load(cls, source: str | Path) -> Task:
        """Return the task of a TOML file, or of a shipped one by its name.

        Raises:
            ConfigError: The file cannot be read, or a key is unknown or its value illegal; the
                message names both.
        """
        return cls(**reading.load(source))

    @property
    def names(self) -> tuple[str, ...]:
        """The variables' keys, in the order of the values."""
        return self.variation.names

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest values, each (d,)."""
        return self.variation.bounds

    def from_unit(self, shares: Array) -> Array:
        """Return legal values (n, d) for shares of each range in [0, 1], (n, d)."""
        return self.variation.from_unit(shares)

    def settings(self, row: Array) -> dict[str, Any]:
        """Return the value of every key that varies or is tied, of one design (d,)."""
        return self.variation.settings(row)

    def sample(self, n: int, seed: int = 0) -> Array:
        """Return n random designs, uniform within the bounds, (n, d)."""
        rng = np.random.default_rng(seed)
        return self.from_unit(rng.random((n, len(self.names))))

    def servo(self, row: Array) -> Servo:
        """Return the servo of a design, without the gear between it and the joint."""
        return self.servos[self._servo_index(row)]

    def geared(self, row: Array) -> Servo:
        """Return the servo of a design as the joint sees it, through the gear."""
        return through(self.servo(row), self._ratio(row))

    def leg_of(self, row: Array) -> FiveBar:
        """Return the leg of a design.

        Raises:
            ConfigError: The links can never close, or a number is out of range.
        """
        return FiveBar.from_table(self._leg_table(row), self.where)

    def preset(self, row: Array) -> str:
        """Return the leg of a design as a TOML preset, which `fivebar run` accepts as leg."""
        return tomli_w.dumps(self._named(leg_table(self.leg_of(row))))

    def motions_of(self, row: Array) -> tuple[FootMotion, ...]:
        """Return the foot motions of a design."""
        return tuple(self._motion(motion, self.settings(row)) for motion in self.motions)

    def covers_of(self, row: Array) -> tuple[Cover, ...]:
        """Return the regions of a design."""
        settings = self.settings(row)
        return tuple(Cover(each.name, self._region(each, settings)) for each in self.covers)

    def legs(self, values: Array) -> Legs:
        """Return the legs of designs (n, d)."""
        base = numbers(self.leg)
        if not self.rotor:
            base |= {"armature": 0.0}
        varied = self.variation.columns(values, "leg.")
        legs = Legs(columns(base, varied, len(values)))
        if self.rotor:
            return legs
        rotor = self.motors(values).armature
        return Legs({**legs.columns, "armature": rotor})

    def motors(self, values: Array) -> Motors:
        """Return the servos of designs (n, d) as their joints see them."""
        index = self.variation.column(values, "servo")
        ratio = self.variation.column(values, "gear")
        gear = np.full(len(values), self.gear) if ratio is None else ratio
        which = np.zeros(len(values), dtype=int) if index is None else index.astype(int)
        return Motors.of(self.servos, which, gear, self.leg.armature)

    def moving(self, motion: FootMotion, values: Array) -> Moving:
        """Return a foot motion at its samples, of designs (n, d)."""
        own = self.variation.sources(f"motion.{motion.name}.")
        if not own:
            if motion.name not in self._fixed:
                self._fixed[motion.name] = sampled(motion, self.samples)
            return self._fixed[motion.name]

        plain = type(motion.path) in paths.KINDS.values()
        if plain and self.variation.is_affine(f"motion.{motion.name}."):
            return Moving(
                *self._blended(
                    f"motion.{motion.name}.", own, values, partial(self._sampled, motion)
                )
            )

        # Paths are objects: each different one is made once.
        _, first, which = np.unique(values[:, own], axis=0, return_index=True, return_inverse=True)
        each = [self._sampled(motion, values[k]) for k in first]
        return stacked(each).take(which.ravel()) if len(each) > 1 else each[0]

    def points(self, cover: Cover, values: Array) -> tuple[Array, Array]:
        """Return x and z of points that fill a region [m], (1, N) or of each design (n, N)."""
        prefix = f"region.{cover.name}."
        own = self.variation.sources(prefix)
        if not own:
            x, z = cover.region.points(self.samples).T.copy()
            return x[None], z[None]
        if self.variation.is_affine(prefix):
            x, z = self._blended(prefix, own, values, partial(self._filled, cover))
            return x, z
        each = np.stack([np.concatenate(self._filled(cover, row)) for row in values], axis=1)
        return each[0], each[1]

    def _sampled(self, motion: FootMotion, row: Array) -> Moving:
        return sampled(self._motion(motion, self.settings(row)), self.samples)

    def _filled(self, cover: Cover, row: Array) -> tuple[Array, Array]:
        x, z = self._region(cover, self.settings(row)).points(self.samples).T.copy()
        return x[None], z[None]

    def _blended(
        self, key: str, own: list[int], values: Array, at: Callable[[Array], Sequence[Array]]
    ) -> list[Array]:
        """Return arrays that are affine in the columns `own`, from those at their ends.

        Args:
            key: What is blended: its ends are computed once.
            own: The columns.
            values: The designs, (n, d).
            at: Returns the arrays of one design (d,).
        """
        low, high = self.bounds
        if key not in self._ends:
            corners = [at(low)]
            for k in own:
                row = low.copy()
                row[k] = high[k]
                corners.append(at(row))
            self._ends[key] = corners
        span = np.where(high > low, high - low, 1.0)
        return blended(self._ends[key], ((values - low) / span)[:, own])

    def _leg_table(self, row: Array) -> dict[str, Any]:
        table = self._named(leg_table(self.leg))
        if not self.rotor:
            geared = self.geared(row).armature
            table["armature"] = self.leg.armature if geared is None else geared
        for key, value in self.settings(row).items():
            if key.startswith("leg."):
                put(table, key.removeprefix("leg."), value)
        return table

    def _named(self, table: dict[str, Any]) -> dict[str, Any]:
        """Return the table of a leg with the task's name first."""
        return {"name": "", **table} | {"name": self.name}

    def _motion(self, motion: FootMotion, settings: Mapping[str, Any]) -> FootMotion:
        """Return a motion with the settings of a design."""
        table = copy.deepcopy(self.table["motion"][motion.name])
        if self._put_own(table, f"motion.{motion.name}.", settings):
            folder = Path(self.where).parent
            return parts.motion(motion.name, table, self.where, folder)
        return motion

    def _region(self, cover: Cover, settings: Mapping[str, Any]) -> Region:
        """Return a region with the settings of a design."""
        table = copy.deepcopy(self.table["region"][cover.name])
        if self._put_own(table, f"region.{cover.name}.", settings):
            return parts.region(cover.name, table, self.where)
        return cover.region

    def _put_own(self, table: dict[str, Any], prefix: str, settings: Mapping[str, Any]) -> bool:
        """Put the settings of one table into it; return whether there were any."""
        own = {k.removeprefix(prefix): v for k, v in settings.items() if k.startswith(prefix)}
        for key, value in own.items():
            put(table, key, value)
        return bool(own)

    def _servo_index(self, row: Array) -> int:
        found = self.variation.column(np.asarray(row, dtype=float)[None], "servo")
        return 0 if found is None else int(found[0])

    def _ratio(self, row: Array) -> float:
        found = self.variation.column(np.asarray(row, dtype=float)[None], "gear")
        return self.gear if found is None else float(found[0])
