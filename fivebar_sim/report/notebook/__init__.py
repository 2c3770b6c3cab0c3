"""A run in a notebook."""

from fivebar_sim.report.notebook.show import PLOTS, fragment, plot

__all__ = ["PLOTS", "fragment", "plot"]
