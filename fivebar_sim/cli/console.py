"""Tables for people: metrics in mm, um, mN m and percent."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import SHOWN, shown
from fivebar_sim.metrics.limits import bounds, has, look_up
from fivebar_sim.metrics.measured import NOT_JUDGED
from fivebar_sim.runs.side_by_side import side_by_side

if TYPE_CHECKING:
    from fivebar_sim.regression.comparison import Checked, Compared
    from fivebar_sim.regression.convergence import Study
    from fivebar_sim.rollout import Result
    from fivebar_sim.scenario import Scenario

WIDEST = 300
"""Widest table in a file or a pipe, in characters; there a table takes what it needs."""

FIRST = ("tracking.rms", "robot.speed")
"""Metrics for the line of a run: the first that it has."""

WORDS = {
    "pass": "[green]pass[/green]",
    "fail": "[red]FAIL[/red]",
    NOT_JUDGED: "[yellow]not judged (guards hold)[/yellow]",
}
"""Verdicts with rich's colour tags."""


def verdict(ok: bool) -> str:
    """Return "pass" or "FAIL" with rich's colour tags."""
    return WORDS["pass" if ok else "fail"]


def print_result(result: Result, remarks: Sequence[str], where: str, console: Console) -> None:
    """Print one run: its metrics with their limits, the verdict, and the run directory.

    Args:
        result: The run.
        remarks: Its warnings.
        where: Its run directory.
        console: Where to print it.
    """
    window = result.measured.window
    scenario = result.scenario
    title = f"{scenario.name}: {scenario.words}; window {window.begin:.4g} to {window.end:.4g} s"
    columns = ("metric", "window", "whole run", "limit", "verdict")
    table = _table(escape(title), columns)
    limits = {limit.key: limit for limit in result.limits}
    for row in side_by_side(result.metrics, limits):
        judged = (row.limit, verdict(row.ok)) if row.limit else ("", "")
        table.add_row(row.label, row.window, row.run, *judged)

    console.print(table)
    for said in guards.tripped(result.measured.guards):
        console.print(f"[red]{said}[/red]", soft_wrap=True)

    for remark in remarks:
        console.print(f"[yellow]warning: {escape(remark)}[/yellow]", soft_wrap=True)

    console.print(f"verdict: {WORDS[result.verdict]}   written to {escape(where)}", soft_wrap=True)


def print_line(result: Result, remarks: Sequence[str], where: str, console: Console) -> None:
    """Print one of several runs as a line; below it what failed, and warnings.

    The arguments are those of `print_result`.
    """
    from fivebar_sim.regression import comparison

    first = [key for key in FIRST if has(result.metrics, key)][:1]
    said = [f"{SHOWN[key][0]} {shown(key, look_up(result.metrics, key))}" for key in first]
    line = "  ".join([WORDS[result.verdict], escape(result.scenario.name), *said])
    console.print(f"{line}  written to {escape(where)}", soft_wrap=True)

    failures = comparison.compare(result, None).failures
    for failure in failures if result.verdict == "fail" else ():
        console.print(f"  [red]{escape(failure)}[/red]", soft_wrap=True)
    for remark in remarks:
        console.print(f"  [yellow]warning: {escape(remark)}[/yellow]", soft_wrap=True)


def print_summary(verdicts: Mapping[str, str], console: Console) -> None:
    """Print how many of several runs have which verdict, and which of them failed.

    Args:
        verdicts: Verdict of each scenario by name; "diverged" where there is none.
        console: Where to print.
    """
    counts = Counter(verdicts.values())
    parts = [f"{count} {verdict}" for verdict, count in counts.items()]
    bad = [name for name, verdict in verdicts.items() if verdict in ("fail", "diverged")]
    line = f"{len(verdicts)} runs: {', '.join(parts)}"
    console.print(line + (f": {escape(', '.join(bad))}" if bad else ""), soft_wrap=True)


def print_check(checked: Sequence[Checked], console: Console) -> None:
    """Print many runs as one table, each name above its metrics; then failures and notes."""
    columns = ("metric", "limit", "baseline", "now", "change", "verdict")
    title = "limits and baselines; (run): over the whole run, all else over the window"
    table = _table(title, columns)
    for each in checked:
        table.add_row(f"[bold]{escape(each.name)}[/bold]")
        for row in each.rows:
            then = shown(row.key, row.recorded.value) if row.recorded else ""
            limit = bounds(row.limit) if row.limit else ""
            now = shown(row.key, row.now)
            table.add_row(f" {SHOWN[row.key][0]}", limit, then, now, row.change, _word(row))
        if each.broke:
            table.add_row(" run", *[""] * 4, verdict(False))
        elif not each.rows:
            table.add_row(" no limits set", *[""] * 4, WORDS[NOT_JUDGED])

    # A pipe or a file has no width; rich would assume 80 columns and cut long names.
    options = console.options.update(max_width=WIDEST)
    wide = None if console.is_terminal else Measurement.get(console, options, table).maximum
    console.print(table, width=wide, crop=False)
    for each in checked:
        failures = [(verdict(False), line) for line in each.failures]
        for word, line in [*failures, *(("note", line) for line in each.remarks)]:
            console.print(f"{word}: {escape(each.name)}: {escape(line)}", soft_wrap=True)


def print_convergence(
    scenario: Scenario,
    found: Study,
    other: Study | None,
    failed: Collection[str],
    console: Console,
) -> None:
    """Print how a scenario's metrics converge; then guards that tripped on the way."""
    h = found.timesteps[0]
    title = f"{scenario.name}: {found.integrator}, h = {1e3 * h:g} ms and finer"
    beside = [] if other is None else [other.integrator]
    table = _table(escape(title), ["metric", "at h", "limit", "order", "error", *beside, ""])
    for key, each in found.metrics.items():
        order = "" if each.order is None else f"{each.order:.1f}"
        error = "undefined" if each.error is None else f"{1e2 * each.error:.1f} %"
        limits = [_limit(key, study) for study in (found, other) if study is not None]
        row = (shown(key, each.value), limits[0], order, error, *limits[1:])
        table.add_row(SHOWN[key][0], *row, verdict(key not in failed))

    console.print(table)
    for study in (found, other):
        for line in [] if study is None else _tripped(study):
            console.print(f"note: {escape(line)}", soft_wrap=True)


def _limit(key: str, study: Study) -> str:
    """Return a metric's limit; "none" where it does not converge."""
    limit = study.metrics[key].limit
    return "none" if limit is None else shown(key, limit)


def _tripped(study: Study) -> list[str]:
    """Return the messages of the guards that tripped, with the run that they are of."""
    runs = zip(study.timesteps, study.tripped, strict=True)
    return [f"{study.integrator} at {1e3 * h:g} ms: {line}" for h, said in runs for line in said]


def _word(row: Compared) -> str:
    """Return a metric's verdict with rich's colour tags."""
    plain = row.verdict in ("pass", "FAIL")
    return verdict(row.verdict == "pass") if plain else f"[cyan]{row.verdict}[/cyan]"


def _table(title: str, columns: Sequence[str]) -> Table:
    """Return an empty table: numbers aligned right, no wrapping, for 80 columns."""
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", padding=0)
    for column in columns:
        number = column not in ("metric", "verdict", "")
        table.add_column(column, justify="right" if number else "left", no_wrap=True)
    return table
