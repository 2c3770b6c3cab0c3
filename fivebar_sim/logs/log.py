"""A log in SI units: `read(file, columns)`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.logs import channels, clock, column_map
from fivebar_sim.logs.cells import Cells, Clock, numbers
from fivebar_sim.logs.channels import Channels
from fivebar_sim.logs.clock import Gap
from fivebar_sim.logs.column_map import ColumnMap, Scaled
from fivebar_sim.logs.opening import open_file
from fivebar_sim.logs.raw import Block, Raw, Source

MOST = 5_000_000
"""Rows that are kept; `start` and `end` choose those of a longer file."""


class Log(NamedTuple):
    """What a file holds, in SI units.

    Attributes:
        where: The file's name.
        time: Strictly growing from 0 [s], (n,).
        channels: By the names of `channels.LEG`, each (n,); NaN where a sample is missing.
        interval: The usual time between two rows, the median [s].
        gaps: Intervals without rows, longest first.
        remarks: What is odd, and what was mended.
    """

    where: str
    time: Array
    channels: dict[str, Array]
    interval: float
    gaps: tuple[Gap, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Last time minus first [s]."""
        return float(self.time[-1])

    def samples(self, name: str) -> tuple[Array, Array]:
        """Return the times [s] and the values of a channel, without the missing ones."""
        values = self.channels[name]
        there = np.isfinite(values)
        return self.time[there], values[there]

    def complete(self, *names: str) -> tuple[Array, Array]:
        """Return the times [s] of the rows in which all of some channels are there, and these.

        Raises:
            ConfigError: Fewer than two such rows.
        """
        values = np.stack([self.channels[name] for name in names], axis=-1)
        there = np.isfinite(values).all(axis=-1)
        if there.sum() < 2:
            raise ConfigError(
                f"{self.where}: at least 2 rows must have all of {', '.join(names)}, got "
                f"{int(there.sum())}"
            )
        return self.time[there], values[there]

    def pair(self, name: str) -> Array:
        """Return a channel of A and of E side by side, "theta" or "ctrl", (n, 2)."""
        return np.stack([self.channels[f"{name}_{motor}"] for motor in "AE"], axis=-1)

    def has(self, *names: str) -> bool:
        """Return whether all of some channels are there."""
        return all(name in self.channels for name in names)


def load(file: Path, known: Channels = channels.LEG) -> Log:
    """Return a log: of a TOML file with a table [log], or of a data file with the channels' names.

    Raises:
        ConfigError: What `read` raises; or a file whose columns have other names.
    """
    if file.suffix.lower() == ".toml":
        told = column_map.load(file, known)
        assert told.file is not None
        return read(told.file, told, known)
    raw = open_file(file)
    names = {name.rpartition(".")[2]: name for name in raw.names}
    found = {name: Scaled(names[name], 1.0) for name in known if name in names}
    # What an MCAP file calls the time of a message.
    if "time" not in found and "log_time" in names:
        found["time"] = Scaled(names["log_time"], 1e-9)
    if "time" not in found or len(found) < 2:
        raise ConfigError(
            f"{file}: its columns ({', '.join(raw.names[:8])}) have names of their own: `fivebar "
            f"log {file} --map log.toml` writes a table that says which is what; give that instead"
        )
    return _read(raw, ColumnMap(found, str(file)))


def read(
    source: Source,
    told: ColumnMap,
    known: Channels = channels.LEG,
    need: Iterable[str] = (),
    where: str = "",
) -> Log:
    """Return a log in SI units.

    Args:
        source: The file, or all of its bytes.
        told: Which column is what: `column_map.read_map(table, where)` of a table [log].
        known: The channels that there may be.
        need: Channels that must be there.
        where: The file's name, for messages; "" for its path.

    Raises:
        ConfigError: The file cannot be read, a column is not there, a cell is no number, or the
            clock jumps; names the column and says what would help.
    """
    for name in need:
        if name not in told.channels:
            raise ConfigError(f"{told.where}: {name} is missing; channels: {', '.join(known)}")
    return _read(open_file(source, where), told)


