"""`fivebar check`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from fivebar_sim.cli.common import (
    NO_WORDS,
    Maybe,
    Order,
    Scenarios,
    Settings,
    batches,
    orders_of,
    screen,
    spinner,
)
from fivebar_sim.cli.terminal import FAILED, WRONG, say
from fivebar_sim.errors import ConfigError, DivergedError, RunDirectoryError

if TYPE_CHECKING:
    from fivebar_sim.regression.baseline import Baseline
    from fivebar_sim.regression.comparison import Checked
    from fivebar_sim.rollout import AnyPlan, Result


def check(
    scenarios: Scenarios = NO_WORDS,
    /,
    *,
    settings: Settings = NO_WORDS,
    update: bool = False,
    junit: Annotated[Maybe[Path], arg(metavar="FILE")] = None,
    summary: Annotated[str, arg(metavar="FILE")] = "",
    keep: Annotated[Path, arg(metavar="DIR")] = Path("runs/failed"),
    quiet: bool = False,
) -> int:
    """Check scenarios against limits, guards and recorded baselines.

    Exit status 1 if any is broken.

    The baseline of FILE.toml is baselines/FILE.json beside it: recorded metrics, and how far each
    may move. A metric that got worse by more fails; one that got better is reported. Without a
    baseline only the limits and guards decide; a scenario without limits is refused.

    Args:
        scenarios: Names of shipped scenarios or paths of TOML files; by default all shipped ones.
        settings: Change one key of every scenario, e.g. sim.timestep=0.0005; may be repeated.
        update: Record the measured metrics as new baselines, for all runs within their limits.
        junit: Write the verdicts as JUnit XML.
        summary: Append the verdicts as Markdown, for the page of a CI job ("$GITHUB_STEP_SUMMARY");
            "" for none, as that variable is outside of GitHub.
        keep: Folder for the run directories of failed scenarios, each under its name; replaced when
            the scenario fails again, never deleted.
        quiet: Print nothing but errors.
    """
    from fivebar_sim.files import resources
    from fivebar_sim.regression import baseline

    _check_options(keep, updates_changed=update and bool(settings))
    sources = scenarios or tuple(resources.shipped("scenarios"))
    # Everything that can be refused is refused here, before minutes of simulation.
    orders = orders_of(sources, settings)
    _check_names(orders)
    _check_limits(sources, orders)
    places = [baseline.place(source) for source in sources]
    olds = [baseline.read(place) for place in places]
    _check_places(junit, summary)

    checked: list[Checked] = []
    status = 0
    with spinner(f"checking {len(orders)} scenarios", quiet=quiet):
        # Of each batch only the verdicts stay: the records of all would not fit in memory.
        for result, name in _results(orders):
            each = _judge(name, result, olds[len(checked)])
            if update:
                each = _update(each, result, olds[len(checked)], places[len(checked)])
            # Of a run that cannot be written the others' verdicts still count.
            status = max(status, _status(each, ok=_keep(each, result, keep)))
            checked.append(each)

    if not quiet:
        from fivebar_sim.cli import console

        console.print_check(checked, screen())

    _publish(checked, junit, summary)
    return status


def _publish(checked: list[Checked], junit: Path | None, summary: str) -> None:
    """Write the verdicts for a CI job, if requested."""
    from fivebar_sim.files import whole_file
    from fivebar_sim.regression import ci_files

    if junit is not None:
        whole_file.write(junit, ci_files.junit(checked))
    if summary:
        whole_file.append(Path(summary), ci_files.markdown(checked))


def _check_options(keep: Path, *, updates_changed: bool) -> None:
    """Raise if options contradict each other, or --keep names no directory."""
    if updates_changed:
        raise ConfigError("--update records scenarios as their files say: leave out --set")
    if keep == Path():
        raise ConfigError("--keep must name a directory, got the current one")


def _check_places(junit: Path | None, summary: str) -> None:
    """Raise if the verdicts cannot be written."""
    from fivebar_sim.files import whole_file

    if junit is not None:
        whole_file.check_place(junit)
    if summary:
        # A CI job's summary is shared by its steps, so it is only ever appended to.
        whole_file.append(Path(summary), "")


def _check_names(orders: list[Order]) -> None:
    """Raise if two scenarios have the same name: it identifies their verdicts."""
    names = [order.scenario.name for order in orders]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"two scenarios are called {name!r}: give each its own name")


def _check_limits(sources: Sequence[str], orders: list[Order]) -> None:
    """Raise if a scenario sets no limits: whatever it does would be fine."""
    for source, order in zip(sources, orders, strict=True):
        if not order.scenario.limits:
            raise ConfigError(
                f"{source}: [limits] must set at least one limit: without any, check has nothing "
                "to judge"
            )


def _results(orders: list[Order]) -> Iterator[tuple[Result | DivergedError, str]]:
    """Yield every scenario's result, or the error of one that diverges, and the scenario's name."""
    for batch in batches(orders):
        names = [order.scenario.name for order in batch]
        yield from zip(_together([order.take() for order in batch]), names, strict=True)


def _together(plans: list[AnyPlan]) -> list[Result | DivergedError]:
    """Return what comes of plans that are simulated together."""
    from fivebar_sim import rollout

    try:
        return [*rollout.run_all(plans, nthread=0)]
    # The batch ends as a whole; one by one the others still get their verdicts, bit for bit.
    except DivergedError:
        return [_run_alone(planned) for planned in plans]


def _run_alone(planned: AnyPlan) -> Result | DivergedError:
    from fivebar_sim import rollout

    try:
        return rollout.execute(planned)
    except DivergedError as error:
        return error


def _judge(name: str, result: Result | DivergedError, old: Baseline | None) -> Checked:
    """Return a scenario's verdict; print the error of one that diverged."""
    from fivebar_sim.regression import comparison

    if isinstance(result, DivergedError):
        say(result)
        return comparison.Checked(name, [], str(result).removeprefix(f"{name}: "), [])
    return comparison.compare(result, old, result.remarks)


def _update(
    checked: Checked, result: Result | DivergedError, old: Baseline | None, place: Path
) -> Checked:
    """Record a run within its limits as the new baseline; return the updated verdict."""
    from fivebar_sim.regression import baseline, comparison

    if isinstance(result, DivergedError) or result.verdict != "pass":
        return checked._replace(notes=[*checked.notes, "its baseline is not updated: it failed"])
    accepted = comparison.accept(checked)
    new = baseline.record(result.metrics, old)
    if new == old:
        return accepted
    baseline.write(place, new)
    return accepted._replace(notes=[f"baseline recorded in {place}"])


def _keep(checked: Checked, result: Result | DivergedError, folder: Path) -> bool:
    """Write the run directory of a failed scenario and note where; return False if it cannot.

    A scenario that passed, or diverged, has nothing to write.
    """
    if not checked.failures or isinstance(result, DivergedError):
        return True

    try:
        place = result.write(folder / checked.name)
    except RunDirectoryError as error:
        say(error)
        return False

    checked.notes.append(f"its run is kept in {place}")
    return True


def _status(checked: Checked, *, ok: bool) -> int:
    """Return the exit status of a scenario, given whether its run could be kept."""
    if not ok:
        return WRONG
    return FAILED if checked.failures else 0
