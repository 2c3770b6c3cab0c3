"""Tasks for a learning agent: goal, observation, reward, and when an episode ends.

Pure NumPy over many legs at once. A task is a frozen table of numbers with a `kind`, like a scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.tasks.base import ACTIONS, Action, Part, Task
from fivebar_sim.tasks.gait import Gait
from fivebar_sim.tasks.hop import Hop
from fivebar_sim.tasks.motion import REASONS, Motion
from fivebar_sim.tasks.options import as_object, as_struct, read
from fivebar_sim.tasks.randomise import Randomise
from fivebar_sim.tasks.stand import Stand
from fivebar_sim.tasks.track import Track

__all__ = [
    "ACTIONS",
    "KINDS",
    "REASONS",
    "Action",
    "Gait",
    "Hop",
    "Motion",
    "Part",
    "Randomise",
    "Stand",
    "Task",
    "Track",
    "ranges",
    "task",
]

KINDS: dict[str, type[Task]] = {
    str(kind.__struct_config__.tag): kind for kind in (Track, Stand, Hop, Gait)
}


def task(kind: str | Task | Mapping[str, Any], **options: Any) -> Task:
    """Return a task of the given kind.

    Args:
        kind: "track", "stand", "hop" or "gait"; a task to change; or a table with a `kind` and
            options.
        options: Attributes of the task; leg and servo also as a preset's name or a TOML file, and
            leg, servo, path and sensors as tables with the keys of scenarios.

    Raises:
        ArgumentError: Unknown kind or option, or a value of the wrong type or out of range.
        ConfigError: Unknown preset of leg or servo, or a table or file with an illegal value.
    """
    if isinstance(kind, Mapping):
        table = {str(key): value for key, value in kind.items()}
        kind = table.pop("kind", "")
        options = {**table, **options}
    if not isinstance(kind, Task) and not (isinstance(kind, str) and kind in KINDS):
        raise ArgumentError(unknown("task", str(kind), KINDS))

    known = KINDS[kind] if isinstance(kind, str) else type(kind)
    for name in options:
        if name not in known.__struct_fields__:
            what = f"option of task {known.__struct_config__.tag!r}"
            raise ArgumentError(unknown(what, name, known.__struct_fields__))

    if isinstance(kind, Task):
        changes = {name: as_object(name, value) for name, value in options.items()}
        return msgspec.structs.replace(kind, **changes)
    return KINDS[kind](**read(options))


def ranges(randomise: Randomise | Mapping[str, Any] | None) -> Randomise | None:
    """Return the ranges that an environment's option means; None for equal legs.

    Raises:
        ArgumentError: Neither a Randomise nor a table of its keys.
    """
    return None if randomise is None else as_struct("randomise", randomise, Randomise)
