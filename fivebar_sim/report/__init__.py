"""A run explained on one HTML page that needs nothing else, or several runs compared on one."""

from fivebar_sim.report.write import place_of, write

__all__ = ["place_of", "write"]
