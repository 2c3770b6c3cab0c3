"""Reads metrics.json: every key is checked for its type and range, once for all readers."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, get_args

import msgspec

from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.files import input_file, tables
from fivebar_sim.metrics import measured
from fivebar_sim.metrics.measured import Judged, Verdict
from fivebar_sim.robots import measured as robots


def read(file: Path, *, grounded: bool, robot: bool = False) -> Judged:
    """Return all of metrics.json, checked.

    Args:
        file: The metrics.json of a run directory.
        grounded: Whether the run was in a scene with a ground, which has metrics of its own.
        robot: Whether it was a robot's.

    Raises:
        RunDirectoryError: It cannot be read, is not JSON, lacks a key, has an unknown one, or a
            value out of its range; names the file and the key.
    """
    try:
        metrics = input_file.read_json(file)
    except OSError as error:
        raise RunDirectoryError(f"cannot read {file}: {error.strerror or error}") from None
    except ValueError as error:
        raise RunDirectoryError(f"{file} is not JSON: {error}") from None

    # msgspec would recurse as deep as the file goes.
    if tables.is_deep(metrics):
        raise RunDirectoryError(f"{file} is not of a run: nested too deep")

    try:
        found = robots.read(metrics) if robot else measured.read(metrics)
    except msgspec.ValidationError as error:
        raise RunDirectoryError(f"{file}: {_explain(str(error), metrics)}") from None

    parts = {
        "ground": found.ground,
        "ground_peak": found.ground_peak,
        "whole.ground_peak": found.whole.ground_peak,
        "whole.at.ground_peak": found.whole.at.ground_peak,
    }
    for key, table in parts.items():
        if grounded == (table is msgspec.UNSET):
            which = "lacks" if grounded else "must not have"
            raise RunDirectoryError(f"{file}: a run of this scene {which} the key {key}")
    return found


def _explain(message: str, metrics: Any) -> str:
    """Return msgspec's message, with the key in front of it and the value behind."""
    text, _, at = message.partition(" - at `$")
    key = at.rstrip("`").lstrip(".")
    missing = re.fullmatch(r"Object (missing required|contains unknown) field `(.+)`", text)
    if missing:
        dotted = f"{key}.{missing[2]}".lstrip(".")
        if missing[1] == "contains unknown":
            return f"unknown key {dotted}"
        return f"{dotted} is missing: run its scenario.toml again"

    came = f"got {_at(metrics, key)!r:.60}"
    name = key or "the file"
    if text.startswith("Invalid enum value"):
        legal = ", ".join(map(repr, get_args(Verdict)))
        return f"{name} must be one of {legal}, {came}"

    # A table's own check has a message of its own; all others begin with "Expected".
    expected = re.fullmatch(r"Expected `([^`]+)`(.*?)(, got .*)?", text)
    if not expected:
        return f"{name}: {text}"

    words = [tables.WORDS.get(word, word) for word in expected[1].split(" | ")]
    return f"{name} must be {' or '.join(words)}{expected[2]}, {came}"


def _at(value: Any, key: str) -> Any:
    """Return what stands at a key like "guards[0].ok"."""
    for part in re.findall(r"[^.\[\]]+", key):
        if part == "...":  # msgspec's word for a key of any name
            return value
        value = value[int(part)] if isinstance(value, list) else value[part]
    return value
