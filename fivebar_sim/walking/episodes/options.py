"""The options of environments of robots: what `gymnasium.make` passes on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.robots import Robot
from fivebar_sim.walking.draws import Ranges
from fivebar_sim.walking.task import WalkTask

LOWEST = {"friction": 0.0, "mass": 0.1, "delay": -1.0}
HIGHEST = {"friction": 10.0, "mass": 10.0, "delay": 1.0}
"""Between these each range may be; delays in seconds."""


def task_of(robot: str | Robot, options: Mapping[str, Any]) -> WalkTask:
    """Return the task of some options.

    Args:
        robot: A preset's name, a TOML file, or a `Robot`.
        options: Attributes of `WalkTask`; randomise also as a table or True, its defaults.

    Raises:
        ArgumentError: An unknown option, or a value of the wrong type or out of range.
        ConfigError: An unknown preset, or a file with an illegal value.
    """
    for name in options:
        if name not in WalkTask.__struct_fields__:
            known = sorted({*WalkTask.__struct_fields__} - {"robot"})
            raise ArgumentError(unknown("option of Walk-v0", name, known))
    loaded = robot if isinstance(robot, Robot) else Robot.load(robot)
    return WalkTask(robot=loaded, **{**options, "randomise": _ranges(options.get("randomise"))})


def _ranges(value: Any) -> Ranges | None:
    """Return what is drawn for every episode: of a table, of True, or as it is."""
    if value is None or value is False:
        return None
    if value is True:
        return Ranges()
    table = value._asdict() if isinstance(value, Ranges) else value
    known = Ranges._fields
    if not isinstance(table, Mapping) or not set(table) <= set(known):
        raise ArgumentError(
            f"randomise must be True or a table of {', '.join(known)}, got {value!r}"
        )
    return Ranges(**{name: _range(name, pair) for name, pair in table.items()})


def _range(name: str, pair: Any) -> tuple[float, float]:
    """Return the ends of what one number is drawn from."""
    if not (isinstance(pair, tuple | list) and len(pair) == 2):
        raise ArgumentError(f"randomise.{name} must be two numbers (low, high), got {pair!r}")
    unit = "s" if name == "delay" else ""
    check_number(f"randomise.{name}[0]", pair[0], unit, low=LOWEST[name], high=HIGHEST[name])
    low = float(pair[0])
    check_number(f"randomise.{name}[1]", pair[1], unit, low=low, high=HIGHEST[name])
    return low, float(pair[1])
