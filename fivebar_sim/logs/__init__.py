"""Logs of real legs: read as they are into SI units, surveyed, written. NumPy and Arrow only."""

from fivebar_sim.logs.column_map import ColumnMap, read_map
from fivebar_sim.logs.log import Log, load, read

__all__ = ["ColumnMap", "Log", "load", "read", "read_map"]
