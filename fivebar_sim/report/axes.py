"""Axes over time that are scaled by what is measured; what sticks out of them is marked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.report.look import PAPER, colour
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOM = 0.08
"""Free part of an axis beyond what is measured."""

CUT = " Triangle at the edge: what was not measured goes on there, to the number beside it."
"""What a caption says of a picture with a mark of `mark_cut`."""


def measured_range(run: StoredRun, *lines: Array) -> tuple[float, float]:
    """Return the least and the largest value in the measured window, with room; -1, 1 if all are 0.

    Args:
        run: The run.
        lines: What is drawn, each (N,); NaN is a gap.
    """
    values = np.concatenate([line[run.scenario.window] for line in lines])
    values = values[np.isfinite(values)]
    if not values.any():
        return -1.0, 1.0

    low = float(values.min())
    high = float(values.max())
    # A constant has no span of its own.
    room = ROOM * ((high - low) or abs(high))
    return low - room, high + room


def mark_cut(ax: Axes, run: StoredRun, *lines: Array) -> bool:
    """Mark the largest and the least value if they are beyond the axis; return whether one is.

    Args:
        ax: Axes whose limits are set.
        run: The run.
        lines: What is drawn, each (N,); NaN is a gap.
    """
    time = run.record["time"]
    every = np.stack(lines)
    marked = False

    for edge, side in zip(ax.get_ylim(), (-1.0, 1.0), strict=True):
        # Turned over for the lower edge, so that beyond is above for both.
        out = np.where(np.isnan(every), -np.inf, side * every)
        row = int(out.max(axis=0).argmax())
        peak = float(out[:, row].max())
        if peak > side * edge:
            _mark(ax, float(time[row]), edge, side, side * peak)
            marked = True
    return marked


def _mark(ax: Axes, time: float, edge: float, side: float, peak: float) -> None:
    """Draw a triangle on an edge of the axes that points outwards, and the value it stands for."""
    pointer = "^" if side > 0.0 else "v"
    ax.plot([time], [edge], pointer, color=colour("ink"), ms=6, clip_on=False, gid="cut")
    # Towards the middle of the picture, or the number would leave it.
    left = time < 0.5 * ax.get_xlim()[1]
    digits = f"{peak:.3g}" if abs(peak) < 1e3 else f"{peak:.0f}"
    ax.annotate(
        digits,
        (time, edge),
        (6 if left else -6, -3 * side),
        textcoords="offset points",
        ha="left" if left else "right",
        va="top" if side > 0.0 else "bottom",
        fontsize=9,
        # The line that leaves the picture is behind the number.
        bbox={"facecolor": PAPER[0], "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
        zorder=5,
    )
