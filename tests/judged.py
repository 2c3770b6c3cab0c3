"""What a run measured, made up: a few metrics are given, all others are undefined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    for field in msgspec.structs.fields(kind):
        if field.default is msgspec.UNSET and field.name not in values:
            continue
        union = () if get_origin(field.type) is list else get_args(field.type)
        kinds = [each for each in (field.type, *union) if _is_table(each)]
        value = values.get(field.name)
        fields[field.name] = _filled(kinds[0], value or {}) if kinds else value
    return kind(**fields)


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)
