"""A check of a task's ranges: every value at their ends must be legal by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fivebar_sim.design.task.task import Task
from fivebar_sim.design.task.variables import Variable
from fivebar_sim.errors import ConfigError, FiveBarError


def load(source: str | Path) -> Task:
    """Return the task of a TOML file, or of a shipped one by its name, with its ranges checked.

    Raises:
        ConfigError: The file cannot be read, or a key is unknown or its value illegal; the message
            names both.
    """
    task = Task.load(source)
    check_ends(task)
    return task


def check_ends(task: Task) -> None:
    """Raise if a value at an end of a range is illegal, whatever the other values are.

    Raises:
        ConfigError: Names the key.
    """
    low, high = task.bounds
    middle = task.from_unit(0.5 + 0.0 * low[None])[0]

    for k, variable in enumerate(task.variation.variables):
        for end in (low[k], high[k]):
            row = middle.copy()
            row[k] = end
            try:
                task.motions_of(row)
                task.covers_of(row)
                if "can never close" not in (text := _refusal(task, row)) and text:
                    raise ConfigError(text)
            except FiveBarError as error:
                raise ConfigError(
                    f"{task.where}: [vary]: {variable.key} = {_shown(variable, end)}: {error}"
                ) from None


def _refusal(task: Task, row: Any) -> str:
    """Return why a leg is refused, or ""."""
    try:
        task.leg_of(row)
    except FiveBarError as error:
        return str(error)
    return ""


def _shown(variable: Variable, value: float) -> str:
    return f"{variable.choice[round(value)]!r}" if variable.choice else f"{value:g}"
