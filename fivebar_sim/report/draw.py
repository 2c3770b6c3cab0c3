"""Drawing tools for the figures: panels over time, thinned lines, units, shaded bands."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.render.palette import TIME
from fivebar_sim.report.look import WIDTH, colour
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 600
"""Intervals of a line over time; each is drawn by its least and its largest value."""

LENGTHS = ((1e3, "mm"), (1e6, "um"), (1e9, "nm"))
"""Factors from metres, and their units."""


class Drawn(NamedTuple):
    """One figure.

    Attributes:
        key: Id in the page, and name of the picture's file.
        title: Heading.
        caption: What to look for.
        alt: What the figure shows, for readers who cannot see it.
        figure: Matplotlib's figure.
    """

    key: str
    title: str
    caption: str
    alt: str
    figure: Figure


def envelope(values: Array, bins: int = BINS) -> NDArray[np.int64]:
    """Return the rows that draw a line as all rows would, so that no peak is lost.

    They are the rows of the least and the largest value in each of `bins` equal intervals, the
    first and the last row, and both sides of every edge of a gap (NaN).

    Args:
        values: (N,), N at least 1; NaN where the line has a gap.
        bins: Number of intervals; all rows are kept if N is at most twice that.
    """
    rows = len(values)
    if rows <= 2 * bins:
        return np.arange(rows)

    gap = np.isnan(values)
    edge = np.flatnonzero(np.diff(gap))
    # argmin would return the first NaN; an infinity is chosen only if nothing else is there.
    low = np.where(gap, np.inf, values)
    high = np.where(gap, -np.inf, values)
    ends = np.linspace(0, rows, bins + 1).astype(int)
    kept = [0, rows - 1]

    for start, stop in pairwise(ends):
        kept += [start + int(low[start:stop].argmin()), start + int(high[start:stop].argmax())]
    return np.unique(np.concatenate([kept, edge, edge + 1]))


def highest(values: Array, bins: int = BINS) -> NDArray[np.int64]:
    """Return the row of the largest value in each of `bins` equal intervals; all rows if fewer."""
    ends = np.linspace(0, len(values), min(bins, len(values)) + 1).astype(int)
    return np.array([a + int(values[a:b].argmax()) for a, b in pairwise(ends)])


def line(ax: Axes, time: Array, values: Array, name: str, **more: Any) -> None:
    """Draw a line over time in a named colour; NaN is a gap."""
    rows = envelope(values)
    ax.plot(time[rows], values[rows], color=colour(name), **more)


def panels(*shares: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels over one time axis, one below the other.

    Args:
        shares: Relative height of each panel.
        height: Height of the figure [in].
    """
    from matplotlib.figure import Figure

    from fivebar_sim.render.fitted import Fitted

    figure = Figure(figsize=(WIDTH, height), layout=Fitted())
    axes = figure.subplots(
        len(shares), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": shares}
    )[:, 0]
    axes[-1].set_xlabel("time [s]")
    return figure, list(axes)


def plane(height: float) -> tuple[Figure, Axes]:
    """Return a figure of the leg plane in mm.

    Args:
        height: Height of the figure [in].
    """
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    # Equal scales change the ticks after the layout: half a letter of one may come to stand above.
    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(h_pad=0.1))
    ax = figure.add_subplot()
    ax.set(aspect="equal", xlabel="x [mm]", ylabel="z [mm]")
    # Equal scales by wider limits: the panel keeps its size beside another one.
    ax.set_adjustable("datalim")
    return figure, ax


def shade_unmeasured(ax: Axes, run: StoredRun) -> None:
    """Shade the time that tracking and load leave out: before and after the measured window."""
    window = run.scenario.window
    time = run.record["time"]
    # A row is the state at the end of its step, so row k begins at the time of row k - 1.
    before = [0.0, *time.tolist()]
    for start, stop in ((0.0, before[window.start]), (before[window.stop], before[-1])):
        if stop > start:
            ax.axvspan(start, stop, color=colour("wash"), alpha=0.16, lw=0)
    ax.set_xlim(0.0, before[-1])


def shade_stance(ax: Axes, time: Array, stands: Bools) -> None:
    """Shade the time in which the foot stands."""
    # At the resolution of the picture: a foot that chatters would make a band for every step.
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
    """Return the first of `LENGTHS` in which a length [m] is at least 0.1, else the last."""
    return next((each for each in LENGTHS if each[0] * peak >= 0.1), LENGTHS[-1])


def ceiling(values: Array) -> float:
    """Return the upper end of an axis from 0 that shows all values; 1 if they are all 0."""
    # Matplotlib warns of an axis whose ends are equal.
    return 1.08 * float(values.max()) or 1.0


def time_colours(count: int) -> list[str]:
    """Return colours from early to late."""
    from matplotlib.colors import LinearSegmentedColormap, to_hex

    ramp = LinearSegmentedColormap.from_list("time", TIME)
    return [to_hex(ramp(share)) for share in np.linspace(0.0, 1.0, count)]
