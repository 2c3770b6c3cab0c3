"""The program `fivebar`."""

from fivebar_sim.cli.program import main

__all__ = ["main"]
