"""How much later a log is than a run: the shift at which both are most alike."""

from __future__ import annotations

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.paths.spline import Spline

ROWS = 4000
"""Rows of the log that the first search looks at."""

STILL = 1e-6
"""Motion of the angles below which nothing can be aligned [rad]."""

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


def delay(time: Array, theta: Array, run: Spline, most: float) -> float:
    """Return the delay d at which theta(t) and the run's angles at t - d correlate best [s].

    Gain and offset of either do not count. The best of a grid is refined by a golden section.

    Args:
        time: Of the log's rows [s], (n,).
        theta: The log's angles, (n, 2).
        run: The run's angles over time.
        most: Largest delay, of either sign [s].

    Raises:
        ConfigError: The angles hardly move, or the log and the run hardly overlap.
    """
    begin = float(run.knots[0])
    end = float(run.knots[-1])
    # The same rows for all delays, or each would be measured by another yardstick.
    inside = (time - most >= begin) & (time + most <= end)
    if inside.sum() < 10:
        raise ConfigError(
            f"the log and the run overlap in {int(inside.sum())} rows, at most {most:g} s of delay "
            "left out at both ends: at least 10 are needed"
        )
    if not (np.std(theta, axis=0) > STILL).any():
        raise ConfigError("the log's angles hardly move: there is nothing to align in time")
    t = time[inside]
    own = theta[inside] - theta[inside].mean(axis=0)

    few = slice(None, None, max(1, len(t) // ROWS))
    step = 0.5 * float(np.median(np.diff(run.knots)))
    step = max(step, most / 60.0)
    grid = np.arange(-most, most + 0.5 * step, step)
    alike = [_alike(t[few], own[few], run, d) for d in grid]
    best = float(grid[int(np.argmax(alike))])
    return _refined(t, own, run, max(best - step, -most), min(best + step, most))


def anywhere(time: Array, theta: Array, run: Spline, period: float | None, settled: float) -> float:
    """Return the delay of a log that begins anywhere in a run, or anywhere in its period [s].

    Below 0 the log begins later than the run.

    Args:
        time: Of the log's rows [s], (n,).
        theta: The log's angles, (n, 2).
        run: The run's angles over time.
        period: After which the run repeats [s]; None if it does not.
        settled: Time of the run that is left out [s].

    Raises:
        ConfigError: What `delay` raises.
    """
    end = float(run.knots[-1])
    if period is not None:
        # Half a period of either sign about the middle of what the run has in periods.
        whole = time[time <= end - settled - 1.5 * period]
        theta = theta[: len(whole)]
        middle = settled + 0.75 * period
        return delay(whole + middle, theta, run, 0.5 * period) - middle
    spare = end - settled - float(time[-1])
    if spare <= 0.0:
        raise ConfigError(
            f"the log lasts {time[-1]:g} s: the run must last more than that and {settled:g} s, "
            f"got {end:g} s: give the scenario a longer duration"
        )
    middle = settled + 0.5 * spare
    return delay(time + middle, theta, run, 0.5 * spare) - middle


def hermite(time: Array, point: Array, slope: Array) -> Spline:
    """Return the cubic pieces with given points and slopes at their ends.

    Args:
        time: Growing [s], (n,).
        point: (n, d).
        slope: (n, d).
    """
    length = np.diff(time)[:, np.newaxis]
    mean = np.diff(point, axis=0) / length
    start = slope[:-1]
    bend = (start + slope[1:] - 2.0 * mean) / length
    square = (mean - start) / length - bend
    return Spline(time, np.stack([point[:-1], start, square, bend / length]))


def _alike(time: Array, own: Array, run: Spline, late: float) -> float:
    """Return the correlation of a log and a run at a delay, both motors together."""
    other = run.evaluate(time - late)[0]
    other = other - other.mean(axis=0)
    size = np.sqrt((own**2).sum() * (other**2).sum())
    return float((own * other).sum() / size) if size > 0.0 else 0.0


def _refined(time: Array, own: Array, run: Spline, low: float, high: float) -> float:
    """Return the delay between two at which log and run are most alike, by a golden section."""
    # 25 times 0.618: to a hundred-thousandth of the interval.
    for _ in range(25):
        width = GOLDEN * (high - low)
        if _alike(time, own, run, high - width) > _alike(time, own, run, low + width):
            high = low + width
        else:
            low = high - width
    return 0.5 * (low + high)
