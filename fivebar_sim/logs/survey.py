"""What is in a file, column by column, in one pass whose memory does not grow with the file."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.logs import clock
from fivebar_sim.logs.cells import Cells, Clock, numbers
from fivebar_sim.logs.raw import Raw

SAMPLED = 100_000
"""Steps of time, of the first rows, that the usual interval is the median of."""


class Content(NamedTuple):
    """What a column holds.

    Attributes:
        kind: "numbers", "moments", "text" or "nothing".
        there: Rows that have a value.
        first: The first number, in the file's unit; NaN without one.
        low, high: The least and the largest number; NaN without one.
        whole: Whether all numbers are whole.
    """

    kind: str
    there: int
    first: float
    low: float
    high: float
    whole: bool


class Timing(NamedTuple):
    """What a column of time says.

    Attributes:
        interval: The usual time between rows [s].
        span: Latest time minus the first [s].
        gaps: Intervals without rows.
        longest: The longest of them [s].
        jumps: Steps back, or far ahead.
        repeated: Rows with the time of the row before.
    """

    interval: float
    span: float
    gaps: int
    longest: float
    jumps: int
    repeated: int


class Survey(NamedTuple):
    """What is in a file.

    Attributes:
        rows: Their number.
        columns: By name, in the file's order.
    """

    rows: int
    columns: dict[str, Content]


def survey(raw: Raw) -> Survey:
    """Return what each column holds."""
    found = {name: Content("nothing", 0, math.nan, math.nan, math.nan, True) for name in raw.names}
    rows = 0
    for block in raw.blocks(raw.names):
        for name, values in block.cells.items():
            cells = Cells(values, name, block.first, raw.decimal, raw.where)
            found[name] = _joined(found[name], _content(cells, found[name].kind))
        rows = block.first - 1 + len(next(iter(block.cells.values())))
    return Survey(rows, found)


def _content(cells: Cells, kind: str) -> Content:
    """Return what a column holds in some rows.

    Args:
        cells: The rows.
        kind: What it holds in the rows before.
    """
    try:
        if kind in ("text", "moments"):
            raise ConfigError(kind)
        values = numbers(cells)
    except ConfigError:
        kind = "text" if kind == "text" else _other_kind(cells)
        there = len(cells.values) - cells.values.null_count
        return Content(kind, there, math.nan, math.nan, math.nan, False)

    there = values[np.isfinite(values)]
    if not len(there):
        return Content("nothing", 0, math.nan, math.nan, math.nan, True)

    whole = bool((there == np.round(there)).all())
    low = float(there.min())
    return Content("numbers", len(there), float(there[0]), low, float(there.max()), whole)


def _other_kind(cells: Cells) -> str:
    """Return what a column without numbers holds."""
    try:
        one = Clock()
        one.seconds(cells, 1.0)
    except ConfigError:
        return "text"
    return one.what if one.what == "moments" else "text"


def _joined(before: Content, after: Content) -> Content:
    """Return what a column holds in rows, and in those after them."""
    if "nothing" in (before.kind, after.kind):
        return after if before.kind == "nothing" else before
    kind = before.kind if before.kind == after.kind else "text"
    return Content(
        kind,
        before.there + after.there,
        before.first,
        min(before.low, after.low),
        max(before.high, after.high),
        before.whole and after.whole,
    )


def timing(raw: Raw, column: str, scale: float) -> Timing | None:
    """Return what a column of time says; None if it never grows.

    Args:
        raw: The file.
        column: The column.
        scale: Seconds per number.
    """
    one = Clock()
    interval = math.nan
    last = math.nan
    end = -math.inf
    counts = np.zeros(3, dtype=int)
    longest = 0.0
    for block in raw.blocks([column]):
        time = one.seconds(
            Cells(block.cells[column], column, block.first, raw.decimal, raw.where), scale
        )

        step = _steps(time, last)
        good = step[step > 0.0]
        if math.isnan(interval) and len(good):
            interval = float(np.median(good[:SAMPLED]))
        if len(step):
            last = float(time[np.isfinite(time)][-1])
            end = max(end, float(np.nanmax(time)))

        jumped = clock.is_jump(step, interval)
        gap = (step > clock.GAP * interval) & ~jumped
        counts += [int(gap.sum()), int(jumped.sum()), int((step == 0.0).sum())]
        longest = max(longest, float(step[gap].max(initial=0.0)))

    # A time that never grows has no interval.
    if math.isnan(interval):
        return None
    gaps, jumps, repeated = counts.tolist()
    return Timing(interval, end, gaps, longest, jumps, repeated)


def _steps(time: Array, last: float) -> Array:
    """Return the steps from each time to the next, the first from the last of the rows before."""
    there = time[np.isfinite(time)]
    if not math.isnan(last):
        there = np.concatenate([[last], there])
    return np.diff(there)
