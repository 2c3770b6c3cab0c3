"""The page that compares several runs: metrics, differences of the scenarios, figures overlaid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.files import tables
from fivebar_sim.metrics import ground
from fivebar_sim.metrics.catalogue import SHOWN, shown
from fivebar_sim.metrics.limits import bounds, look_up
from fivebar_sim.metrics.measured import NOT_JUDGED
from fivebar_sim.metrics.tracking import tracking_error
from fivebar_sim.recording.plots import points
from fivebar_sim.report import axes as scaled
from fivebar_sim.report import draw, html, numbers
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.html import Cell, plain, text
from fivebar_sim.report.look import colour
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = 8
STYLES = ("-", "--", ":", "-.")
NAME = 0.19
"""Height of one line of the legend above a figure [in]."""

MOST_STACKED = 5
"""Most runs whose values a phone shows side by side; tables of more scroll."""

MOST = COLOURS * len(STYLES)
"""Most runs that colours and line styles can distinguish."""


def names(runs: Sequence[StoredRun]) -> list[str]:
    """Return the runs' names: their directories' names, or their paths if two names are equal."""
    short = [numbers.name_of(run) for run in runs]
    return short if len(set(short)) == len(short) else [str(run.path) for run in runs]


def figures(runs: Sequence[StoredRun]) -> list[Drawn]:
    """Return the figures with all runs overlaid; call it within `look.project_style`."""
    drawn = [_foot_paths(runs), *(lines(runs, *each) for each in PLOTS)]
    grounded = [run for run in runs if "ground_z" in run.record]
    return drawn + ([lines(runs, *GROUND)] if grounded else [])


def page(runs: Sequence[StoredRun], drawn: list[Drawn]) -> str:
    """Return the page that compares runs; call it within `look.project_style`."""
    called = names(runs)
    summary = f"{len(runs)} runs: {', '.join(called)}. Differences are to the first."
    anew = [name for name, run in zip(called, runs, strict=True) if run.anew]
    if anew:
        summary += (
            f" The metrics of {', '.join(anew)} are computed anew from the record: metrics.json is "
            "missing there."
        )

    parts = [
        f"<header>\n<h1>{text('Comparison of runs')}</h1>\n<p>{text(summary)}</p>\n</header>",
        html.section("What differs in the scenarios", _differences(runs)),
        html.section("Metrics", _metrics(runs)),
        html.section("What happened", html.figures(drawn)),
    ]
    return html.page(f"Comparison of {', '.join(called)}", parts)


def style(k: int, runs: Sequence[StoredRun]) -> dict[str, Any]:
    """Return colour, style and width of the lines of run k."""
    # Later runs are drawn on top, so earlier ones are wider: equal lines stay visible.
    width = 2.6 - 1.6 * k / max(len(runs) - 1, 1)
    return {"color": colour(f"run-{k % COLOURS + 1}"), "ls": STYLES[k // COLOURS], "lw": width}


def legend(figure: Figure, ax: Axes, called: Sequence[str]) -> None:
    """Name the lines of an axes above the figure."""
    shorter = [name if len(name) <= 40 else f"{name[:18]} ... {name[-18:]}" for name in called]
    drawn = [line for line in ax.lines if line.get_gid() == "run"]
    # Matplotlib leaves out labels that begin with "_", so the names are set afterwards.
    box = figure.legend(drawn, ["" for _ in drawn], loc="outside upper center", ncols=1)
    for entry, name in zip(box.get_texts(), shorter, strict=True):
        entry.set_text(name)


def _foot_paths(runs: Sequence[StoredRun]) -> Drawn:
    """Draw the foot paths of all runs over their targets."""
    figure, ax = draw.plane(4.0 + NAME * len(runs))
    for run in runs:
        ax.plot(*(1e3 * points(run.record, "target")).T, color=colour("wash"), lw=4, alpha=0.35)

    for k, run in enumerate(runs):
        ax.plot(*(1e3 * points(run.record, "foot")).T, gid="run", **style(k, runs))

    legend(figure, ax, names(runs))
    return Drawn(
        "foot-path",
        "Foot paths",
        "The foot's path in the hip frame; grey: the targets.",
        f"The foot paths of {', '.join(names(runs))} in the leg plane, over their targets.",
        figure,
    )


Column = Callable[[StoredRun], Array]


def lines(
    runs: Sequence[StoredRun],
    key: str,
    title: str,
    caption: str,
    columns: dict[str, Column],
    worst: bool,
) -> Drawn:
    """Draw columns of all runs over time.

    Args:
        runs: The runs; one without a column has no line.
        key: Key of the figure.
        title: Title of the figure.
        caption: Caption of the figure.
        columns: One panel each: label with unit, and a function that returns the values.
        worst: Whether to draw only the largest value of each interval, on a logarithmic scale.
    """
    figure, axes = draw.panels(
        *[1.0] * len(columns), height=0.7 + 2.0 * len(columns) + NAME * len(runs)
    )
    cut = False
    axes[-1].set_xlim(0.0, max(float(run.record["time"][-1]) for run in runs))
    for ax, (label, column) in zip(axes, columns.items(), strict=True):
        ax.set_ylabel(label)
        for k, run in enumerate(runs):
            values = column(run)
            rows = draw.highest(values) if worst else draw.envelope(values)
            ax.plot(run.record["time"][rows], values[rows], gid="run", **style(k, runs))
        if worst:
            _by_powers(ax, [float(column(run).max()) for run in runs])
        # The ground's metrics are of the whole run.
        elif key != "ground":
            cut |= _by_measured(ax, runs, column)

    legend(figure, axes[0], names(runs))
    alt = f"Lines over time of {', '.join(names(runs))}: {', '.join(columns)}."

    return Drawn(key, title, caption + scaled.CUT * cut, alt, figure)


def _by_measured(ax: Axes, runs: Sequence[StoredRun], column: Column) -> bool:
    """Scale an axis by what all runs measured; return whether a line is cut."""
    ends = [scaled.measured_range(run, column(run)) for run in runs]
    ax.set_ylim(min(low for low, _ in ends), max(high for _, high in ends))
    cut = [scaled.mark_cut(ax, run, column(run)) for run in runs]
    return any(cut)


def _by_powers(ax: Axes, peaks: Sequence[float]) -> None:
    """Make an axis logarithmic, down to a hundredth of the smallest peak above 0."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    # Zero has no logarithm: with nothing above it the axis stays linear.
    above = [peak for peak in peaks if peak > 0.0]
    if above:
        ax.set_yscale("log")
        ax.set_ylim(0.01 * min(above), 2.0 * max(above))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())


