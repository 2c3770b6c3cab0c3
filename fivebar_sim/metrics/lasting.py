"""What may happen for a moment but must not last, and torque that must last longer than a step."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

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
    # An RMS, as a single spike must not make all else look faint.
    steps = np.minimum(np.arange(1, len(torque) + 1), window)
    squares = _sums(torque**2, window)
    mean = (squares[:, 0] + squares[:, 1]) / 2.0 / steps
    loud = FAINT * np.sqrt(np.maximum(mean, 0.0))
    # Whole commands apart: within a command a torque may ring without any chatter.
    d = np.zeros_like(torque)
    d[command:] = torque[command:] - torque[:-command]
    d = np.where(np.abs(d) <= loud[:, None], 0.0, d)
    chatters = np.zeros(torque.shape, dtype=bool)
    chatters[command:] = d[command:] * d[:-command] < 0.0
    return largest_of_rows(_sums(chatters, window)) / window


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
    so_far: Array = np.concatenate([np.zeros((1, 2)), np.cumsum(values, axis=0, dtype=float)])
    begin = np.maximum(np.arange(1, len(values) + 1) - window, 0)
    return so_far[1:] - so_far[begin]
