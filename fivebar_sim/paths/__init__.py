"""Foot paths: position, velocity and acceleration of the foot F over time, in the hip frame.

A path is a frozen table of numbers with a `kind`; `path.at(time)` is the foot's target.
"""

from __future__ import annotations

from typing import get_args

from fivebar_sim.errors import ConfigError
from fivebar_sim.files.installed import installed, load
from fivebar_sim.paths.angles import Angles
from fivebar_sim.paths.base import FootPath, Sample
from fivebar_sim.paths.csv import Csv
from fivebar_sim.paths.gait import Gait
from fivebar_sim.paths.heights import Heights
from fivebar_sim.paths.hop import Hop
from fivebar_sim.paths.lines import Lines
from fivebar_sim.paths.shapes import Circle, Ellipse, FigureEight, Line
from fivebar_sim.paths.sine import Sine
from fivebar_sim.paths.step import Step

__all__ = [
    "KINDS",
    "Angles",
    "Circle",
    "Csv",
    "Ellipse",
    "FigureEight",
    "FootPath",
    "Gait",
    "Heights",
    "Hop",
    "Line",
    "Lines",
    "PathSpec",
    "Sample",
    "Sine",
    "Step",
    "kinds",
]

GROUP = "fivebar_sim.paths"
"""The entry points by which other packages bring kinds of paths."""

PathSpec = (
    Angles
    | Circle
    | Csv
    | Ellipse
    | FigureEight
    | Gait
    | Heights
    | Hop
    | Line
    | Lines
    | Sine
    | Step
)
KINDS: dict[str, type[FootPath]] = {
    str(kind.__struct_config__.tag): kind for kind in get_args(PathSpec)
}


def kinds() -> dict[str, type[FootPath]]:
    """Return every kind of path by name: the shipped ones, then those of other packages.

    Raises:
        ConfigError: One of another package has a shipped kind's name, cannot be loaded, or is no
            `FootPath` with its name as tag.
    """
    found = dict(KINDS)
    for name, entry in installed(GROUP, "path").items():
        if name in KINDS:
            raise ConfigError(f"path {name!r} of {entry.value} has the name of a shipped kind")

        kind = load(entry, "path")
        if not (isinstance(kind, type) and issubclass(kind, FootPath)):
            raise ConfigError(f"path {name!r}: {entry.value} must be a FootPath, got {kind!r}")
        if kind.__struct_config__.tag != name:
            raise ConfigError(
                f"path {name!r}: {entry.value} must have its name as tag, got "
                f"{kind.__struct_config__.tag!r}"
            )

        found[name] = kind
    return found
