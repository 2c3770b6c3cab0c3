"""One colour for one thing: in reports, recordings, MuJoCo's pictures and the docs' drawings.

Each has two shades, for light and for dark paper. models/leg.xml has the light shades of A and E
as its materials, since MuJoCo reads them there.
"""

from __future__ import annotations

from typing import NamedTuple


class Shades(NamedTuple):
    """A colour, and what people call it.

    Attributes:
        light: "#rrggbb" on light paper.
        dark: "#rrggbb" on dark paper.
        word: Its name.
    """

    light: str
    dark: str
    word: str


PAPER = Shades("#ffffff", "#15181d", "white")
"""The page itself."""

COLOURS = {
    "ink": Shades("#24292f", "#d7dce2", "black"),
    "muted": Shades("#68717b", "#959eaa", "grey"),
    # Motor A and its chain A-B-C, motor E and its chain E-D-C.
    "A": Shades("#1f6fb5", "#62aef0", "blue"),
    "B": Shades("#4b93d6", "#a9d0f7", "light blue"),
    "E": Shades("#d2620f", "#f0924c", "orange"),
    "D": Shades("#cf7a1e", "#f7c9a0", "light orange"),
    # Where the foot should be, where it is, and what the ground does to it.
    "target": Shades("#2a7f4f", "#5cc48a", "green"),
    "foot": Shades("#c4314b", "#ff7b8b", "red"),
    "force": Shades("#7b3fb8", "#c79bf2", "violet"),
    "singular": Shades("#0b7d86", "#45c4ce", "teal"),
}
"""The colours of the parts of a leg and of what happens to it."""

RUNS = (
    Shades("#0f6cbd", "#63b3ff", "blue"),
    Shades("#c4510c", "#f59a57", "orange"),
    Shades("#1b7f5a", "#4fcf9d", "green"),
    Shades("#a8328f", "#ee8fd8", "pink"),
    Shades("#7a6a00", "#d6c23f", "yellow"),
    Shades("#5b4bc4", "#a99cff", "violet"),
    Shades("#b02a37", "#ff8088", "red"),
    Shades("#4a5560", "#aab4be", "grey"),
)
"""The colours of runs that are shown together; each contrasts with light and with dark paper."""

TIME = ("#0f8a8a", "#6f78c4", "#a765c4", "#d0588e")
"""From early to late, none of them a motor's; all contrast with light and with dark paper."""

Rgb = tuple[int, int, int]

VISIBLE = 3.0
"""Least contrast of a line with its paper, as WCAG 2 asks for."""


def rgb(colour: str) -> Rgb:
    """Return red, green and blue of "#rrggbb", 0 to 255."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue


def unit_rgb(colour: str) -> tuple[float, float, float]:
    """Return red, green and blue of "#rrggbb", 0 to 1."""
    red, green, blue = rgb(colour)
    return red / 255.0, green / 255.0, blue / 255.0


def luminance(colour: Rgb) -> float:
    """Return the relative luminance of a colour, 0 to 1, as WCAG 2 defines it."""
    shares = [part / 255.0 for part in colour]
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: Rgb, other: Rgb) -> float:
    """Return the contrast of two colours, 1 to 21."""
    dark, light = sorted([luminance(one), luminance(other)])
    return (light + 0.05) / (dark + 0.05)


def on_any_paper(shades: Shades) -> Rgb:
    """Return the shade that is seen on light and on dark paper: Rerun's plots may have either.

    It is the light one, mixed with as little of the dark one as makes it `VISIBLE` on dark paper.
    """
    light = rgb(shades.light)
    dark = rgb(shades.dark)
    paper = rgb(PAPER.dark)
    for percent in range(100):
        red, green, blue = (
            round(a + 0.01 * percent * (z - a)) for a, z in zip(light, dark, strict=True)
        )
        if contrast((red, green, blue), paper) >= VISIBLE:
            return red, green, blue
    return dark
