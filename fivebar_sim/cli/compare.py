"""`fivebar compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, UseAppendAction, arg

from fivebar_sim.cli.common import NO_WORDS, Maybe, Settings, Words, screen, spinner
from fivebar_sim.cli.terminal import FAILED

if TYPE_CHECKING:
    from rich.console import Console

    from fivebar_sim.overlay.compare import Compared, Judged

Limits = UseAppendAction[Annotated[Words, arg(name="limit", metavar="KEY=VALUE")]]


def compare(
    scenario: Positional[Annotated[str, arg(metavar="SCENARIO")]],
    log: Positional[Annotated[Path, arg(metavar="LOG")]],
    /,
    *,
    settings: Settings = NO_WORDS,
    limits: Limits = NO_WORDS,
    settled: float = 0.25,
    out: Annotated[Maybe[Path], arg(metavar="HTML")] = None,
    recording: Annotated[Maybe[Path], arg(metavar="RRD")] = None,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Lay a real leg's log over the simulated leg, sent its commands.

    Without commands in the log the scenario's own motion is run. Exit status 1 if a limit is
    broken, so that CI can guard that the model still fits the robot.

    Args:
        scenario: Name of a shipped scenario, or path of a TOML file.
        log: A TOML file with a table [log], and perhaps [limits]; or a file with the channels'
            own names, as `fivebar run --log csv` writes it.
        settings: Change one key of the scenario, e.g. servo.kp=6.0; may be repeated.
        limits: An upper bound, in SI units, e.g. theta_A.rms=0.02, of delay or of rms, bias, max or
            explained of theta_A, foot_x, torque_A, current_A and the like; may be repeated.
        settled: Time at the start that is not compared, since the run begins at rest [s].
        out: Write a page that shows log over run.
        recording: Write a Rerun recording of both legs, the logged one in grey.
        quiet: Print nothing but errors.
        json: Print JSON instead of a table.
    """
    import json as text

    from rich.markup import escape

    from fivebar_sim.checks import check_number
    from fivebar_sim.errors import ConfigError
    from fivebar_sim.logs import load
    from fivebar_sim.overlay import compare as comparing
    from fivebar_sim.overlay import page
    from fivebar_sim.scenario import Scenario

    check_number("--settled", settled, "s", low=0.0, error=ConfigError)
    loaded = Scenario.load(scenario, settings)
    bounds = _bounds(log, limits)
    with spinner(f"laying {log} over {loaded.name}", quiet=quiet):
        found = comparing.compare(loaded, load(log), settled)
    judged = found.judged(bounds)
    if recording is not None:
        from fivebar_sim.overlay import recording as both

        both.write(found, recording)
    if out is not None:
        page.write(found, judged, out, recording)
    if json:
        values = {**comparing.as_json(found.metrics), "failed": [j.key for j in judged if not j.ok]}
        print(text.dumps(values, indent=2, allow_nan=False))  # noqa: T201
    elif not quiet:
        _print(found, judged, screen())
        for name, place in (("page", out), ("recording", recording)):
            if place is not None:
                screen().print(f"{name} in {escape(str(place))}", soft_wrap=True)
    return FAILED if any(not each.ok for each in judged) else 0


def _bounds(log: Path, limits: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    """Return the limits of a log's TOML file and of the command line, which come first."""
    from fivebar_sim.files import tables
    from fivebar_sim.overlay.compare import KEYS

    table = {}
    if log.suffix.lower() == ".toml":
        table = tables.bounds(
            tables.read(log, "log's table").get("limits", {}), KEYS, "limits", str(log)
        )
    given = {}
    for limit in limits:
        parts, value = tables.parse_setting(limit)
        given[".".join(parts)] = value
    return {**table, **tables.bounds(given, KEYS, "limit", "--limit")}


def _print(found: Compared, judged: list[Judged], console: Console) -> None:
    """Print what is apart, and the limits."""
    from rich.markup import escape
    from rich.table import Table

    from fivebar_sim.cli.console import verdict
    from fivebar_sim.overlay.compare import UNITS
    from fivebar_sim.overlay.page import left, percent, shown, unit_of

    how = "played" if found.is_played else "its own motion"
    console.print(
        escape(
            f"{found.log.where} over {found.scenario.name} ({how}): {len(found.time)} rows; "
            f"the log is {shown(found.delay, 's')} later"
        ),
        soft_wrap=True,
    )
    table = Table("log - run", "RMS", "bias", "largest", "motion explained", "left", box=None)
    for name, channel in found.channels.items():
        parts = channel.parts
        unit = UNITS[name]
        numbers = [shown(parts[part], unit) for part in ("rms", "bias", "max")]
        table.add_row(name, *numbers, percent(parts["explained"]), shown(left(channel)[-1], unit))
    console.print(table)
    for remark in found.log.remarks:
        console.print(f"[yellow]{escape(remark)}[/yellow]", soft_wrap=True)
    for limit in judged:
        unit = unit_of(limit.key)
        console.print(
            f"{limit.key} {shown(limit.value, unit)}, limit {shown(limit.high, unit)}: "
            f"{verdict(limit.ok)}",
            soft_wrap=True,
        )
