"""Sweeps: many runs of one scenario, over all values of some of its keys, in one table."""

from __future__ import annotations

from fivebar_sim.sweep.run import sweep

__all__ = ["sweep"]
