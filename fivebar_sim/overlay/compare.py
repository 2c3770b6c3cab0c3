"""A log against a run: both on one clock, and how far apart they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ConfigError
from fivebar_sim.kinematics.commanded import check_commands
from fivebar_sim.logs import Log
from fivebar_sim.logs.clock import check_follows
from fivebar_sim.metrics.columns import Record, motors
from fivebar_sim.overlay import align
from fivebar_sim.overlay.measured import check_leg
from fivebar_sim.overlay.play import played
from fivebar_sim.paths import Angles
from fivebar_sim.paths.spline import Spline
from fivebar_sim.rollout import run
from fivebar_sim.scenario import Scenario

UNITS = {
    **{f"theta_{motor}": "rad" for motor in "AE"},
    **{f"foot_{axis}": "m" for axis in "xz"},
    **{f"torque_{motor}": "N m" for motor in "AE"},
    **{f"current_{motor}": "A" for motor in "AE"},
}
"""What is compared, and in which unit."""

PARTS = ("rms", "bias", "max", "explained")
"""Of each: RMS of log - run, its mean, its largest size, and the part of the log's motion that the
run has too, 1 - var(log - run) / var(log)."""

KEYS = ("delay", *(f"{name}.{part}" for name in UNITS for part in PARTS))
"""What may be limited."""

SETTLED = 0.25
"""Time at the start that is not compared: the run begins at rest [s]."""

MOST_DELAY = 0.05
"""Largest delay that is looked for where the log's commands are played [s]."""


class Channel(NamedTuple):
    """How far log and run are apart in one quantity.

    Attributes:
        log: The log's values, (n,).
        run: The run's at the same moments, the delay taken out, (n,).
        undelayed: The RMS of log - run with the delay left in.
    """

    log: Array
    run: Array
    undelayed: float

    @property
    def difference(self) -> Array:
        """The log less the run, (n,)."""
        return self.log - self.run

    @property
    def parts(self) -> dict[str, float]:
        """The numbers of `PARTS`; what does not move has nothing to explain, NaN."""
        apart = self.difference
        moved = float(np.var(self.log))
        explained = 1.0 - float(np.var(apart)) / moved if moved > 0.0 else math.nan
        values = (_rms(apart), float(np.mean(apart)), float(np.abs(apart).max()), explained)
        return dict(zip(PARTS, values, strict=True))

    @property
    def gain(self) -> float:
        """The factor on the run's motion that fits the log best; NaN where the run stands."""
        own = self.run - self.run.mean()
        size = float(own @ own)
        return float(own @ (self.log - self.log.mean())) / size if size > 0.0 else math.nan

    @property
    def left(self) -> float:
        """The RMS that neither bias nor gain explain."""
        gain = 0.0 if math.isnan(self.gain) else self.gain
        return float(np.std(self.log - gain * self.run))


class Compared(NamedTuple):
    """A log laid over a run.

    Attributes:
        scenario: What was run.
        log: The log.
        is_played: Whether the run was sent the log's commands; else the scenario's own.
        clock: How the log's times belong to the run's.
        time: Of the rows that are compared, on the log's clock [s], (n,).
        channels: By their names, those of `UNITS` that the log has.
        record: The run's record.
    """

    scenario: Scenario
    log: Log
    is_played: bool
    clock: Clock
    time: Array
    channels: dict[str, Channel]
    record: Record

    @property
    def delay(self) -> float:
        """How much later the log is than the run [s]."""
        return self.clock.delay

    @property
    def run_time(self) -> Array:
        """The rows that are compared, on the run's clock [s], (n,)."""
        return self.clock.of_run(self.time)

    @property
    def metrics(self) -> dict[str, float]:
        """All numbers by the keys of `KEYS`."""
        found = {"delay": self.delay}
        for name, channel in self.channels.items():
            found |= {f"{name}.{part}": value for part, value in channel.parts.items()}
        return found

    def judged(self, limits: Mapping[str, tuple[float, float]]) -> list[Judged]:
        """Return each limit with its value; the bound of a bias or a delay is that of its size.

        Raises:
            ConfigError: A limit on what the log does not have.
        """
        rows = []
        for key, (low, high) in limits.items():
            value = self.metrics.get(key)
            if value is None:
                raise ConfigError(f"limits.{key}: {self.log.where} has no {key.partition('.')[0]}")
            size = abs(value) if low == -math.inf and key.endswith(("bias", "delay")) else value
            rows.append(Judged(key, low, high, value, low <= size <= high))
        return rows


class Judged(NamedTuple):
    """A limit with the value of a comparison."""

    key: str
    low: float
    high: float
    value: float
    ok: bool


