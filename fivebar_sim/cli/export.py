"""`fivebar export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.errors import ConfigError


def export(
    what: Positional[Annotated[str, arg(metavar="LEG|SCENARIO")]],
    /,
    *,
    c: Annotated[str | None, arg(metavar="DIR")] = None,
    table: Annotated[Path | None, arg(metavar="FILE")] = None,
    unit: Annotated[str, arg(metavar="UNIT")] = "rad",
    rate: Annotated[float, arg(metavar="HZ")] = 50.0,
    servos: Annotated[str, arg(metavar="TABLE")] = "hanging",
    ends: Annotated[tuple[int, int] | None, arg(metavar="FIRST LAST")] = None,
) -> int:
    """Write a leg as a C library, or a scenario's gait as a table.

    docs/firmware.md has what the library can do, docs/servos.md the tables.

    Args:
        what: With --c a leg, a preset's name or a TOML file; with --table a scenario.
        c: Folder for fivebar_leg.h, fivebar_leg.c, an example sketch and what Arduino and
            PlatformIO ask for. An earlier export there is replaced.
        table: File for the motor angles along the scenario's path, .h (a const array) or .csv; one
            period of a path that repeats.
        unit: Of the table: rad, deg, count, us, or the published conversions to whole degrees,
            published-rounded and published-truncated.
        rate: Rows of the table a second; a period must have a whole number of them.
        servos: For counts and microseconds: hanging, published or xl330.
        ends: First and last command of the servos' range (hobby servos: 0 180 counts, 500 2500 us).
    """
    if c is None and table is None:
        raise ConfigError("say what to export: --c DIR or --table FILE")
    if c is not None and table is not None:
        raise ConfigError("--c takes a leg and --table a scenario: export one at a time")
    if table is not None:
        return _table(what, table, unit, rate, servos, ends)

    from fivebar_sim.firmware import export as firmware_export
    from fivebar_sim.geometry import FiveBar

    assert c is not None
    chosen = FiveBar.load(what)
    place = firmware_export.write(chosen, c)
    print(f"{chosen.name}: written as C to {place}")  # noqa: T201
    return 0


def _table(
    source: str, place: Path, unit: str, rate: float, servos: str, ends: tuple[int, int] | None
) -> int:
    """Write the table of a scenario."""
    from fivebar_sim import setpoints
    from fivebar_sim.scenario import Scenario
    from fivebar_sim.setpoints.commands import check_ends

    check_ends(unit, ends)
    scenario = Scenario.load(source)
    rows = setpoints.rows(scenario, rate)
    sent = setpoints.commands(scenario.leg, rows.theta, unit, servos=servos, ends=ends)
    setpoints.write(place, rows, sent)
    print(f"{rows.name}: {len(rows.theta)} rows, {sent.said}, written to {place}")  # noqa: T201
    return 0
