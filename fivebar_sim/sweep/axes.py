"""What a sweep varies: keys of a scenario, and the values that they take."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import tables

MOST = 1_000_000
"""Most values of a key."""

DIGITS = 12
"""Significant digits of values between LOW and HIGH: 0.051, not 0.051000000000000004."""

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


class Axis(NamedTuple):
    """One thing that is varied: a key, or several that always have the same value.

    Attributes:
        keys: Dotted keys of a scenario.
        values: Its values in their order; empty where a sample takes any number between the ends.
        low: Lower end of such a range.
        high: Upper end of such a range.
    """

    keys: tuple[str, ...]
    values: tuple[Any, ...]
    low: float = 0.0
    high: float = 0.0

    @property
    def name(self) -> str:
        """The keys as they were given."""
        return ",".join(self.keys)

    def at(self, part: float) -> Any:
        """Return the value at a part of the way through all of them, in [0, 1)."""
        if self.values:
            return self.values[int(part * len(self.values))]
        return _rounded(self.low + part * (self.high - self.low))


def parse(text: str, *, sampled: bool = False) -> Axis:
    """Return what "leg.L2=0.05:0.08:31" or "servo=xl330,hobby-9g" varies.

    Args:
        text: KEY=LOW:HIGH:N, N values from LOW to HIGH; or KEY=VALUE,VALUE,...; KEY may be several
            keys with commas between them. A value is TOML, else a bare string.
        sampled: Whether LOW:HIGH without N is allowed: any number between them.

    Raises:
        ConfigError: It is none of these, or the range is empty.
    """
    names, equals, values = text.partition("=")
    keys = tuple(key.strip() for key in names.split(","))
    if not equals or not values.strip() or not all(keys):
        raise ConfigError(f"--vary takes KEY=LOW:HIGH:N or KEY=VALUE,VALUE,..., got {text!r}")
    for key in keys:
        # Read for its check alone: a key is written as behind --set.
        tables.parse_setting(f"{key}=0")
    if len(set(keys)) < len(keys):
        raise ConfigError(f"--vary {names}: a key is there twice")

    parts = values.strip().split(":")
    if len(parts) > 1 and NUMBER.fullmatch(parts[0]):
        return _range(keys, parts, text, sampled=sampled)
    found = tuple(_value(keys[0], each) for each in _split(values))
    if len(found) > MOST:
        raise ConfigError(f"--vary {names}: at most {MOST} values, got {len(found)}")
    return Axis(keys, found)


def _range(keys: tuple[str, ...], parts: Sequence[str], text: str, *, sampled: bool) -> Axis:
    """Return an axis from LOW to HIGH."""
    if len(parts) > 3 or not all(NUMBER.fullmatch(part) for part in parts[:2]):
        raise ConfigError(f"--vary takes KEY=LOW:HIGH:N with numbers, got {text!r}")
    low = float(parts[0])
    high = float(parts[1])
    if not low <= high < float("inf"):
        raise ConfigError(f"--vary {text}: LOW must be at most HIGH, got {low:g} and {high:g}")
    if len(parts) == 2:
        if not sampled:
            raise ConfigError(f"--vary {text}: how many values? Write {text}:N, or add --sample")
        return Axis(keys, (), low, high)

    if not re.fullmatch(r"[+-]?\d+", parts[2]) or not 1 <= int(parts[2]) <= MOST:
        raise ConfigError(f"--vary {text}: N must be an integer in [1, {MOST}], got {parts[2]!r}")
    count = int(parts[2])
    if count == 1 and low < high:
        raise ConfigError(f"--vary {text}: N = 1 value cannot be both LOW and HIGH")
    whole = all(re.fullmatch(r"[+-]?\d+", part) for part in parts[:2])
    return Axis(keys, tuple(_values(low, high, count, whole=whole)))


def _values(low: float, high: float, count: int, *, whole: bool) -> Iterator[float | int]:
    """Yield evenly spaced values; integers where both ends and all steps are."""
    steps = int(high) - int(low)
    if whole and (count == 1 or steps % (count - 1) == 0):
        for k in range(count):
            yield int(low) + k * (steps // max(count - 1, 1))
        return
    for value in np.linspace(low, high, count).tolist():
        yield _rounded(value)


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _value(key: str, text: str) -> Any:
    """Return a value as `--set` reads it."""
    return tables.parse_setting(f"{key}={text}")[1]


def _split(text: str) -> list[str]:
    """Return the parts between commas that stand in no brackets or quotation marks."""
    parts = [""]
    depth = 0
    quote = ""

    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in "[{":
            depth += 1
        elif letter in "]}":
            depth -= 1
        if letter == "," and not quote and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]
