"""What may happen for a moment but must not last: clipped and chattering torque."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.metrics.columns import motors

WITHIN = 1.0
"""Over this time [s] clipped and chattering steps are added up; of a shorter run, over all."""

FAINT = 0.1
"""Changes of torque by at most this part of a run's largest are too faint to be chatter."""


def clipped(saturated: Bools, time: Array) -> Array:
    """Return in which part of the second before it the worse motor was clipped, (N,)."""
    window = _window(time)
    return _sums(saturated, window).max(axis=1) / window


def chattering(record: Mapping[str, Array], command: int) -> Array:
    """Return in which part of the second before it the worse motor's torque chattered, (N,).

    It does in a step if it goes up and down, by more than `FAINT` of the run's largest torque, with
    two commands one after the other: d = tau_k - tau_k-P of the other sign than P steps before, P
    the steps of a command.
    """
    torque = motors(record, "torque")
    d = np.zeros_like(torque)
    d[command:] = torque[command:] - torque[:-command]
    d[np.abs(d) <= FAINT * np.abs(torque).max()] = 0.0
    chatters = np.zeros(torque.shape, dtype=bool)
    chatters[command:] = d[command:] * d[:-command] < 0.0
    window = _window(record["time"])
    return _sums(chatters, window).max(axis=1) / window


def _window(time: Array) -> int:
    """Return the steps of `WITHIN`, or of a shorter run."""
    return min(max(1, round(WITHIN / float(time[0]))), len(time))


def _sums(values: Bools, window: int) -> Array:
    """Return the sums over the steps of a window that ends with each step, (N, 2)."""
    so_far: Array = np.concatenate([np.zeros((1, 2)), np.cumsum(values, axis=0, dtype=float)])
    begin = np.maximum(np.arange(1, len(values) + 1) - window, 0)
    return so_far[1:] - so_far[begin]
