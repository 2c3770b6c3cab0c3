"""`fivebar export`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Maybe
from fivebar_sim.errors import ConfigError


def export(
    what: Positional[Annotated[str, arg(metavar="LEG|SCENARIO|ROBOT|RUN_DIR")]],
    /,
    *,
    mjcf: Annotated[Maybe[Path], arg(metavar="FILE")] = None,
    urdf: Annotated[Maybe[Path], arg(metavar="FILE")] = None,
    robot: bool = False,
    c: Annotated[Maybe[str], arg(metavar="DIR")] = None,
    table: Annotated[Maybe[Path], arg(metavar="FILE")] = None,
    unit: Annotated[str, arg(metavar="UNIT")] = "rad",
    rate: Annotated[float, arg(metavar="HZ")] = 50.0,
    servos: Annotated[str, arg(metavar="TABLE")] = "hanging",
    ends: Annotated[Maybe[tuple[int, int]], arg(metavar="FIRST LAST")] = None,
    mcap: Annotated[Maybe[Path], arg(metavar="FILE")] = None,
) -> int:
    """Write a leg as MJCF, URDF or C, a gait as a table, a run as MCAP.

    docs/how-to/bring-a-model.md has more about models, docs/firmware.md about the library,
    docs/servos.md about the tables.

    Args:
        what: A shipped name or a TOML file: with --mjcf or --urdf a leg, a scenario or a robot,
            with --c a leg, with --table a scenario; with --mcap a run directory.
        mjcf: File for the model that `fivebar run` simulates, .xml, for MuJoCo's viewer and MuJoCo
            Warp.
        urdf: File for the leg or the robot as a tree, .urdf; its closed loops are written beside
            it, in a YAML.
        robot: With --mjcf and --urdf, a name that legs and robots share is the robot's.
        c: Folder for fivebar_leg.h, fivebar_leg.c, an example sketch and what Arduino and
            PlatformIO ask for. An earlier export there is replaced.
        table: File for the motor angles along the scenario's path, .h (a const array) or .csv; one
            period of a path that repeats.
        unit: Of the table: rad, deg, count, us, or the published conversions to whole degrees,
            published-rounded and published-truncated.
        rate: Rows of the table a second; a period must have a whole number of them.
        servos: For counts and microseconds: hanging, published or xl330.
        ends: First and last command of the servos' range (hobby servos: 0 180 counts, 500 2500 us).
        mcap: File for every step of a run, .mcap, for Foxglove and PlotJuggler: units are in its
            schema, scenario and metrics are attached. Needs the extra logs.
    """
    _check_one({"--mjcf": mjcf, "--urdf": urdf, "--c": c, "--table": table, "--mcap": mcap})
    if mjcf is not None:
        return _mjcf(what, mjcf, robot)
    if urdf is not None:
        return _urdf(what, urdf, robot)
    if robot:
        raise ConfigError("--robot goes with --mjcf or --urdf")
    if mcap is not None:
        return _mcap(what, mcap)
    if table is not None:
        return _table(what, table, unit, rate, servos, ends)

    from fivebar_sim.firmware import export as firmware_export
    from fivebar_sim.geometry import FiveBar

    assert c is not None
    chosen = FiveBar.load(what)
    place = firmware_export.write(chosen, c)
    print(f"{chosen.name}: written as C to {place}")  # noqa: T201
    return 0


def _check_one(wanted: Mapping[str, object]) -> None:
    """Raise unless exactly one of the options that name a place is given."""
    given = [name for name, place in wanted.items() if place is not None]
    if not given:
        raise ConfigError(
            "say what to export: --mjcf FILE, --urdf FILE, --c DIR, --table FILE or --mcap FILE"
        )
    if len(given) > 1:
        raise ConfigError(f"{' and '.join(given)}: export one at a time")


def _check_suffix(place: Path, suffix: str) -> None:
    if place.suffix != suffix:
        raise ConfigError(f"cannot write {place}: the file must end in {suffix}")


def _mjcf(source: str, place: Path, robot: bool) -> int:
    """Write what is simulated as MJCF."""
    from fivebar_sim.formats import mjcf, subject

    _check_suffix(place, ".xml")
    chosen = subject.load(source, robot=robot)
    cleared = mjcf.write(chosen, place)
    print(f"{chosen.words}: written as MJCF to {place}")  # noqa: T201
    if cleared:
        print(f"cleared for MuJoCo Warp: {', '.join(cleared)}")  # noqa: T201
    return 0


def _urdf(source: str, place: Path, robot: bool) -> int:
    """Write a leg or a robot as URDF, with its loops beside."""
    from fivebar_sim.formats import subject, urdf

    _check_suffix(place, ".urdf")
    chosen = subject.load(source, robot=robot)
    beside = urdf.write(chosen, place)
    print(  # noqa: T201
        f"{chosen.words}: written as URDF to {place}, what closes its loops to {beside}"
    )
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


def _mcap(source: str, place: Path) -> int:
    """Write a run."""
    from fivebar_sim.runs import mcap, stored

    run = stored.read(Path(source))
    mcap.write(run, place)
    print(f"{run.scenario.name}: {run.scenario.steps} steps written as MCAP to {place}")  # noqa: T201
    return 0
