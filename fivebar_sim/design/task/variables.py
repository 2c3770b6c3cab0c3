"""What varies from design to design: numbers, whole numbers, choices, and what is tied to them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.checks import is_finite
from fivebar_sim.errors import ConfigError, unknown

WORDS = {"low", "high", "step", "choice", "tie", "scale", "offset"}
"""Keys of a table that says how something varies."""


@dataclass(frozen=True, slots=True)
class Variable:
    """A key of the task that takes one value in each design.

    Attributes:
        key: Dotted, such as "leg.L1".
        low: Least value; 0 for a choice.
        high: Greatest value; of a choice the last index.
        step: Values are low + whole steps; 0 for any value in between.
        choice: The values of a choice, whose column holds their index; empty for numbers.
    """

    key: str
    low: float
    high: float
    step: float = 0.0
    choice: tuple[Any, ...] = ()

    def snapped(self, values: Array) -> Array:
        """Return values brought to the nearest legal ones."""
        values = np.clip(values, self.low, self.high)
        if self.step == 0.0:
            return values
        steps = np.round((values - self.low) / self.step)
        return np.minimum(self.low + self.step * steps, self.high)

    def from_unit(self, share: Array) -> Array:
        """Return legal values for shares of the range in [0, 1], every step equally likely."""
        if self.step == 0.0:
            return self.low + (self.high - self.low) * share
        # Each of the values gets an equal part of [0, 1), the first and the last one too.
        count = round((self.high - self.low) / self.step) + 1
        step = np.minimum(np.floor(share * count), count - 1)
        return np.minimum(self.low + self.step * step, self.high)

    def grid(self, points: int) -> Array:
        """Return evenly spaced legal values: all of a choice, else at most `points`."""
        if self.step > 0.0:
            count = round((self.high - self.low) / self.step) + 1
            points = count if self.choice else min(points, count)
        if points == 1:
            return self.snapped(np.array([0.5 * (self.low + self.high)]))
        return np.unique(self.snapped(np.linspace(self.low, self.high, points)))


@dataclass(frozen=True, slots=True)
class Tie:
    """A key that follows a variable: scale * variable + offset.

    Attributes:
        key: The key that follows.
        to: The variable's key.
        scale: Factor.
        offset: In the unit of the key.
    """

    key: str
    to: str
    scale: float = 1.0
    offset: float = 0.0


def read(
    table: Any, known: Iterable[str], where: str
) -> tuple[tuple[Variable, ...], tuple[Tie, ...]]:
    """Return the variables and the ties of a task's table [vary].

    Args:
        table: What the file has under `vary`, nested or dotted.
        known: The keys that can vary.
        where: The file, for messages.

    Raises:
        ConfigError: Not a table or empty, an unknown key, bounds the wrong way round, an empty
            choice, or a tie to something that does not vary.
    """
    where = f"{where}: [vary]"
    if not isinstance(table, Mapping) or not table:
        raise ConfigError(f"{where} must be a table with at least one key that varies")

    known = list(known)
    variables = []
    ties = []
    for key, value in _flat(table):
        if key not in known:
            raise ConfigError(f"{where}: {unknown('key', key, known)}")
        each = _read(key, value, where)
        (ties if isinstance(each, Tie) else variables).append(each)

    names = [each.key for each in variables]
    for tie in ties:
        if tie.to not in names:
            raise ConfigError(f"{where}: {tie.key} is tied to {unknown('variable', tie.to, names)}")
    if not variables:
        raise ConfigError(f"{where} ties keys, but nothing varies freely")
    return tuple(variables), tuple(ties)


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, how it varies)."""
    for key, value in table.items():
        if isinstance(value, Mapping) and value and not _is_range(value):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _is_range(table: Mapping[str, Any]) -> bool:
    """Return whether a table says how a key varies; else it has further keys, also of such names.

    The key "low" of a region is itself varied by [low, high] or a table, never by one number.
    """
    kinds = {"choice": list, "tie": str}
    return any(isinstance(v, kinds.get(k, int | float)) for k, v in table.items() if k in WORDS)


def _read(key: str, value: Any, where: str) -> Variable | Tie:
    """Return how one key varies."""
    if isinstance(value, str):
        return Tie(key, value)
    if isinstance(value, list):
        value = {"low": value[0], "high": value[1]} if len(value) == 2 else {}
    if not isinstance(value, Mapping) or not value:
        raise ConfigError(
            f"{where}: {key} must be [low, high], the key it is tied to, or a table of "
            f"{', '.join(sorted(WORDS))}"
        )

    for word in value:
        if word not in WORDS:
            raise ConfigError(f"{where}: {key}: {unknown('key', word, WORDS)}")
    if "choice" in value:
        return _choice(key, value, where)
    if "tie" in value:
        numbers = [_number(key, value, word, where, usual) for word, usual in SCALED.items()]
        return Tie(key, str(value["tie"]), *numbers)
    return _range(key, value, where)


SCALED = {"scale": 1.0, "offset": 0.0}


def _choice(key: str, value: Mapping[str, Any], where: str) -> Variable:
    options = value["choice"]
    if not isinstance(options, list) or not options or len(value) > 1:
        raise ConfigError(f"{where}: {key}.choice must be an array of values, and stand alone")
    frozen = tuple(tuple(each) if isinstance(each, list) else each for each in options)
    return Variable(key, 0.0, float(len(frozen) - 1), 1.0, frozen)


def _range(key: str, value: Mapping[str, Any], where: str) -> Variable:
    low = _number(key, value, "low", where)
    high = _number(key, value, "high", where)
    step = _number(key, value, "step", where, 0.0)
    if set(value) - {"low", "high", "step"}:
        raise ConfigError(f"{where}: {key} has low and high, so it can have only step beside them")
    if not low < high:
        raise ConfigError(
            f"{where}: {key} must have low below high, got [{low:g}, {high:g}]"
            + (": the wrong way round" if low > high else "")
        )
    if step < 0.0:
        raise ConfigError(f"{where}: {key}.step must be in [0, inf), got {step:g}")
    # The last whole step: what lies beyond it can never be taken.
    last = low + step * np.floor((high - low) / step * (1.0 + 1e-12)) if step > 0.0 else high
    return Variable(key, low, float(last), step)


def _number(
    key: str, value: Mapping[str, Any], word: str, where: str, usual: float | None = None
) -> float:
    number = value.get(word, usual)
    if not is_finite(number):
        raise ConfigError(f"{where}: {key}.{word} must be a finite number, got {number!r}")
    return float(number)