def _read(raw: Raw, told: ColumnMap) -> Log:
    """Return the log of a file that is open."""
    names = [name for name in told.channels if name != "time"]
    _check_columns(raw, told)
    if not names:
        raise ConfigError(f"{told.where}: no channel but time: name at least one column")
    if "time" not in told.channels and told.rate is None:
        raise ConfigError(
            f"{told.where}: time is missing: name its column, or rate = 200.0 [Hz] if the file has "
            "none"
        )

    time, values = _gathered(raw, told, names)
    moving = told.channels.get("time")
    if moving is not None and moving.wrap is not None:
        time = _unwrapped(time, moving.wrap * abs(moving.scale))
    for k, name in enumerate(names):
        if (wrap := told.channels[name].wrap) is not None:
            values[:, k] = _unwrapped(values[:, k], wrap * abs(told.channels[name].scale))

    ordered = clock.order(time, values, told.jumps, raw.where)
    kept = _within(ordered.time, told, raw.where)
    start = ordered.time[kept][0]
    found = {name: ordered.values[kept, k] for k, name in enumerate(names)}
    for name, column in found.items():
        if not np.isfinite(column).any():
            raise ConfigError(
                f"{raw.where}: column {told.channels[name].column!r} ({name}) holds no number"
            )
    gaps = clock.gaps_of(ordered.time[kept] - start, ordered.interval)
    remarks = (*raw.remarks, *ordered.remarks)
    return Log(raw.where, ordered.time[kept] - start, found, ordered.interval, gaps, remarks)


def _check_columns(raw: Raw, told: ColumnMap) -> None:
    """Raise unless a file has all columns that a table names."""
    for name, scaled in told.channels.items():
        for each in (scaled, scaled.plus):
            if each is not None and each.column not in raw.names:
                listed = unknown("column", each.column, raw.names)
                raise ConfigError(f"{told.where}: {name}: {raw.where}: {listed}")


def _gathered(raw: Raw, told: ColumnMap, names: list[str]) -> tuple[Array, Array]:
    """Return the times since the first row [s] (n,), and the channels (n, k)."""
    ticks = Ticks(raw, told)
    times: list[Array] = []
    values: list[Array] = []
    rows = 0
    for block in raw.blocks(wanted(told)):
        time = ticks.of(block)
        columns = [scaled_numbers(raw, block, told.channels[name]) for name in names]
        kept = np.ones(len(time), dtype=bool)
        if told.end is not None and told.jumps == "refuse" and not ticks.wraps:
            # Only the rows that count, so that a cut of a long file fits in memory.
            kept = ~((time < told.start) | (time > told.end))
        times.append(time[kept])
        values.append(np.stack(columns, axis=-1)[kept])
        rows += int(kept.sum())
        if rows > MOST:
            raise ConfigError(
                f"{raw.where}: has more than {MOST} rows: choose some with start and end [s]"
            )
    if not rows:
        raise ConfigError(f"{raw.where}: no rows" + (" between start and end" if times else ""))
    return np.concatenate(times), np.concatenate(values)


def wanted(told: ColumnMap) -> list[str]:
    """Return the columns that a table needs, each once."""
    every = [each for scaled in told.channels.values() for each in (scaled, scaled.plus)]
    return list(dict.fromkeys(each.column for each in every if each is not None))


class Ticks:
    """The time of block after block."""

    def __init__(self, raw: Raw, told: ColumnMap) -> None:
        self._raw = raw
        self._time = told.channels.get("time")
        self._rate = told.rate
        self._clocks = (Clock(), Clock())

    @property
    def wraps(self) -> bool:
        """Whether the clock begins again now and then."""
        return self._time is not None and self._time.wrap is not None

    def of(self, block: Block) -> Array:
        """Return the seconds since the first row, (n,)."""
        if self._time is None:
            assert self._rate is not None
            count = len(next(iter(block.cells.values())))
            return (np.arange(count) + (block.first - 1)) / self._rate
        found = self._seconds(block, self._time, self._clocks[0])
        if self._time.plus is not None:
            found = found + self._seconds(block, self._time.plus, self._clocks[1])
        return found

    def _seconds(self, block: Block, scaled: Scaled, one: Clock) -> Array:
        return one.seconds(_cells(self._raw, block, scaled.column), scaled.scale)


def _cells(raw: Raw, block: Block, name: str) -> Cells:
    return Cells(block.cells[name], name, block.first, raw.decimal, raw.where)


def scaled_numbers(raw: Raw, block: Block, scaled: Scaled) -> Array:
    """Return a channel in some rows, in its SI unit, (n,)."""
    found = scaled.scale * numbers(_cells(raw, block, scaled.column))
    if scaled.plus is not None:
        found = found + scaled_numbers(raw, block, scaled.plus)
    return found + scaled.offset


def _unwrapped(values: Array, period: float) -> Array:
    """Return values without the steps back of a counter that begins again; NaN stays."""
    found = values.copy()
    there = np.isfinite(values)
    found[there] = np.unwrap(values[there], period=period)
    return found


def _within(time: Array, told: ColumnMap, where: str) -> Bools:
    """Return which rows are between start and end."""
    end = np.inf if told.end is None else told.end
    kept = (time >= told.start) & (time <= end)
    if kept.sum() < 2:
        raise ConfigError(
            f"{where}: start = {told.start:g} s and end = {end:g} s leave {int(kept.sum())} rows: "
            f"the log has those from {time[0]:.6g} to {time[-1]:.6g} s"
        )
    return kept
