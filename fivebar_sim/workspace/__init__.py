"""The workspace of the foot: regions, their boundary, their singular curves."""

from fivebar_sim.workspace.region import boundary, distance, nearest, reachable, singular_curves

__all__ = ["boundary", "distance", "nearest", "reachable", "singular_curves"]
