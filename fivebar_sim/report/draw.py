"""What the figures are drawn with: panels over time, lines of few points, units, bands."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.report.look import TIME, WIDTH, colour
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 600
"""Parts of a line over time, each drawn by its least and its largest value."""

LENGTHS = ((1e3, "mm"), (1e6, "um"), (1e9, "nm"))
"""Factors from metres, and their units."""


class Drawn(NamedTuple):
    """One figure.

    Attributes:
        key: Its id in the page, and the name of its picture.
        title: Its heading.
        caption: What to see in it.
        alt: What it shows, for who cannot see it.
        figure: Itself.
    """

    key: str
    title: str
    caption: str
    alt: str
    figure: Figure


def envelope(values: Array, bins: int = BINS) -> NDArray[np.int64]:
    """Return rows that draw a line as all rows would: nothing that sticks out is lost.

    Of each of `bins` equal parts these are the rows of the least and of the largest value; further
    the first and the last row, and both sides of every edge of a gap (NaN).

    Args:
        values: (N,), N at least 1; NaN where the line has a gap.
        bins: How many parts; all rows are kept where N is at most twice that.
    """
    rows = len(values)
    if rows <= 2 * bins:
        return np.arange(rows)

    gap = np.isnan(values)
    edge = np.flatnonzero(np.diff(gap))
    low = np.where(gap, np.inf, values)
    high = np.where(gap, -np.inf, values)
    ends = np.linspace(0, rows, bins + 1).astype(int)
    kept = [0, rows - 1]

    for start, stop in pairwise(ends):
        kept += [start + int(low[start:stop].argmin()), start + int(high[start:stop].argmax())]
    return np.unique(np.concatenate([kept, edge, edge + 1]))


def highest(values: Array, bins: int = BINS) -> NDArray[np.int64]:
    """Return the row of the largest value of each of `bins` equal parts; all rows if fewer."""
    ends = np.linspace(0, len(values), min(bins, len(values)) + 1).astype(int)
    return np.array([a + int(values[a:b].argmax()) for a, b in pairwise(ends)])


def line(ax: Axes, time: Array, values: Array, name: str, **more: Any) -> None:
    """Draw a line over time in a colour of the look; NaN is a gap."""
    rows = envelope(values)
    ax.plot(time[rows], values[rows], color=colour(name), **more)


def panels(*shares: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels over one time axis, one below the other.

    Args:
        shares: Of the height, one for each panel.
        height: [in].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    axes = figure.subplots(
        len(shares), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": shares}
    )[:, 0]
    axes[-1].set_xlabel("time [s]")
    return figure, list(axes)


def plane(height: float) -> tuple[Figure, Axes]:
    """Return a figure of the leg plane in mm.

    Args:
        height: [in].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    ax = figure.add_subplot()
    ax.set(aspect="equal", xlabel="x [mm]", ylabel="z [mm]")
    ax.set_adjustable("datalim")
    return figure, ax


def shade_unmeasured(ax: Axes, run: StoredRun) -> None:
    """Shade what tracking and load are not measured over: the ramp, and what follows the window."""
    window = run.scenario.window
    time = run.record["time"]
    before = [0.0, *time.tolist()]  # a row is the state at the end of its step
    for start, stop in ((0.0, before[window.start]), (before[window.stop], before[-1])):
        if stop > start:
            ax.axvspan(start, stop, color=colour("wash"), alpha=0.16, lw=0)
    ax.set_xlim(0.0, before[-1])


def shade_stance(ax: Axes, time: Array, stands: Bools) -> None:
    """Shade when the foot stands, at the resolution of the picture."""
    ends = np.linspace(0, len(time), min(BINS, len(time)) + 1).astype(int)
    down = np.logical_or.reduceat(stands, ends[:-1])
    flips = np.flatnonzero(np.diff(np.concatenate([[False], down, [False]])))
    edges = np.concatenate([[0.0], time])[ends[flips]].reshape(-1, 2)
    spans = [(start, stop - start) for start, stop in edges.tolist()]
    ax.broken_barh(
        spans,
        (0.0, 1.0),
        transform=ax.get_xaxis_transform(),
        facecolors=colour("wash"),
        alpha=0.22,
        lw=0,
    )


def length_unit(peak: float) -> tuple[float, str]:
    """Return factor and unit in which a length [m] has at least a tenth before its decimals."""
    return next((each for each in LENGTHS if each[0] * peak >= 0.1), LENGTHS[-1])


def ceiling(values: Array) -> float:
    """Return the upper end of an axis from 0 that shows all values; 1 if they are all 0."""
    return 1.08 * float(values.max()) or 1.0


def time_colours(count: int) -> list[str]:
    """Return colours of early to late."""
    from matplotlib.colors import LinearSegmentedColormap, to_hex

    ramp = LinearSegmentedColormap.from_list("time", TIME)
    return [to_hex(ramp(share)) for share in np.linspace(0.0, 1.0, count)]
