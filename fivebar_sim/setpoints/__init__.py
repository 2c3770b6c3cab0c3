"""A scenario's path as a table of setpoints for a controller: angles, counts, microseconds."""

from fivebar_sim.setpoints.commands import UNITS, Commands, commands
from fivebar_sim.setpoints.rows import Rows, rows
from fivebar_sim.setpoints.text import csv, header, write

__all__ = ["UNITS", "Commands", "Rows", "commands", "csv", "header", "rows", "write"]
