"""The time of a log put in order: repeated times merged, jumps of the clock named, gaps listed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim import units
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ConfigError

GAP = 2.5
"""Usual intervals from which on an interval is a gap."""

JUMP = 1000.0
"""Usual intervals, and `LONG` seconds, from which on an interval is a jump of the clock."""

LONG = 60.0


SLOWEST = 0.2
"""Longest usual interval of a log that is laid over a run [s]: a leg does more within one."""


class Gap(NamedTuple):
    """An interval without rows.

    Attributes:
        start: Time of the last row before it [s].
        length: [s].
    """

    start: float
    length: float


class Ordered(NamedTuple):
    """Rows in the order of time.

    Attributes:
        time: Strictly growing, since the file's first row [s], (n,).
        values: A row each, (n, k).
        interval: The usual one, the median [s].
        gaps: Longest first.
        remarks: What was mended.
    """

    time: Array
    values: Array
    interval: float
    gaps: tuple[Gap, ...]
    remarks: tuple[str, ...]


def order(time: Array, values: Array, jumps: str, where: str) -> Ordered:
    """Return rows with a time that grows.

    Args:
        time: As the file has it, NaN where it is missing [s], (n,).
        values: (n, k).
        jumps: "refuse", "join" or "longest"; see `column_map.ColumnMap`.
        where: The file, for messages.

    Raises:
        ConfigError: The clock jumps and `jumps` is "refuse", or fewer than two times are left.
    """
    remarks: list[str] = []
    there = np.isfinite(time)
    if not there.all():
        remarks.append(f"{int((~there).sum())} rows without a time are left out")
        time = time[there]
        values = values[there]

    time, values = _merged(time, values, remarks)
    if len(time) < 2:
        raise ConfigError(f"{where}: a log needs at least 2 different times, got {len(time)}")
    step = np.diff(time)
    interval = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 0.0
    if not interval > 0.0:
        raise ConfigError(f"{where}: the time never grows: is it the right column?")

    cuts = np.flatnonzero(is_jump(step, interval)) + 1
    if len(cuts):
        time, values = _mended(time, values, cuts, interval, jumps, where, remarks)
    gaps = gaps_of(time, interval)
    return Ordered(time, values, interval, gaps, tuple(remarks))


def check_follows(interval: float, where: str) -> None:
    """Raise unless rows come often enough to tell how a leg moved.

    Args:
        interval: The usual time between two rows [s].
        where: The log, for messages.

    Raises:
        ConfigError: They do not; guesses in which unit the times are.
    """
    if interval <= SLOWEST:
        return

    guess = ""
    for unit, scale in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if scale * interval <= SLOWEST:
            said = f"{units.text(scale * interval, 's', 3)} if the times are in {unit}"
            guess = f"; a guess: it is {said}: time with unit = '{unit}'"
            break
    raise ConfigError(
        f"{where}: rows are {interval:.4g} s apart, too far to tell how a leg moved, which takes "
        f"{SLOWEST:g} s or less{guess}"
    )


def is_jump(step: Array, interval: float) -> Bools:
    """Return which steps of time are jumps of the clock: back, or far ahead."""
    return (step < 0.0) | (step > max(JUMP * interval, LONG))


def gaps_of(time: Array, interval: float) -> tuple[Gap, ...]:
    """Return the gaps in a growing time, longest first."""
    step = np.diff(time)
    places = np.flatnonzero(step > GAP * interval)
    places = places[np.argsort(-step[places], kind="stable")]
    return tuple(Gap(float(time[k]), float(step[k])) for k in places)


def _merged(time: Array, values: Array, remarks: list[str]) -> tuple[Array, Array]:
    """Return rows of one time as one: of each channel the first value that is there."""
    again = np.flatnonzero(np.diff(time) == 0.0) + 1
    if not len(again):
        return time, values
    values = values.copy()
    # Backwards, so that what is missing in a row comes from the next of the same time.
    for k in again[::-1]:
        lost = np.isnan(values[k - 1])
        values[k - 1, lost] = values[k, lost]
    kept = np.ones(len(time), dtype=bool)
    kept[again] = False
    remarks.append(f"{len(again)} rows repeat the time before them and are merged with it")
    return time[kept], values[kept]


def _mended(
    time: Array,
    values: Array,
    cuts: NDArray[np.int64],
    interval: float,
    jumps: str,
    where: str,
    remarks: list[str],
) -> tuple[Array, Array]:
    """Return rows without jumps of the clock."""
    k = int(cuts[0])
    step = float(time[k] - time[k - 1])
    way = "back" if step < 0.0 else "ahead"
    said = (
        f"the clock jumps {len(cuts)} time{'s' * (len(cuts) > 1)}, first {way} by "
        f"{units.text(abs(step), 's', 5)} after {units.text(float(time[k - 1] - time[0]), 's', 5)}"
    )
    if jumps == "refuse":
        raise ConfigError(
            f"{where}: {said}: jumps = 'join' puts the parts together, 'longest' keeps the longest"
            f"{_counter(-step)}"
        )
    remarks.append(f"{said}: {'joined' if jumps == 'join' else 'the longest part is kept'}")
    if jumps == "join":
        step_of = np.diff(time)
        step_of[cuts - 1] = interval
        return time[0] + np.concatenate([[0.0], np.cumsum(step_of)]), values

    edges = [0, *cuts.tolist(), len(time)]
    part = max(range(len(edges) - 1), key=lambda i: edges[i + 1] - edges[i])
    rows = slice(edges[part], edges[part + 1])
    return time[rows], values[rows]


COUNTERS = {2.0**32 * 1e-6: "32 bits of microseconds", 2.0**16 * 1e-3: "16 bits of milliseconds"}
"""How far counters go back when they begin again [s]."""


def _counter(back: float) -> str:
    """Return a guess where a clock goes back as far as a counter that begins again."""
    for length, said in COUNTERS.items():
        if abs(back - length) < 0.05 * length:
            bits = said.split()[0]
            return f"; or a counter of {said} begins again: wrap = {2 ** int(bits)} in time"
    return ""
