"""Logs written out: CSV that any tool reads, and MCAP with a JSON schema, as PlotJuggler opens."""

from __future__ import annotations

from pathlib import Path

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.logs.log import Log
from fivebar_sim.runs import mcap as as_mcap

KINDS = ("csv", "mcap")
"""The formats."""


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
    return as_mcap.encoded(as_mcap.LEG, {"time": log.time, **log.channels})
