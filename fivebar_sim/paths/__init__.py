"""Foot paths: position, velocity and acceleration of the foot F over time, in the hip frame.

A path is a frozen table of numbers with a `kind`; `path.at(time)` is what the foot shall do.
"""

from __future__ import annotations

from fivebar_sim.paths.base import FootPath, Sample
from fivebar_sim.paths.csv import Csv
from fivebar_sim.paths.shapes import Circle, Ellipse, FigureEight, Line

__all__ = [
    "KINDS",
    "Circle",
    "Csv",
    "Ellipse",
    "FigureEight",
    "FootPath",
    "Line",
    "PathSpec",
    "Sample",
]

PathSpec = Ellipse | Circle | Line | FigureEight | Csv
KINDS: dict[str, type[FootPath]] = {
    str(kind.__struct_config__.tag): kind for kind in (Circle, Csv, Ellipse, FigureEight, Line)
}
