"""How far the foot was from its path and when it left it, and how far the loop was open at C."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar

ASTRAY = 0.1
"""Part of a path's extent above which an RMS error means that the foot does not follow it."""


def tracking_error(record: Mapping[str, Array]) -> Array:
    """Return the distance of the foot from its target [m], (N,)."""
    return np.hypot(record["foot_x"] - record["target_x"], record["foot_z"] - record["target_z"])


def lost_path(leg: FiveBar, record: Mapping[str, Array]) -> float | None:
    """Return when the foot was first farther from its target than the leg's size [s], or None."""
    lost = tracking_error(record) > leg.size
    return float(record["time"][np.argmax(lost)]) if lost.any() else None


def left_path(leg: FiveBar, record: Mapping[str, Array], by: float) -> float:
    """Return when the foot left its path [s]: the last time that it was near its target.

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        by: When it was lost, or the simulation broke down [s].
    """
    # Near is a tenth of the leg's size.
    near = (tracking_error(record) <= 0.1 * leg.size) & (record["time"] <= by)
    return float(record["time"][np.flatnonzero(near)[-1]]) if near.any() else 0.0


def astray(leg: FiveBar, record: Mapping[str, Array], window: slice) -> str | None:
    """Return a warning that the foot hardly follows its path, or None.

    It does if its RMS error over the window is above a tenth of the path's extent there, the longer
    side of the box around the targets. A path that stays in one place has no extent.

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        window: The rows that tracking is measured over.
    """
    extent = max(float(np.ptp(record[f"target_{axis}"][window])) for axis in "xz")
    error = rms(leg, record, window)
    # Targets in one place may still differ by rounding.
    if extent <= 1e-9 * leg.size or error <= ASTRAY * extent:
        return None
    return (
        f"the foot does not follow its path: its RMS error of {1e3 * error:.4g} mm is more than "
        f"a tenth of the path's {1e3 * extent:.4g} mm"
    )


def rms(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float:
    """Return sqrt(mean e^2) of the tracking error e over the window [m]."""
    del leg
    return root_mean_square(tracking_error(record)[window])


def largest(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float:
    """Return the largest tracking error of the window [m]."""
    del leg
    return float(tracking_error(record)[window].max())


def gap_rms(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float:
    """Return the root of the mean squared gap at C [m]."""
    del leg
    return root_mean_square(record["gap"][window])


def gap_max(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float:
    """Return the largest gap at C [m]."""
    del leg
    return float(record["gap"][window].max())


def root_mean_square(values: Array) -> float:
    """Return sqrt(mean values^2)."""
    return float(np.sqrt(np.mean(values**2)))
