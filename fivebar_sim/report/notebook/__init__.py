"""What a notebook shows of a leg, a scenario, a run, and a run held against its baseline."""

from fivebar_sim.report.notebook.legs import leg, scenario
from fivebar_sim.report.notebook.show import PLOTS, fragment, plot, table

__all__ = ["PLOTS", "fragment", "leg", "plot", "scenario", "table"]
