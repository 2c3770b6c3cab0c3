"""Colours of a recording, and how to tell apart several runs in one recording."""

from __future__ import annotations

from typing import NamedTuple

from fivebar_sim.render import palette

Colour = palette.Rgb


def shade(name: str) -> Colour:
    """Return a colour of the palette; Rerun's plots are light or dark, as its user likes them."""
    return palette.on_any_paper(palette.COLOURS[name])


GREY = (96, 96, 102)
LIGHT_GREY = (140, 140, 148)
"""Floor, belt and base, which lie behind all others."""

PIN = (255, 255, 255)
"""Pins and letters, which Rerun writes on a patch of grey or, with its dark theme, on black."""

TINTS: tuple[Colour, ...] = tuple(palette.on_any_paper(shades) for shades in palette.RUNS)
"""The colours of runs that are shown together; the ninth run has the first colour again."""
TINTED = 0.7
"""Fraction of a run's own colour where several runs are shown; the rest is the part's colour."""


class Look(NamedTuple):
    """How one run looks beside others; a run that is shown alone has the default look.

    Attributes:
        root: Prefix of its entities, "" or "run_1/".
        label: Its name, or "".
        tint: Its colour, or None where every part has its own.
    """

    root: str = ""
    label: str = ""
    tint: Colour | None = None

    def colour(self, part: Colour) -> Colour:
        """Return the colour of a part in this run: TINTED tint + (1 - TINTED) part."""
        if self.tint is None:
            return part
        red, green, blue = (
            round(TINTED * own + (1.0 - TINTED) * its)
            for own, its in zip(self.tint, part, strict=True)
        )
        return red, green, blue

    def line(self, name: str) -> str:
        """Return the name of a plot's line in this run."""
        return f"{self.label}: {name}" if self.label else name


def looks(labels: list[str]) -> list[Look]:
    """Return the looks of runs that are shown together, from their names."""
    if len(labels) == 1:
        return [Look()]
    return [Look(f"run_{i + 1}/", label, TINTS[i % len(TINTS)]) for i, label in enumerate(labels)]
