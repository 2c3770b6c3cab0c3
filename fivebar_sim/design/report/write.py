"""Writes the page of a design study into its directory."""

from __future__ import annotations

from pathlib import Path

from fivebar_sim.design.report.page import page
from fivebar_sim.design.report.study import Study
from fivebar_sim.files import whole_file

REPORT = "report.html"


def write(study: Study, folder: Path) -> Path:
    """Write the page; return its file."""
    place = folder / REPORT
    whole_file.write(place, page(study))
    return place
