"""The metrics of a leg, of a robot's four legs together.

An RMS is that over all legs, a largest value that of the worst leg; the load is shared as if each
leg's steps followed those of the leg before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.files import tables
from fivebar_sim.metrics import load
from fivebar_sim.metrics.branch import Branch
from fivebar_sim.metrics.json_types import Motors, Parts
from fivebar_sim.metrics.peaks import Peaks, Whole
from fivebar_sim.metrics.sharing import Load, Sharing, Temperatures

Rows = Mapping[str, Mapping[str, float | None]]

WORST = ("heat", "continuous", "line")
"""Tables of a load in which the worst leg counts."""


def rows(legs: Sequence[Rows]) -> dict[str, dict[str, float | None]]:
    """Return rows of the catalogue, by table and name, of all legs: RMS, largest, or mean."""
    return {
        table: {name: _one(name, [leg[table][name] for leg in legs]) for name in legs[0][table]}
        for table in legs[0]
    }


def _one(name: str, values: Sequence[float | None]) -> float | None:
    """Return one number of several legs' numbers; None where no leg has one."""
    known = np.array([value for value in values if value is not None])
    if not known.size:
        return None
    if name.endswith("rms"):
        return float(np.sqrt(np.mean(known**2)))
    return float(known.max() if name.endswith("max") else known.mean())


def peaks(legs: Sequence[Peaks]) -> Peaks:
    """Return the largest peaks of all legs."""
    found, _ = _largest(legs)
    return msgspec.convert(found, Peaks)


def whole(legs: Sequence[Whole]) -> Whole:
    """Return the largest peaks of all legs over the whole run, and when each occurs."""
    alone = [Peaks(**{k: getattr(leg, k) for k in Peaks.__struct_fields__}) for leg in legs]
    found, which = _largest(alone)
    times = [dict(tables.flat(msgspec.to_builtins(leg.at))) for leg in legs]
    at: dict[str, Any] = {}
    for key, leg in which.items():
        tables.put(at, key.split("."), times[leg][key], "")
    return msgspec.convert({**found, "at": at}, Whole)


def _largest(legs: Sequence[Peaks]) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the largest number of every key as nested tables, and the leg that has it."""
    flat = [dict(tables.flat(msgspec.to_builtins(leg))) for leg in legs]
    found: dict[str, Any] = {}
    which: dict[str, int] = {}
    for key in flat[0]:
        values = [each[key] for each in flat]
        which[key] = int(np.argmax(values))
        tables.put(found, key.split("."), values[which[key]], "")
    return found, which


def branch(legs: Sequence[Branch]) -> Branch:
    """Return the branch of the first leg that flipped, and how often all did."""
    times = [np.inf if leg.first_flip is None else leg.first_flip for leg in legs]
    first = legs[int(np.argmin(times))]
    return msgspec.structs.replace(first, flips=sum(leg.flips for leg in legs))


def sharing(
    torque: Sequence[Array],
    theta: Sequence[Array],
    timestep: float,
    stance: Sequence[Bools] | None,
    phase: Sequence[Array] | None,
) -> Sharing:
    """Return how the motors A and E of all legs share the load; see `load.measure`.

    Args:
        torque: Of each leg, (N, 2).
        theta: Of each leg, (N + 1, 2).
        timestep: [s].
        stance: Of each leg, (N,); None where it is not known.
        phase: Of each leg, (N,); None where there is none.
    """
    # Work is torque times turn: one leg's angles go on where those of the leg before end.
    turns = np.concatenate([np.diff(each, axis=0) for each in theta])
    turned = np.concatenate([np.zeros((1, 2)), np.cumsum(turns, axis=0)])
    return load.sharing(
        np.concatenate(torque),
        turned,
        timestep,
        stance=None if stance is None else np.concatenate(stance),
        phase=None if phase is None else np.concatenate(phase),
    )


def loads(shared: Sharing, legs: Sequence[Load]) -> Load:
    """Return the load of all legs.

    Args:
        shared: How their motors share it.
        legs: The load of each.
    """
    firsts = [leg.opposing.first for leg in legs if leg.opposing.first is not None]
    opposing = msgspec.structs.replace(shared.opposing, first=min(firsts, default=None))
    fields = {**msgspec.structs.asdict(shared), "opposing": opposing}
    for name in WORST:
        if getattr(legs[0], name) is not msgspec.UNSET:
            fields[name] = Motors(**_each(legs, name, max))
    if legs[0].temperature is not msgspec.UNSET:
        fields["temperature"] = Temperatures(**_each(legs, "temperature", max))
        fields["survives"] = max(leg.survives or 0.0 for leg in legs)
    mean = _each(legs, "saturated", lambda values: float(np.mean(values)))
    return Load(**fields, saturated=Parts(**mean))


def _each(
    legs: Sequence[Load], name: str, take: Callable[[list[float]], float]
) -> dict[str, float]:
    """Return a number of each motor, taken from those of all legs."""
    return {m: take([getattr(getattr(leg, name), m) for leg in legs]) for m in ("A", "E")}
