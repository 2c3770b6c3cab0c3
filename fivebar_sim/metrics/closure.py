"""How far the loop was open at C, over the whole run."""

from __future__ import annotations

from collections.abc import Mapping

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.tracking import root_mean_square


def rms(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float:
    """Return the root of the mean squared gap [m]."""
    # The window is for the path: the loop must hold in every step.
    del leg, window
    return root_mean_square(record["gap"])


def largest(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float:
    """Return the largest gap [m]."""
    del leg, window
    return float(record["gap"].max())
