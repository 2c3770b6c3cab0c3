"""What people read of a run: tables in mm, um, mN m and percent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

from fivebar_sim import guards
from fivebar_sim.metrics import Limit, look_up

if TYPE_CHECKING:
    from fivebar_sim.regression import Checked, Row
    from fivebar_sim.rollout import Result

SHOWN = {
    "tracking.rms": ("tracking RMS", 1e3, "mm"),
    "tracking.max": ("tracking max", 1e3, "mm"),
    "closure.rms": ("loop gap RMS", 1e6, "um"),
    "closure.max": ("loop gap max", 1e6, "um"),
    "load.torque_rms.A": ("torque A RMS", 1e3, "mN m"),
    "load.torque_rms.E": ("torque E RMS", 1e3, "mN m"),
    "load.torque_peak.A": ("torque A peak", 1e3, "mN m"),
    "load.torque_peak.E": ("torque E peak", 1e3, "mN m"),
    "load.share_A": ("load share A", 1e2, "%"),
    "load.thermal_share_A": ("thermal share A", 1e2, "%"),
    "load.peak_ratio": ("peak torque ratio", 1.0, ""),
    "load.rms_ratio": ("torque RMS ratio", 1.0, ""),
    "load.work.A.positive": ("work A given", 1e3, "mJ"),
    "load.work.A.negative": ("work A taken", 1e3, "mJ"),
    "load.work.A.net": ("work A net", 1e3, "mJ"),
    "load.work.E.positive": ("work E given", 1e3, "mJ"),
    "load.work.E.negative": ("work E taken", 1e3, "mJ"),
    "load.work.E.net": ("work E net", 1e3, "mJ"),
    "load.opposing.fraction": ("motors opposed", 1e2, "%"),
    "load.opposing.energy": ("energy motor to motor", 1e3, "mJ"),
    "load.saturated.A": ("motor A saturated", 1e2, "%"),
    "load.saturated.E": ("motor E saturated", 1e2, "%"),
    "ground.force_max.x": ("ground force x max", 1.0, "N"),
    "ground.force_max.z": ("ground force z max", 1.0, "N"),
    "ground.stance_share": ("time in stance", 1e2, "%"),
    "ground.slip": ("slip in stance", 1e3, "mm"),
    "ground.foot_height_max": ("foot height max", 1e3, "mm"),
    "ground.flight_max": ("longest flight", 1e3, "ms"),
    "energy.motor": ("work of the motors", 1e3, "mJ"),
    "energy.force": ("work of the pushes", 1e3, "mJ"),
    "energy.ground": ("work of the ground", 1e3, "mJ"),
    "energy.constraints": ("work of loop, gears, ends", 1e3, "mJ"),
    "energy.step": ("given by the steps", 1e3, "mJ"),
    "energy.kinetic": ("kinetic energy gained", 1e3, "mJ"),
    "energy.potential": ("potential energy gained", 1e3, "mJ"),
    "energy.turnover": ("energy turned over", 1e3, "mJ"),
    "energy.imbalance": ("energy imbalance", 1e2, "%"),
    "branch.flips": ("branch flips", 1.0, ""),
    "warnings": ("MuJoCo warnings", 1.0, ""),
}
"""What a metric is called, the factor from SI to the shown unit, and that unit."""

DETAILS = (
    *("load.work", "load.opposing", "load.peak_ratio", "load.rms_ratio", "load.saturated"),
    *("energy.motor", "energy.force", "energy.ground", "energy.constraints", "energy.step"),
    *("energy.kinetic", "energy.potential", "energy.turnover"),
)
"""Metrics that are shown only where they have a limit, or where motors saturate."""


SMALLER = {"mm": "um", "um": "nm"}
"""The unit a thousand times smaller, for values that would have two zeros behind the point."""

WIDEST = 300
"""Columns of a table that goes into a file or a pipe, at most; there it takes what it needs."""


def shown(key: str, value: float | None) -> str:
    """Return a metric's value in the unit that people read."""
    _, scale, unit = SHOWN[key]
    if value is None:
        return "undefined"
    number = scale * value
    while 0.0 < abs(number) < 0.01 and unit in SMALLER:
        number, unit = 1e3 * number, SMALLER[unit]
    return f"{number:.4g} {unit}".strip()


def bounds(limit: Limit) -> str:
    """Return a limit in the unit that people read: "<= 1.3 mm", "40 to 60 %"."""
    if limit.low == -math.inf:
        return f"<= {shown(limit.key, limit.high)}"
    low, high = (shown(limit.key, bound) for bound in (limit.low, limit.high))
    unit = high.partition(" ")[2]
    return f"{low.removesuffix(unit).strip()} to {high}"


def verdict(ok: bool) -> str:
    """Return the word for a verdict, coloured for a terminal."""
    return "[green]pass[/green]" if ok else "[red]FAIL[/red]"


def print_result(result: Result, where: str, console: Console) -> None:
    """Print one run: every metric, its limit where it has one, the verdict, and where it lies."""
    limits = {limit.key: limit for limit in result.limits}
    title = f"{result.scenario.name}: {result.scenario.leg.name} leg"
    table = _table(escape(title), ("metric", "value", "limit", "verdict"))
    for key, (label, _, _) in SHOWN.items():
        limit = limits.get(key)
        if key.split(".")[0] not in result.metrics or not (limit or _matters(key, result)):
            continue
        judged = (bounds(limit), verdict(limit.ok)) if limit else ("", "")
        table.add_row(label, shown(key, look_up(result.metrics, key)), *judged)
    console.print(table)
    for said in guards.tripped(result.metrics["guards"]):
        console.print(f"[red]{said}[/red]", soft_wrap=True)
    console.print(
        f"verdict: {verdict(result.verdict == 'pass')}   written to {escape(where)}", soft_wrap=True
    )


def _matters(key: str, result: Result) -> bool:
    """Return whether a metric without a limit is worth a line."""
    if key.startswith("load.saturated"):
        return bool(look_up(result.metrics, key))
    return not key.startswith(DETAILS)


def print_check(checked: Sequence[Checked], console: Console) -> None:
    """Print many runs as one table, the name of each above its metrics; then what stands out."""
    columns = ("metric", "limit", "baseline", "now", "change", "verdict")
    table = _table("foot tracking and load against limits and baselines", columns, gap=0)
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
            table.add_row(" no limits set", *[""] * 4, verdict(True))
    options = console.options.update(max_width=WIDEST)
    wide = None if console.is_terminal else Measurement.get(console, options, table).maximum
    console.print(table, width=wide, crop=False)
    for each in checked:
        failures = [(verdict(False), line) for line in each.failures]
        for word, line in [*failures, *(("note", line) for line in each.remarks)]:
            console.print(f"{word}: {escape(each.name)}: {escape(line)}", soft_wrap=True)


def _word(row: Row) -> str:
    """Return the word for a metric's verdict, coloured for a terminal."""
    plain = row.verdict in ("pass", "FAIL")
    return verdict(row.verdict == "pass") if plain else f"[cyan]{row.verdict}[/cyan]"


def _table(title: str, columns: Sequence[str], gap: int = 1) -> Table:
    """Return an empty table; numbers stand to the right, and nothing wraps at 80 columns."""
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", padding=(0, gap, 0, 0))
    for column in columns:
        number = column in ("value", "limit", "baseline", "now", "change")
        table.add_column(column, justify="right" if number else "left", no_wrap=True)
    return table
