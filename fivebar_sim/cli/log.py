"""`fivebar log`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Maybe, screen, spinner

if TYPE_CHECKING:
    from rich.console import Console

    from fivebar_sim.logs.log import Log
    from fivebar_sim.logs.raw import Raw
    from fivebar_sim.logs.survey import Survey, Timing


def log(
    file: Positional[Annotated[Path, arg(metavar="FILE")]],
    /,
    *,
    leg: Maybe[str] = None,
    write: Annotated[Maybe[Path], arg(name="map", metavar="TOML")] = None,
) -> int:
    """Show what a log holds: columns, rate, gaps, ranges, and guesses.

    Args:
        file: CSV of any kind, JSON lines, Parquet or MCAP; or a TOML file with a table [log], whose
            channels are then shown in SI units.
        leg: A leg that its angles are held against: a preset's name or a TOML file.
        write: Write the guessed table [log] there, to be checked and completed by hand.
    """
    from fivebar_sim.logs import load

    out = screen()
    if file.suffix.lower() == ".toml":
        _show(load(file), leg, out)
        return 0

    from fivebar_sim.logs import guess, survey
    from fivebar_sim.logs.opening import open_file

    with spinner(f"reading {file}", quiet=False):
        raw = open_file(file)
        found = survey.survey(raw)
        table = guess.guess(raw, found)
        time = _timing(raw, table)
    _print_survey(raw, found, table, time, out)
    if write is not None:
        _write(write, file, table)
        out.print(f"guesses written to {write}: check columns, units, signs and offsets there")
    if leg is not None:
        _show(load(file if write is None else write), leg, out)
    return 0


def _timing(raw: Raw, table: dict[str, Any]) -> Timing | None:
    """Return what the column that is guessed to be the time says."""
    from fivebar_sim.logs import survey
    from fivebar_sim.logs.column_map import read_map

    if "time" not in table:
        return None
    scaled = read_map({"time": table["time"]}, raw.where).channels["time"]
    return survey.timing(raw, scaled.column, scaled.scale)


def _print_survey(
    raw: Raw, found: Survey, table: dict[str, Any], time: Timing | None, out: Console
) -> None:
    """Print a file's columns, its clock, and what is odd."""
    from rich.markup import escape
    from rich.table import Table

    out.print(escape(f"{raw.where}: {raw.what}; {found.rows} rows"), soft_wrap=True)
    guessed = {}
    for channel, entry in table.items():
        if channel != "rate":
            told = {"column": entry} if isinstance(entry, str) else entry
            guessed[told["column"]] = " ".join(
                [channel, *([told["unit"]] if "unit" in told else [])]
            )
    shown = Table("column", "rows", "least", "largest", "guess", box=None)
    for name, content in found.columns.items():
        is_number = content.kind == "numbers"
        ends = (f"{content.low:.9g}", f"{content.high:.9g}") if is_number else (content.kind, "")
        shown.add_row(escape(name), str(content.there), *ends, guessed.get(name, ""))
    out.print(shown)
    out.print(_clock_words(time), soft_wrap=True)
    for remark in dict.fromkeys(raw.remarks):
        out.print(f"[yellow]{escape(remark)}[/yellow]", soft_wrap=True)


def _clock_words(time: Timing | None) -> str:
    """Return what the clock says, as a line."""
    from fivebar_sim import units

    if time is None:
        return "no column of time that grows: the table needs its rate [Hz]"
    said = [
        f"{1.0 / time.interval:.6g} Hz",
        units.text(time.span, "s"),
        f"{time.gaps} gaps" + (f", longest {units.text(time.longest, 's')}" if time.gaps else ""),
    ]
    if time.repeated:
        said.append(f"{time.repeated} times repeated")
    if time.jumps:
        said.append(f"the clock jumps {time.jumps} times: see `jumps`")
    return "; ".join(said)


def _show(log: Log, leg: str | None, out: Console) -> None:
    """Print a log in SI units; hold it against a leg if there is one."""
    import numpy as np
    from rich.markup import escape
    from rich.table import Table

    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.kinematics.logged import check_closes
    from fivebar_sim.logs.channels import LEG

    shown = Table("channel", "samples", "least", "largest", box=None)
    for name, values in log.channels.items():
        there = values[np.isfinite(values)]
        ends = (f"{there.min():.6g} {LEG[name]}", f"{there.max():.6g} {LEG[name]}")
        shown.add_row(name, str(len(there)), *ends)
    out.print(shown)
    gaps = len(log.gaps)
    longest = f", longest {log.gaps[0].length:.4g} s at {log.gaps[0].start:.6g} s" if gaps else ""
    out.print(
        f"{len(log.time)} rows, {1.0 / log.interval:.6g} Hz, {log.duration:.6g} s; "
        f"{gaps} gaps{longest}",
        soft_wrap=True,
    )
    for remark in log.remarks:
        out.print(f"[yellow]{escape(remark)}[/yellow]", soft_wrap=True)
    if leg is not None and log.has("theta_A", "theta_E"):
        against = FiveBar.load(leg)
        check_closes(against, log.time, log.pair("theta"), log.where)
        out.print(f"the loop of the leg {against.name} closes in every row")


def _write(place: Path, file: Path, table: dict[str, Any]) -> None:
    """Write a table [log] for a file."""
    import os

    import tomli_w

    from fivebar_sim.files import whole_file

    # Relative to the table's own folder, as it is read.
    named = os.path.relpath(file, place.parent)
    text = tomli_w.dumps({"log": {"file": named, **table}})
    whole_file.write(place, f"# Guessed: check columns, units, signs and offsets.\n{text}")