def _force(run: StoredRun) -> Array:
    """Return the ground's force along z [N], NaN without a ground."""
    return run.record.get("ground_z", np.full(len(run.record["time"]), np.nan))


def _height(run: StoredRun) -> Array:
    """Return the foot's height [mm], NaN without a ground."""
    if "ground_z" not in run.record:
        return np.full(len(run.record["time"]), np.nan)
    return 1e3 * ground.height(run.scenario.leg, run.record)


PLOTS: tuple[tuple[str, str, str, dict[str, Column], bool], ...] = (
    (
        "torque",
        "Motor torques",
        "What the motors at A and E applied.",
        {
            "torque A [mN m]": lambda run: 1e3 * run.record["torque_A"],
            "torque E [mN m]": lambda run: 1e3 * run.record["torque_E"],
        },
        False,
    ),
    (
        "tracking-error",
        "Tracking error",
        "Distance of the foot from its target, the largest value of each interval.",
        {"|foot - target| [mm]": lambda run: 1e3 * tracking_error(run.record)},
        True,
    ),
    (
        "loop-gap",
        "Loop gap",
        "Gap of the loop at C, the largest value of each interval.",
        {"gap at C [um]": lambda run: 1e6 * run.record["gap"]},
        True,
    ),
    (
        "load-share",
        "Load share",
        "A's part of the torque impulse; no line where neither motor has a torque.",
        {"load share of A [%]": lambda run: 100.0 * numbers.share(run)},
        False,
    ),
)

