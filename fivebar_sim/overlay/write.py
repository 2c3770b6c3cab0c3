"""Logs written out: CSV that any tool reads, and MCAP with a JSON schema, as PlotJuggler opens."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.logs import mcap_file
from fivebar_sim.logs.log import Log

KINDS = ("csv", "mcap")
"""The formats."""

TOPIC = "/leg"
"""The topic of the messages in MCAP."""


def write(log: Log, place: Path) -> None:
    """Write a log, .csv or .mcap; missing samples are empty cells, or left out.

    Raises:
        ConfigError: Another suffix, or a file that cannot be written.
        ExtraError: MCAP without the package mcap.
    """
    kind = place.suffix.removeprefix(".").lower()
    if kind not in KINDS:
        raise ConfigError(f"cannot write {place}: a log must end in .csv or .mcap")
    whole_file.write(place, csv(log) if kind == "csv" else mcap(log))


def csv(log: Log) -> str:
    """Return a log as CSV, in SI units, a column a channel."""
    columns = [log.time, *log.channels.values()]
    lines = [",".join(["time", *log.channels])]
    for row in zip(*(column.tolist() for column in columns), strict=True):
        lines.append(",".join("" if value != value else f"{value:.9g}" for value in row))
    return "\n".join(lines) + "\n"


def mcap(log: Log) -> bytes:
    """Return a log as MCAP: a message a row, in JSON, at the row's time."""
    mcap_file.needed()
    from mcap.writer import Writer

    out = io.BytesIO()
    writer = Writer(out)
    writer.start(profile="", library="fivebar-sim")
    numbers = {name: {"type": "number"} for name in ("time", *log.channels)}
    schema = json.dumps({"title": "leg", "type": "object", "properties": numbers})
    number = writer.register_schema("leg", "jsonschema", schema.encode())
    channel = writer.register_channel(TOPIC, "json", number)
    columns = {"time": log.time, **log.channels}
    moments = np.rint(1e9 * log.time).astype(np.int64).tolist()
    for k, moment in enumerate(moments):
        row = {name: float(values[k]) for name, values in columns.items()}
        row = {name: value for name, value in row.items() if value == value}
        writer.add_message(channel, moment, json.dumps(row).encode(), moment)

    writer.finish()
    return out.getvalue()
