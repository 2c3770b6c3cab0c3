"""What a run measured, made up: a few metrics are given, all others are undefined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, get_args, get_origin

import msgspec

from fivebar_sim.metrics.guards import Guard
from fivebar_sim.metrics.measured import Judged, JudgedRows, Verdict
from fivebar_sim.robots.measured import RobotJudged

PROVENANCE = {
    "mujoco": "3.17.0",
    "platform": "Linux x86_64",
    "integrator": "discrete",
    "timestep": 0.001,
    "seed": 0,
}


def judged(
    values: Mapping[str, float | None],
    *,
    guards: Sequence[Guard] = (),
    verdict: Verdict = "pass",
    provenance: Mapping[str, Any] = PROVENANCE,
) -> Judged:
    """Return all of metrics.json.

    Args:
        values: Metrics by dotted key; a table "ground" is there if one of them is in it;
            with one of the table "robot" all others are those of a robot.
        guards: The guards of the run.
        verdict: The run's verdict.
        provenance: What the numbers depend on.
    """
    tables: dict[str, Any] = {
        "guards": list(guards),
        "verdict": verdict,
        "limits": [],
        "provenance": dict(provenance),
    }
    for key, value in values.items():
        *parents, last = key.split(".")
        table = tables
        for part in parents:
            table = table.setdefault(part, {})
        table[last] = value
    kind = RobotJudged if "robot" in tables else JudgedRows
    return _filled(kind, tables)


def _filled(kind: type[Any], values: Mapping[str, Any]) -> Any:
    """Return a table with the values that are given, and None for every other."""
    fields = {}
    for name, table, required in _fields(kind):
        if not required and name not in values:
            continue
        value = values.get(name)
        fields[name] = value if table is None else _filled(table, value or {})
    return kind(**fields)


@cache
def _fields(kind: type[Any]) -> list[tuple[str, type[Any] | None, bool]]:
    """Return a table's keys: of each the table that it holds, if any, and whether it must be."""
    found = []
    for field in msgspec.structs.fields(kind):
        union = () if get_origin(field.type) is list else get_args(field.type)
        tables = [each for each in (field.type, *union) if _is_table(each)]
        required = field.default is not msgspec.UNSET
        found.append((field.name, tables[0] if tables else None, required))
    return found


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)