def compare(scenario: Scenario, log: Log, settled: float = SETTLED) -> Compared:
    """Return a log laid over a run of a scenario.

    If the log has commands they are played through the simulated leg; if not, the scenario's own
    motion is run, and the log may begin anywhere in it.

    Args:
        scenario: Leg, servo, scene; without commands in the log also path and controller.
        log: With theta_A and theta_E.
        settled: Time at the start that is not compared [s].

    Raises:
        ConfigError: The log lacks the angles, or is too short.
        LoopOpenError: The leg cannot have the log's angles.
        DivergedError: The simulation broke down.
    """
    check_leg(scenario)
    if not log.has("theta_A", "theta_E"):
        raise ConfigError(f"{log.where}: theta_A and theta_E are needed to lay a log over a run")
    check_follows(log.interval, log.where)
    is_played = log.has("ctrl_A", "ctrl_E")
    # For its check alone where the commands are not played.
    Angles.of_log(log).of_leg(scenario.leg)
    if is_played:
        check_commands(log.pair("theta"), log.pair("ctrl"), log.where)
    ran = played(scenario, log) if is_played else scenario
    record = run(ran).record
    time, theta = log.complete("theta_A", "theta_E")
    begin = float(time[0])
    # The run's clock begins with the first row that has both angles.
    angles = align.hermite(record["time"], motors(record, "theta"), motors(record, "theta_dot"))
    late = _delay(ran, time - begin, theta, angles, settled, is_played=is_played)
    clock = Clock(begin, late, settled)
    channels = _channels(ran, log, record, angles, clock)
    rows = clock.rows(log.time, record)
    return Compared(ran, log, is_played, clock, log.time[rows], channels, record)


class Clock(NamedTuple):
    """How the times of a log and of a run belong together.

    Attributes:
        begin: The log's time at the run's 0 [s].
        delay: How much later the log is [s].
        settled: Time of the run that is not compared [s].
    """

    begin: float
    delay: float
    settled: float

    def of_run(self, time: Array) -> Array:
        """Return the run's times at the log's [s]."""
        return time - self.begin - self.delay

    def rows(self, time: Array, record: Record) -> Bools:
        """Return which rows of a log are compared."""
        t = self.of_run(time)
        return (t >= self.settled) & (t >= record["time"][0]) & (t <= record["time"][-1])


def _delay(
    scenario: Scenario,
    time: Array,
    theta: Array,
    angles: Spline,
    settled: float,
    *,
    is_played: bool,
) -> float:
    """Return how much later a log is than a run [s]."""
    if is_played:
        kept = time >= settled
        return align.delay(time[kept], theta[kept], angles, MOST_DELAY)
    return align.anywhere(time, theta, angles, scenario.path.period, settled)


def _channels(
    scenario: Scenario, log: Log, record: Record, angles: Spline, clock: Clock
) -> dict[str, Channel]:
    """Return what log and run both have, by name."""
    rows = clock.rows(log.time, record)
    if rows.sum() < 10:
        raise ConfigError(
            f"{log.where}: {int(rows.sum())} rows overlap the run: at least 10 are needed"
        )
    now = clock.of_run(log.time[rows])
    # Rows near the ends have no moment in the run without the delay: its ends stand for them.
    early = np.clip(now + clock.delay, record["time"][0], record["time"][-1])
    logged = log.pair("theta")[rows]
    pairs = {
        "theta_A": (logged[:, 0], *(angles.evaluate(t)[0][:, 0] for t in (now, early))),
        "theta_E": (logged[:, 1], *(angles.evaluate(t)[0][:, 1] for t in (now, early))),
    }
    there = np.isfinite(logged).all(axis=-1)
    feet = np.full_like(logged, np.nan)
    feet[there] = kinematics.forward(scenario.leg, logged[there])
    for k, axis in enumerate("xz"):
        name = f"foot_{axis}"
        pairs[name] = (
            feet[:, k],
            *(np.interp(t, record["time"], record[name]) for t in (now, early)),
        )
    pairs |= _loads(scenario, log, record, rows, (now, early))
    return {name: _channel(*values) for name, values in pairs.items()}


def _loads(
    scenario: Scenario, log: Log, record: Record, rows: Bools, times: tuple[Array, Array]
) -> dict[str, tuple[Array, Array, Array]]:
    """Return torques and currents: log, run, and run with the delay left in."""
    found = {}
    kt = scenario.servo.kt
    for motor in "AE":
        ran = [np.interp(t, record["time"], record[f"torque_{motor}"]) for t in times]
        if log.has(f"torque_{motor}"):
            found[f"torque_{motor}"] = (log.channels[f"torque_{motor}"][rows], *ran)
        if log.has(f"current_{motor}") and kt is not None:
            current = [torque / kt for torque in ran]
            found[f"current_{motor}"] = (log.channels[f"current_{motor}"][rows], *current)
    return found


def _channel(log: Array, ran: Array, early: Array) -> Channel:
    """Return a quantity's rows in which the log has a value."""
    there = np.isfinite(log)
    return Channel(log[there], ran[there], _rms(log[there] - early[there]))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def as_json(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table of numbers as JSON has them: NaN is null."""
    return {key: None if value != value else value for key, value in table.items()}
