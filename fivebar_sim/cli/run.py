"""`fivebar run`."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from fivebar_sim.cli.common import (
    NO_WORDS,
    Maybe,
    Order,
    Scenarios,
    Settings,
    orders_of,
    screen,
    spinner,
)
from fivebar_sim.cli.terminal import FAILED, say
from fivebar_sim.errors import ConfigError, DivergedError

if TYPE_CHECKING:
    from rich.console import Console

    from fivebar_sim.rollout import AnyPlan, Result
    from fivebar_sim.simulation.steps import Watch


def run(
    scenarios: Scenarios = NO_WORDS,
    /,
    *,
    out: Annotated[Maybe[str], arg(metavar="DIR")] = None,
    settings: Settings = NO_WORDS,
    log: Annotated[Maybe[Literal["csv", "mcap"]], arg(metavar="{csv,mcap}")] = None,
    live: bool = False,
    live_at: Annotated[Maybe[str], arg(metavar="HOST:PORT")] = None,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Simulate scenarios, check their limits, write run directories.

    One scenario's metrics are a table; of several each is a line, and the last line sums them up.

    Exit status: 1 if a limit is broken, a guard trips or a run diverges, 2 for wrong input. A
    scenario without limits is not judged: its status is 0 if its guards hold.

    Args:
        scenarios: Names of shipped scenarios or paths of TOML files; by default all shipped ones.
        out: Run directory of one scenario, or the folder of several (default runs/NAME);
            an existing run's own files are replaced, or deleted if the new run diverges; what you
            put beside them stays.
        settings: Change one key of every scenario, e.g. leg.L2=0.07 or "path.radii=[0.02, 0.01]";
            may be repeated. A new path.kind keeps the keys that both kinds have.
        log: Write RUN_DIR/log.csv or .mcap too: what the sensors and the bus would have logged.
        live: Show the runs in a new Rerun viewer while they are simulated.
        live_at: Show them in a viewer that already listens on this machine.
        quiet: Print nothing but errors.
        json: Print the metrics as JSON instead of tables.
    """
    from fivebar_sim.runs import directory

    orders = orders_of(scenarios, settings)
    places = _places(orders, out)
    # A place that cannot be written must not cost a simulation first.
    for place in places:
        directory.check_place(place)
    if log is not None:
        _check_legs(orders, log)
    shown = live or live_at is not None
    viewer = _viewer(live_at) if shown else None
    return _run(orders, places, viewer, log, quiet=quiet, as_json=json)


def _check_legs(orders: list[Order], kind: str) -> None:
    """Raise if a run has no log, or none of a kind."""
    from fivebar_sim.logs import mcap_file
    from fivebar_sim.overlay import measured

    for order in orders:
        measured.check_leg(order.scenario)
    if kind == "mcap":
        mcap_file.needed()


def _viewer(address: str | None) -> str:
    """Return the address of a running viewer; if none is given, start one."""
    from fivebar_sim.recording import live
    from fivebar_sim.render import screen

    if address is not None:
        return live.check_address(address)
    screen.check("--live-at shows the run in a viewer that already listens")
    return live.spawn_viewer()


def _execute(order: Order, viewer: str | None, place: Path) -> Result:
    """Simulate and write one scenario, streaming it to a viewer if there is one."""
    from fivebar_sim import rollout

    if viewer is None:
        # The plan is gone before anything is written: it takes as much memory as the record.
        result = rollout.execute(order.take())
        _write(result, place)
        return result

    planned = order.take()
    with _streaming(planned, viewer) as watch:
        result = rollout.execute(planned, watch)
        # Before the viewer has everything: one that has stalled must not cost the result.
        _write(result, place)
    return result


def _streaming(planned: AnyPlan, viewer: str) -> AbstractContextManager[Watch]:
    """Return a context with a watcher that shows a run in a viewer."""
    from fivebar_sim.recording import live
    from fivebar_sim.walking.plan import RobotPlan
    from fivebar_sim.walking.shown import live as live_robots

    if isinstance(planned, RobotPlan):
        return live_robots.streaming(planned, viewer)
    return live.streaming(planned, viewer)


def _run(
    orders: list[Order],
    places: list[Path],
    viewer: str | None,
    log: str | None,
    *,
    quiet: bool,
    as_json: bool,
) -> int:
    """Run the scenarios one after another; return the highest exit status."""
    import json

    from fivebar_sim.runs import directory

    status = 0
    metrics = {}
    verdicts: dict[str, str] = {}
    out = None if quiet or as_json else screen()
    for order, place in zip(orders, places, strict=True):
        name = order.scenario.name
        try:
            with spinner(f"simulating {name}", quiet=quiet):
                result = _execute(order, viewer, place)
                if log is not None:
                    _write_log(result, place / f"log.{log}")
                # They take further runs: while the spinner turns, and once all is written.
                remarks = [] if out is None else result.remarks
        # The other scenarios still run.
        except DivergedError as error:
            say(error)
            # An older "pass" there would look like this run's.
            directory.discard(place, str(error))
            status = FAILED
            verdicts[name] = "diverged"
            continue
        metrics[name] = result.metrics
        verdicts[name] = result.verdict
        status = max(status, FAILED if result.verdict == "fail" else 0)
        if out is not None:
            _show(result, remarks, place, out, alone=len(orders) == 1)

    if out is not None and len(orders) > 1:
        from fivebar_sim.cli import console

        console.print_summary(verdicts, out)

    if as_json:
        shown = next(iter(metrics.values()), None) if len(orders) == 1 else metrics
        print(json.dumps(shown, indent=2, allow_nan=False))  # noqa: T201
    return status


def _show(result: Result, remarks: list[str], place: Path, out: Console, *, alone: bool) -> None:
    """Print the table of a run that is the only one, or the line of one of several."""
    from fivebar_sim.cli import console

    show = console.print_result if alone else console.print_line
    show(result, remarks, str(place), out)


def _write(result: Result, place: Path) -> None:
    """Write a run directory, and the report anew where there was one."""
    from fivebar_sim.runs.kept import REPORT

    reported = (place / REPORT).is_file()
    result.write(place)
    if reported:
        from fivebar_sim import report

        report.write([place], place / REPORT)


def _write_log(result: Result, place: Path) -> None:
    """Write what the sensors would have logged of a run."""
    from fivebar_sim.overlay import measured, write

    write.write(measured.log_of(result.scenario, result.record), place)


def _places(orders: list[Order], out: str | None) -> list[Path]:
    """Return the run directory of every scenario.

    Raises:
        ConfigError: --out is empty, or two scenarios have the same name and so the same place.
    """
    if out == "":
        raise ConfigError("--out must name a directory, got ''")
    names = [order.scenario.name for order in orders]
    if out is not None and len(orders) == 1:
        return [Path(out)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(f"two scenarios are called {twice[0]!r} and would write to one place")
    return [Path(out or "runs") / name for name in names]
