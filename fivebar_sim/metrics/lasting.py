"""What may happen for a moment but must not last, and torque that must last longer than a step."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools, largest_of_rows
from fivebar_sim.metrics.columns import motors

WITHIN = 1.0
"""Clipped and chattering steps are counted over this time [s], or over a shorter run."""

FAINT = 0.3
"""Changes of torque up to this part of the last second's RMS are too faint to be chatter."""


def clipped(saturated: Bools, time: Array) -> Array:
    """Return, for each step, the part of the last second in which the worse motor was clipped.

    Args:
        saturated: Whether the torque limit clipped A and E in each step, (N, 2).
        time: Time of each step [s], (N,).

    Returns:
        Parts in [0, 1], (N,).
    """
    # Of a run that is shorter than a second, the part of the whole run.
    window = _window(time)
    if not saturated.any():
        return np.zeros(len(time))
    return largest_of_rows(_sums(saturated, window)) / window


def chattering(record: Mapping[str, Array], command: int) -> Array:
    """Return, for each step, the part of the last second in which the worse motor chattered, (N,).

    A step chatters if the torque goes up with one command and down with the next, by more than
    `FAINT` of both motors' RMS in the last second: d = tau_k - tau_k-P has the other sign P steps
    before, with P the steps of a command.

    Args:
        record: The columns of rollout.parquet.
        command: P.
    """
    torque = motors(record, "torque")
    window = _window(record["time"])
    d = np.zeros_like(torque)
    # Whole commands apart: within a command a torque may ring without any chatter.
    d[command:] = torque[command:] - torque[:-command]
    after, motor = np.nonzero(d[command:] * d[:-command] < 0.0)
    if not len(after):
        return np.zeros(len(torque))

    # Few steps turn round, and how loud it is there is all that matters.
    so_far = _so_far(torque**2)
    now = after + command
    loud = np.ones(len(now), dtype=bool)
    for rows in (after, now):
        loud &= np.abs(d[rows, motor]) > _faint(so_far, rows, window)
    chatters = np.zeros(torque.shape, dtype=bool)
    chatters[now[loud], motor[loud]] = True
    if not loud.any():
        return np.zeros(len(torque))
    return largest_of_rows(_sums(chatters, window)) / window


def _faint(so_far: Array, rows: NDArray[np.intp], window: int) -> Array:
    """Return `FAINT` of both motors' RMS in the last second, of some steps.

    Args:
        so_far: The running sums of tau^2, see `_so_far`.
        rows: The steps.
        window: Steps of the last second.
    """
    # An RMS, as a single spike must not make all else look faint.
    squares = so_far[rows + 1] - so_far[np.maximum(rows + 1 - window, 0)]
    mean = (squares[:, 0] + squares[:, 1]) / 2.0 / np.minimum(rows + 1, window)
    return FAINT * np.sqrt(np.maximum(mean, 0.0))


def lone(values: Array, before: Array) -> Array:
    """Return how far each value stands out from both its neighbours on the same side, (N, 2).

    A torque that lasts a single step: no timestep that is any longer than it gets it right.

        min(|x_k - x_k-1|, |x_k - x_k+1|)   where both differences have the same sign, else 0

    Args:
        values: x of A and E at every step, (N, 2).
        before: x before the first step, (2,).
    """
    d = np.empty(values.shape)
    # One row after the other in memory: columns beside each other would take twice as long.
    rows = np.ascontiguousarray(values)
    np.subtract(rows[0], before, out=d[0])
    np.subtract(rows[1:], rows[:-1], out=d[1:])
    # Few, so only they are looked at. Of the last step nobody knows what follows.
    turned = np.flatnonzero(d[:-1] * d[1:] < 0.0)
    size = np.abs(d).ravel()
    found = np.zeros(d.size)
    found[turned] = np.minimum(size[turned], size[turned + 2])
    return found.reshape(d.shape)


def _window(time: Array) -> int:
    """Return the steps of `WITHIN`, or of a shorter run."""
    return min(max(1, round(WITHIN / float(time[0]))), len(time))


def _sums(values: Bools | Array, window: int) -> Array:
    """Return the sums over the steps of a window that ends with each step, (N, 2)."""
    # Differences of running sums: the cost does not depend on the window's width.
    so_far = _so_far(values)
    found = so_far[1:].copy()
    found[window:] -= so_far[1:-window]
    return found


def _so_far(values: Bools | Array) -> Array:
    """Return the sums of the first k rows, k = 0..N, (N + 1, 2)."""
    so_far = np.zeros((len(values) + 1, 2))
    np.cumsum(values, axis=0, dtype=float, out=so_far[1:])
    return so_far
