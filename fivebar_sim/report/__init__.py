"""One self-contained HTML page that explains a run, or compares several."""

from fivebar_sim.report.write import place_of, write

__all__ = ["place_of", "write"]
