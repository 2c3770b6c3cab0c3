"""The variables of a task together with what is tied to them: from rows of values to settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.legs import TUPLES
from fivebar_sim.design.task.motions import AFFINE
from fivebar_sim.design.task.variables import Tie, Variable


@dataclass(frozen=True, slots=True)
class Variation:
    """What varies from design to design; a design is a row of values, one for each variable.

    Attributes:
        variables: What varies, in the order of the values.
        ties: What follows a variable.
    """

    variables: tuple[Variable, ...]
    ties: tuple[Tie, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The variables' keys, in the order of the values."""
        return tuple(variable.key for variable in self.variables)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest values, each (d,)."""
        low = np.array([variable.low for variable in self.variables])
        return low, np.array([variable.high for variable in self.variables])

    def from_unit(self, shares: Array) -> Array:
        """Return legal values (n, d) for shares of each range in [0, 1], (n, d)."""
        each = [v.from_unit(shares[:, k]) for k, v in enumerate(self.variables)]
        return np.stack(each, axis=-1)

    def settings(self, row: Array) -> dict[str, Any]:
        """Return the value of every key that varies or is tied, of one design (d,)."""
        found: dict[str, Any] = {}
        for variable, value in zip(self.variables, np.asarray(row).tolist(), strict=True):
            found[variable.key] = variable.choice[round(value)] if variable.choice else value
        for tie in self.ties:
            value = found[tie.to]
            plain = tie.scale == 1.0 and tie.offset == 0.0
            found[tie.key] = value if plain else tie.scale * value + tie.offset
        return found

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that vary or are tied."""
        return (*self.names, *(tie.key for tie in self.ties))

    def sources(self, prefix: str) -> list[int]:
        """Return the columns that the keys below a prefix depend on."""
        own = [k for k, name in enumerate(self.names) if name.startswith(prefix)]
        tied = [tie.to for tie in self.ties if tie.key.startswith(prefix)]
        return sorted({*own, *(self.names.index(to) for to in tied)})

    def is_affine(self, prefix: str) -> bool:
        """Return whether all keys below a prefix that vary are numbers of `AFFINE`."""
        keys = [key for key in self.keys if key.startswith(prefix)]
        # The last part that is no index: "centre" of "motion.walk.path.centre.1".
        words = [[part for part in key.split(".") if not part.isdigit()][-1] for key in keys]
        numbers = not any(self._choice(key) for key in keys)
        return numbers and all(word in AFFINE for word in words)

    def columns(self, values: Array, prefix: str) -> dict[str, Array]:
        """Return the columns (n,) of the numbers below a prefix, whose keys lose it."""
        found: dict[str, Array] = {}
        for key in self.keys:
            if not key.startswith(prefix):
                continue
            short = key.removeprefix(prefix)
            column = self.column(values, key)
            assert column is not None

            options = self._choice(key)
            if not options:
                found[short] = column
            elif short in TUPLES:
                picked = np.array(options, dtype=float)[column.astype(int)]
                found |= {f"{short}.{k}": picked[:, k] for k in range(picked.shape[1])}
            else:
                found[short] = np.array(options, dtype=float)[column.astype(int)]
        return found

    def _choice(self, key: str) -> tuple[Any, ...]:
        """Return the values that a key, or what it is tied to, is chosen from."""
        to = next((tie.to for tie in self.ties if tie.key == key), key)
        return next(v.choice for v in self.variables if v.key == to)

    def column(self, values: Array, key: str) -> Array | None:
        """Return a variable's column, or what follows from it if it is tied; None if neither."""
        for tie in self.ties:
            if tie.key == key:
                return tie.scale * values[:, self.names.index(tie.to)] + tie.offset
        return values[:, self.names.index(key)] if key in self.names else None


def put(table: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key of a table; a last part that is a number is an index into an array."""
    *above, last = key.split(".")
    place = table
    if last.isdigit():
        whole = above.pop()
        for part in above:
            place = place[part]
        # A new list: a frozen leg has tuples, and arrays of a preset are shared by all designs.
        numbers = list(place[whole])
        numbers[int(last)] = value
        place[whole] = numbers
        return

    for part in above:
        place = place[part]
    place[last] = list(value) if isinstance(value, tuple) else value
