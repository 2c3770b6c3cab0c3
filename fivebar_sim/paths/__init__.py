"""Foot paths: position, velocity and acceleration of the foot F over time, in the hip frame.

A path is a frozen table of numbers with a `kind`; `path.at(time)` is the foot's target.
"""

from __future__ import annotations

from typing import get_args

from fivebar_sim.paths.base import FootPath, Sample
from fivebar_sim.paths.csv import Csv
from fivebar_sim.paths.gait import Gait
from fivebar_sim.paths.hop import Hop
from fivebar_sim.paths.lines import Lines
from fivebar_sim.paths.shapes import Circle, Ellipse, FigureEight, Line
from fivebar_sim.paths.step import Step

__all__ = [
    "KINDS",
    "Circle",
    "Csv",
    "Ellipse",
    "FigureEight",
    "FootPath",
    "Gait",
    "Hop",
    "Line",
    "Lines",
    "PathSpec",
    "Sample",
    "Step",
]

PathSpec = Circle | Csv | Ellipse | FigureEight | Gait | Hop | Line | Lines | Step
KINDS: dict[str, type[FootPath]] = {
    str(kind.__struct_config__.tag): kind for kind in get_args(PathSpec)
}
