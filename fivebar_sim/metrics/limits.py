"""Limits on metrics, and whether a run is within them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from fivebar_sim.errors import unknown
from fivebar_sim.metrics.catalogue import BY_KEY, shown
from fivebar_sim.metrics.json_types import Number, Table


class Limit(NamedTuple):
    """One limit with the value of a run; `ok` if low <= value <= high."""

    key: str
    low: float
    high: float
    value: float | None
    ok: bool


class WrittenLimit(Table, frozen=True):
    """A limit as metrics.json has it: `low` is None where there is only an upper bound."""

    key: str
    low: Number
    high: Number
    value: Number
    ok: bool

    def __post_init__(self) -> None:
        if self.key not in BY_KEY:
            raise ValueError(unknown("metric", self.key, BY_KEY))

    @classmethod
    def of(cls, limit: Limit) -> WrittenLimit:
        """Return a limit as it is written: JSON has no word for -inf."""
        low = None if limit.low == -math.inf else limit.low
        return cls(key=limit.key, low=low, high=limit.high, value=limit.value, ok=limit.ok)


def look_up(metrics: Mapping[str, Any], key: str) -> float | None:
    """Return the metric of a dotted key ("load.torque_rms.A")."""
    value: Any = metrics
    for part in key.split("."):
        value = value[part]
    return value


def has(metrics: Mapping[str, Any], key: str) -> bool:
    """Return whether a run has a metric: one in the air has none of a ground."""
    value: Any = metrics
    for part in key.split("."):
        if part not in value:
            return False
        value = value[part]
    return True


def judge(metrics: Mapping[str, Any], limits: Mapping[str, tuple[float, float]]) -> list[Limit]:
    """Return every limit with its value. A metric that is undefined fails its limit."""
    judged = []
    for key, (low, high) in limits.items():
        # An undefined value cannot show that the limit holds.
        value = look_up(metrics, key)
        judged.append(Limit(key, low, high, value, value is not None and low <= value <= high))
    return judged


def bounds(limit: Limit) -> str:
    """Return a limit in the unit that people read: "<= 1.3 mm", "40 to 60 %"."""
    if limit.low == -math.inf:
        return f"<= {shown(limit.key, limit.high)}"
    low, high = (shown(limit.key, bound) for bound in (limit.low, limit.high))
    number, _, unit = low.partition(" ")
    # The unit once, behind both numbers, unless their sizes ask for two; 0 has none.
    same = unit == high.partition(" ")[2] or limit.low == 0.0
    return f"{number if same else low} to {high}"
