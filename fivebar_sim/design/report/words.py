"""A task's variables in the words and units of the page."""

from __future__ import annotations

from typing import Any

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.report.axes import Axis, amount
from fivebar_sim.design.task.motions import FootMotion
from fivebar_sim.design.task.task import Task
from fivebar_sim.files import quantities
from fivebar_sim.geometry import FiveBar
from fivebar_sim.report import html


def axis(task: Task, k: int, values: Array) -> Axis:
    """Return an axis for a task's k-th variable; a choice has its values on it.

    Args:
        task: The task.
        k: Which variable.
        values: Of the designs shown, SI.
    """
    variable = task.variation.variables[k]
    if variable.choice:
        words = tuple(html.plain(each) for each in variable.choice)
        every = Axis.of(short(variable.key), "", np.arange(len(words), dtype=float))
        return every._replace(words=words)
    return Axis.of(short(variable.key), unit(task, variable.key), values)


def setting(task: Task, key: str, value: Any) -> str:
    """Return what a variable is set to: "L1 45 mm", "servo xl330"."""
    number = isinstance(value, float) and bool(unit(task, key))
    return f"{short(key)} {amount(value, unit(task, key)) if number else html.plain(value)}"


def short(key: str) -> str:
    """Return a variable's key without the table that it is in."""
    table, _, rest = key.partition(".")
    return rest if table in ("leg", "motion", "region") else key


def unit(task: Task, key: str) -> str:
    """Return the SI unit of a variable; "" for pure numbers and choices."""
    table, _, rest = key.partition(".")
    name, _, inner = rest.partition(".")
    kind: type[Any]
    if table == "leg":
        kind = FiveBar
        inner = rest
    elif table == "motion":
        motion = next(each for each in task.motions if each.name == name)
        part, _, number = inner.partition(".")
        kind = type(getattr(motion, part)) if number else FootMotion
        inner = number or part
    elif table == "region":
        kind = type(next(each for each in task.covers if each.name == name).region)
    else:
        return ""
    # Elements of an array have the array's unit.
    return quantities.units_of(kind).get(inner.partition(".")[0], "")
