"""A run as MCAP, which Foxglove and PlotJuggler open: a message a step, its units in the schema."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.logs import mcap_file
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.runs import directory
from fivebar_sim.runs.described import described
from fivebar_sim.runs.stored import StoredRun

LEG = "leg"
ROBOT = "robot"
"""What topic and schema are called."""


def write(run: StoredRun, place: Path) -> None:
    """Write all columns of a run's record; scenario and metrics go with them as attachments.

    Args:
        run: The run.
        place: The file, .mcap.

    Raises:
        ConfigError: Another suffix, or a file that cannot be written.
        ExtraError: The package mcap is not installed.
    """
    if place.suffix != ".mcap":
        raise ConfigError(f"cannot write {place}: the file must end in .mcap")
    name = ROBOT if isinstance(run.scenario, RobotScenario) else LEG
    metrics = json.dumps(run.metrics, indent=2, allow_nan=False)
    beside = {
        "scenario.toml": directory.as_toml(run.scenario).encode(),
        "metrics.json": f"{metrics}\n".encode(),
    }
    whole_file.write(place, encoded(name, run.record, beside))


def encoded(
    name: str, columns: Mapping[str, Array], beside: Mapping[str, bytes] | None = None
) -> bytes:
    """Return columns as MCAP: a message a row, in JSON, at the row's time.

    Args:
        name: What topic and schema are called, "leg".
        columns: `time` [s] and others, (N,) each; NaN is left out of its message.
        beside: Texts to attach, by their names.

    Raises:
        ExtraError: The package mcap is not installed.
    """
    mcap_file.needed()
    from mcap.writer import Writer

    out = io.BytesIO()
    writer = Writer(out)
    writer.start(profile="", library="fivebar-sim")
    number = writer.register_schema(name, "jsonschema", json.dumps(schema(name, columns)).encode())
    channel = writer.register_channel(f"/{name}", "json", number)
    moments = np.rint(1e9 * columns["time"]).astype(np.int64).tolist()
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    for moment, row in zip(moments, rows, strict=True):
        told = {key: value for key, value in zip(columns, row, strict=True) if value == value}
        writer.add_message(channel, moment, json.dumps(told).encode(), moment)

    for file, content in (beside or {}).items():
        writer.add_attachment(0, 0, file, "text/plain", content)
    writer.finish()
    return out.getvalue()


def schema(name: str, columns: Mapping[str, Array]) -> dict[str, object]:
    """Return the JSON schema of a row; `unit` is a word of ours, which readers pass over."""
    fields: dict[str, dict[str, str]] = {}
    for key in columns:
        fields[key] = {"type": "number"}
        known = described(key)
        if known is not None:
            fields[key] |= {"unit": known.unit, "description": known.description}
    return {"title": name, "type": "object", "properties": fields}
