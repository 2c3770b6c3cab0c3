"""A picture of a metric of a sweep, over one or two of the keys that were varied."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, UnknownError, unknown
from fivebar_sim.files import parquet_file, whole_file
from fivebar_sim.metrics.catalogue import SHOWN
from fivebar_sim.render.palette import RUNS, TIME
from fivebar_sim.report.look import colour, project_style
from fivebar_sim.sweep.points import Points
from fivebar_sim.sweep.store import WHAT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMATS = ("png", "svg")

MOST_LINES = len(RUNS)
"""Most values of a key that get a line of their own."""


class Over(NamedTuple):
    """A varied key, as an axis of a picture.

    Attributes:
        key: The key.
        place: Where each run lies on it, (runs,): the value, or the number of a name.
        names: The names of values that are no numbers; empty for numbers.
    """

    key: str
    place: Array
    names: list[str]


class Shown(NamedTuple):
    """What a picture shows.

    Attributes:
        over: One or two keys.
        value: The metric of each run in the unit that people read, (runs,); NaN for none.
        label: The metric with its unit.
        rest: The keys that are varied besides.
    """

    over: list[Over]
    value: Array
    label: str
    rest: list[str]


def check(points: Points, metrics: Sequence[str], over: Sequence[str]) -> None:
    """Raise unless these metrics can be drawn over these keys.

    Raises:
        ConfigError: An unknown metric, a key that is not varied, or more than two.
    """
    for metric in metrics:
        if metric not in SHOWN:
            raise UnknownError(f"--plot: {unknown('metric', metric, SHOWN)}")
    for key in over:
        if key not in points.keys:
            raise UnknownError(f"--over: {unknown('key', key, points.keys)}: it is not varied")
    if len(over) > 2 or len(set(over)) < len(over):
        raise ConfigError(f"--over takes one key or two, got {', '.join(over)}")


def draw(
    runs: Path, points: Points, metric: str, out: Path, over: Sequence[str] = ()
) -> list[Path]:
    """Draw a metric over one or two keys, as PNG and SVG; return the files.

    Args:
        runs: The table of the sweep.
        points: Its points.
        metric: Key of the metric.
        out: Folder of the pictures.
        over: The keys; by default the first of each of the first two axes.

    Raises:
        ConfigError: No run has the metric, or the files cannot be written.
    """
    keys = list(over) or [axis.keys[0] for axis in points.axes[:2]]
    shown = _read(runs, points, metric, keys)
    if np.isnan(shown.value).all():
        raise ConfigError(f"--plot {metric}: none of the {len(shown.value)} runs has it")
    from matplotlib.figure import Figure

    files = [out / f"{metric}.{kind}" for kind in FORMATS]
    with project_style():
        figure = Figure(figsize=(6.4, 4.4), layout="constrained")
        ax = figure.add_subplot()
        _draw(ax, shown)
        for file in files:
            # No date: the same sweep gives the same picture.
            metadata = {"Date": None} if file.suffix == ".svg" else None
            with whole_file.stage(file) as place:
                figure.savefig(place, facecolor="white", dpi=160, metadata=metadata)
    return files


def _read(runs: Path, points: Points, metric: str, keys: Sequence[str]) -> Shown:
    """Return what a picture shows."""
    with parquet_file.opened(runs, WHAT, ConfigError) as parquet:
        table = parquet.read(columns=[*keys, metric])
    name, scale, unit = SHOWN[metric]
    values = table.column(metric).to_numpy().astype(np.float64)
    with_same = [axis for axis in points.axes if not set(axis.keys) & set(keys)]
    return Shown(
        over=[_over(key, table.column(key).to_pylist()) for key in keys],
        value=scale * values,
        label=f"{name} [{unit}]" if unit else name,
        rest=[axis.name for axis in with_same],
    )


def _over(key: str, values: list[Any]) -> Over:
    if not any(isinstance(value, (str, bool)) for value in values):
        return Over(key, np.array(values, dtype=np.float64), [])
    # In the order in which they were given.
    names = list(dict.fromkeys(map(str, values)))
    return Over(key, np.array([names.index(str(value)) for value in values], dtype=float), names)


def _draw(ax: Axes, shown: Shown) -> None:
    """Draw what is shown."""
    first = shown.over[0]
    if len(shown.over) == 1:
        _line(ax, first, shown.value, "A", "")
    elif shown.over[1].names and len(shown.over[1].names) <= MOST_LINES:
        _lines(ax, first, shown.over[1], shown.value)
    elif first.names and len(first.names) <= MOST_LINES and not shown.over[1].names:
        first = shown.over[1]
        _lines(ax, first, shown.over[0], shown.value)
    else:
        _map(ax, shown)

    _label(ax.xaxis, first)
    if not ax.get_ylabel():
        ax.set_ylabel(shown.label)
    _title(ax, shown)


def _title(ax: Axes, shown: Shown) -> None:
    """Say what the picture leaves out."""
    gone = int(np.isnan(shown.value).sum())
    told = [f"median over {', '.join(shown.rest)}"] if shown.rest else []
    told += [f"{gone} of {len(shown.value)} runs have no value"] if gone else []
    if told:
        ax.set_title("; ".join(told), loc="left", color=colour("muted"), fontsize=9)


def _label(axis: Any, over: Over) -> None:
    axis.set_label_text(over.key)
    if over.names:
        axis.set_ticks(range(len(over.names)), over.names)


def _lines(ax: Axes, along: Over, by: Over, value: Array) -> None:
    """Draw a line for each name of a key."""
    for k, name in enumerate(by.names):
        rows = by.place == k
        _line(ax, along._replace(place=along.place[rows]), value[rows], f"run-{k + 1}", name)
    ax.legend(title=by.key)


def _line(ax: Axes, along: Over, value: Array, name: str, label: str) -> None:
    """Draw every run as a point, and their medians as a line; a gap where there is none."""
    style = {"color": colour(name), "label": label or None}
    places = np.unique(along.place)
    # Every value of a sample is another one: a line through them would be noise.
    if along.names or (len(places) > len(value) // 2 > 20 and _is_sample(along)):
        ax.plot(along.place, value, "o", ms=4, **style)
        return
    ax.plot(places, _medians(along.place[None], [places], value), "o-", ms=3.5, **style)
    if len(value) > len(places):
        ax.plot(along.place, value, "o", ms=2.5, alpha=0.35, color=colour(name))


def _is_sample(along: Over) -> bool:
    """Return whether the values are no even grid."""
    steps = np.diff(np.unique(along.place))
    return bool(len(steps) > 1 and steps.max() > 1.5 * steps.min())


def _map(ax: Axes, shown: Shown) -> None:
    """Draw two keys as a map: cells of a grid, or the points of a sample."""
    from matplotlib.colors import LinearSegmentedColormap

    x, y = shown.over
    ramp = LinearSegmentedColormap.from_list("time", TIME)
    columns = np.unique(x.place)
    rows = np.unique(y.place)
    if len(columns) * len(rows) <= len(shown.value):
        places = np.stack([y.place, x.place])
        cells = _medians(places, [rows, columns], shown.value)
        ax.set_facecolor(colour("grid"))
        ax.grid(visible=False)
        drawn = ax.pcolormesh(columns, rows, cells, cmap=ramp, shading="nearest")
    else:
        gone = np.isnan(shown.value)
        ax.plot(x.place[gone], y.place[gone], "x", ms=4, color=colour("wash"))
        drawn = ax.scatter(x.place, y.place, c=shown.value, cmap=ramp, s=22)
    ax.figure.colorbar(drawn, ax=ax, label=shown.label)
    _label(ax.yaxis, y)


def _medians(places: Array, grid: Sequence[Array], value: Array) -> NDArray[np.float64]:
    """Return the median of the runs at each point of a grid; NaN where there are none.

    Args:
        places: Where the runs lie on each of its axes, (axes, runs).
        grid: The values of each axis.
        value: Of each run, (runs,).
    """
    shape = tuple(len(values) for values in grid)
    index = [np.searchsorted(values, place) for values, place in zip(grid, places, strict=True)]
    there = ~np.isnan(value)
    cell = np.asarray(np.ravel_multi_index(index, shape))[there]
    found = np.full(shape, np.nan)
    order = np.lexsort((value[there], cell))
    cells, first, counts = np.unique(cell[order], return_index=True, return_counts=True)
    ordered = value[there][order]
    # Of an even number the mean of the middle two, as usual.
    low = ordered[first + (counts - 1) // 2]
    high = ordered[first + counts // 2]
    found.flat[cells] = 0.5 * (low + high)
    return found