GROUND = (
    "ground",
    "Ground",
    "The ground's force on the foot, and the height of the foot's ball above the floor.",
    {"force along z [N]": _force, "foot height [mm]": _height},
    False,
)


def _verdict(run: StoredRun) -> Cell:
    """Return the verdict of a run; one that nobody judged is neither good nor bad."""
    verdict = run.measured.verdict
    return text(verdict) if verdict == NOT_JUDGED else html.verdict(verdict == "pass")


def _tripped(run: StoredRun) -> Cell:
    """Return the names of the guards that tripped."""
    return text(", ".join(each.name for each in run.measured.guards if not each.ok))


def _metrics(runs: Sequence[StoredRun]) -> str:
    """Return the table of all metrics of all runs."""
    head: list[object] = ["metric"]
    for k, name in enumerate(names(runs)):
        tint = f"var(--run-{k % COLOURS + 1})"
        head.append(Cell(f'<span class="swatch" style="background: {tint}"></span>{text(name)}'))

    rows: list[list[object]] = [
        ["verdict", *(_verdict(run) for run in runs)],
        ["guards that tripped", *(_tripped(run) for run in runs)],
    ]
    limits = [{limit.key: limit for limit in numbers.limits(run)} for run in runs]
    for key, (label, _, _) in SHOWN.items():
        if not any(key in numbers.keys(run) for run in runs):
            continue
        row: list[object] = [label]
        for k, run in enumerate(runs):
            if key not in numbers.keys(run):
                row.append("")
                continue
            cell = str(text(shown(key, look_up(run.metrics, key))))
            # Nothing to compare in the first run, nor where it has no such metric.
            if k and key in numbers.keys(runs[0]):
                cell += f"<small>{text(difference(key, run, runs[0]))}</small>"
            if key in limits[k] and not limits[k][key].ok:
                cell += f"<small>{html.verdict(False, f', limit {bounds(limits[k][key])}')}</small>"
            row.append(Cell(cell))
        rows.append(row)

    what = "Below each value: its difference to the first run."
    return html.table(what, head, rows, stacked=len(runs) <= MOST_STACKED)


def difference(key: str, run: StoredRun, first: StoredRun) -> str:
    """Return the difference of a metric to that of the first run, in words.

    In percent of the first run's value, or as a multiple from tenfold on; percentages differ in
    points. "from 0" if the first value is 0, "-" if one of them is undefined.
    """
    # None is an undefined metric, which equals another undefined one.
    value, base = (look_up(each.metrics, key) for each in (run, first))
    if value is None or base is None or value == base:
        return "same" if value == base else "-"
    if SHOWN[key][2] == "%":
        return f"{100.0 * (value - base):+.3g} points"
    if base == 0.0:
        return "from 0"
    if abs(value) >= 10.0 * abs(base):
        return f"{value / base:.3g} times"
    return f"{100.0 * (value - base) / abs(base):+.3g} %"


def _differences(runs: Sequence[StoredRun]) -> str:
    """Return the table of the scenario keys that are not the same in all runs."""
    flat = [dict(tables.flat(run.scenario.table())) for run in runs]
    keys = dict.fromkeys(key for each in flat for key in each)
    rows = [
        (key, *(plain(each[key]) if key in each else "-" for each in flat))
        for key in keys
        if any(key not in each or each[key] != flat[0].get(key) for each in flat)
    ]
    if not rows:
        return "<p>Nothing: the scenarios are the same.</p>"

    stacked = len(runs) <= MOST_STACKED
    what = "Keys of scenario.toml, in SI units."
    return html.table(what, ("key", *names(runs)), rows, stacked=stacked)
