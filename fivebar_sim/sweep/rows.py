"""The table of a sweep: a row a run, also for those that cannot be run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from fivebar_sim.errors import FiveBarError
from fivebar_sim.metrics.catalogue import SHOWN
from fivebar_sim.metrics.limits import has, look_up
from fivebar_sim.rollout import AnyPlan, Result, execute, plan, run_all
from fivebar_sim.scenario import Scenario
from fivebar_sim.sweep.axes import Axis
from fivebar_sim.sweep.points import Points

if TYPE_CHECKING:
    import pyarrow as pa

Row = dict[str, Any]
"""A run: number, verdict, limits, guards, error, and the metrics that it has."""

JUDGED = ("verdict", "limits", "guards", "error")
"""Columns beside the varied keys and the metrics."""


def schema(points: Points) -> pa.Schema:
    """Return the columns of a sweep's table.

    They are `run`, its number; the varied keys; `verdict`; `limits` and `guards`, those that do not
    hold; `error`, why there was no run; and every metric in SI units, null where it is undefined.
    """
    import pyarrow as pa

    columns: list[pa.Field] = [pa.field("run", pa.int64())]
    for axis in points.axes:
        columns += [pa.field(key, _kind(axis)) for key in axis.keys]
    columns += [
        pa.field("verdict", pa.string()),
        pa.field("limits", pa.list_(pa.string())),
        pa.field("guards", pa.list_(pa.string())),
        pa.field("error", pa.string()),
    ]
    return pa.schema([*columns, *(pa.field(key, pa.float64()) for key in SHOWN)])


def table(points: Points, numbers: Sequence[int], rows: Sequence[Row]) -> pa.Table:
    """Return the table of some runs.

    Args:
        points: The points of the sweep.
        numbers: Number of each run.
        rows: What came of each.
    """
    import pyarrow as pa

    kinds = schema(points)
    columns: dict[str, list[Any]] = {name: [] for name in kinds.names}
    for number, row in zip(numbers, rows, strict=True):
        columns["run"].append(number)
        for axis, value in zip(points.axes, points.at(number), strict=True):
            for key in axis.keys:
                columns[key].append(_written(axis, value))
        for name in (*JUDGED, *SHOWN):
            columns[name].append(row.get(name))
    return pa.table(columns, schema=kinds)


def _kind(axis: Axis) -> pa.DataType:
    """Return the type of a varied key's column."""
    import pyarrow as pa

    if all(isinstance(value, bool) for value in axis.values) and axis.values:
        return pa.bool_()
    numbers = all(_is_number(value) for value in axis.values)
    if axis.values and all(isinstance(value, int) for value in axis.values) and numbers:
        return pa.int64()
    return pa.float64() if numbers else pa.string()


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _written(axis: Axis, value: Any) -> Any:
    """Return a value as its column has it: text where not all of them are numbers."""
    if isinstance(value, (str, bool)) and all(isinstance(v, type(value)) for v in axis.values):
        return value
    if all(_is_number(each) for each in axis.values):
        return value
    return value if isinstance(value, str) else json.dumps(value, default=str)


def simulate(scenarios: Sequence[Scenario | str]) -> list[Row]:
    """Return what comes of scenarios, which are simulated together where that is possible.

    Args:
        scenarios: Each a scenario, or the error of one that is refused.
    """
    rows: list[Row | None] = [None] * len(scenarios)
    plans: dict[int, AnyPlan] = {}
    for k, scenario in enumerate(scenarios):
        if isinstance(scenario, str):
            rows[k] = {"error": scenario}
            continue
        try:
            plans[k] = plan(scenario)
        except FiveBarError as error:
            rows[k] = {"error": str(error)}

    results = _results(list(plans.values()))
    for k, result in zip(plans, results, strict=True):
        rows[k] = {"error": str(result)} if isinstance(result, FiveBarError) else _row(result)
    return [row for row in rows if row is not None]


def _results(plans: Sequence[AnyPlan]) -> list[Result | FiveBarError]:
    """Return what comes of plans."""
    try:
        return [*run_all(plans)]
    # The batch ends as a whole; one by one the others still get their rows, bit for bit.
    except FiveBarError:
        return [_alone(planned) for planned in plans]


def _alone(planned: AnyPlan) -> Result | FiveBarError:
    try:
        return execute(planned)
    except FiveBarError as error:
        return error


def _row(result: Result) -> Row:
    """Return the row of a run."""
    metrics: Mapping[str, Any] = result.metrics
    return {
        "verdict": result.verdict,
        "limits": [limit.key for limit in result.limits if not limit.ok],
        "guards": [guard.name for guard in result.measured.guards if not guard.ok],
        **{key: look_up(metrics, key) for key in SHOWN if has(metrics, key)},
    }
