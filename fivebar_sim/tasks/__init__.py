"""Tasks for a learning agent: goal, observation, reward, and when an episode ends.

Pure NumPy over many legs at once. A task is a frozen table of numbers with a `kind`, like a scene.
"""

from __future__ import annotations

from typing import Any

import msgspec

from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.geometry import FiveBar
from fivebar_sim.tasks.base import ACTIONS, Action, Part, Task
from fivebar_sim.tasks.gait import Gait
from fivebar_sim.tasks.hop import Hop
from fivebar_sim.tasks.motion import REASONS, Motion
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
    "task",
]

KINDS: dict[str, type[Task]] = {
    str(kind.__struct_config__.tag): kind for kind in (Track, Stand, Hop, Gait)
}


def task(kind: str | Task, **options: Any) -> Task:
    """Return a task of the given kind.

    Args:
        kind: "track", "stand", "hop" or "gait"; or a task to change.
        options: Attributes of the task; leg and servo also as a preset's name or a TOML file.

    Raises:
        ArgumentError: Unknown kind or option, or a value out of range.
        ConfigError: Unknown preset of leg or servo.
    """
    if not isinstance(kind, Task) and kind not in KINDS:
        raise ArgumentError(unknown("task", str(kind), KINDS))

    known = KINDS[kind] if isinstance(kind, str) else type(kind)
    for name in options:
        if name not in known.__struct_fields__:
            what = f"option of task {known.__struct_config__.tag!r}"
            raise ArgumentError(unknown(what, name, known.__struct_fields__))

    # So that gymnasium.make("fivebar/Track-v0", leg="q8bot") needs no import of ours.
    for name, preset in (("leg", FiveBar), ("servo", Servo)):
        if name in options and not isinstance(options[name], preset):
            options[name] = preset.load(options[name])

    if isinstance(kind, Task):
        return msgspec.structs.replace(kind, **options)
    return KINDS[kind](**options)
