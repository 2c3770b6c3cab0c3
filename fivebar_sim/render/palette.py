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


def rgb(colour: str) -> Rgb:
    """Return red, green and blue of "#rrggbb", 0 to 255."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue


def unit_rgb(colour: str) -> tuple[float, float, float]:
    """Return red, green and blue of "#rrggbb", 0 to 1."""
    red, green, blue = rgb(colour)
    return red / 255.0, green / 255.0, blue / 255.0
