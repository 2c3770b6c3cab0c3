"""How figures look: colours for light and dark, SVG that belongs into a page, PNG for elsewhere.

A figure is drawn in the light colours. In the page each of them becomes a CSS variable, which the
reader's choice of light or dark sets; so no light colour may stand for two things.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER = ("#ffffff", "#15181d")
"""The page itself, in light and in dark."""

COLOURS = {
    "ink": ("#24292f", "#d7dce2"),
    "muted": ("#68717b", "#959eaa"),
    "A": ("#c2540a", "#f0924c"),
    "E": ("#1f6fb5", "#62aef0"),
    "error": ("#c4314b", "#ff7b8b"),
    "gap": ("#2a7f4f", "#5cc48a"),
    "singular": ("#a33bb5", "#d88ae6"),
    "run-1": ("#0f6cbd", "#63b3ff"),
    "run-2": ("#c4510c", "#f59a57"),
    "run-3": ("#1b7f5a", "#4fcf9d"),
    "run-4": ("#a8328f", "#ee8fd8"),
    "run-5": ("#7a6a00", "#d6c23f"),
    "run-6": ("#5b4bc4", "#a99cff"),
    "run-7": ("#b02a37", "#ff8088"),
    "run-8": ("#4a5560", "#aab4be"),
}
"""What a line may be, in light and in dark; each stands out from the page."""

SOFT = {"grid": ("#dde1e6", "#31373f"), "wash": ("#7d8794", "#8b95a3")}
"""What lies behind the lines."""

TIME = ("#2f7fd0", "#9a66c4", "#c8589a", "#d0702a")
"""Early to late, through colours that stand out from light and dark paper alike."""

WIDTH = 5.4
"""Of a figure [in]: its letters keep their size on a phone."""

RC: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "fivebar",
    "text.parse_math": False,  # a name with two $ is a name
    "font.size": 10.0,
    "axes.titlesize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.2,
    "grid.color": SOFT["grid"][0],
    **dict.fromkeys(
        ("text.color", "axes.edgecolor", "axes.labelcolor", "axes.titlecolor"), COLOURS["ink"][0]
    ),
    **dict.fromkeys(("xtick.color", "ytick.color"), COLOURS["ink"][0]),
}


def colour(name: str) -> str:
    """Return the light colour of a name, in which figures are drawn."""
    return (COLOURS | SOFT)[name][0]


def variables(dark: bool) -> str:
    """Return the CSS variables of all colours."""
    pairs = {"paper": PAPER, **COLOURS, **SOFT}
    return " ".join(f"--{name}: {pair[dark]};" for name, pair in pairs.items())


@contextmanager
def styled() -> Iterator[None]:
    """Draw and save figures in the project's look within, whatever the user's matplotlibrc says."""
    import matplotlib

    with matplotlib.rc_context(), warnings.catch_warnings():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(RC)
        # a name may have letters that the font lacks: the browser has others
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def png(figure: Figure) -> bytes:
    """Return a figure as PNG on white; within `styled`."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=200, facecolor="white")
    return out.getvalue()


def svg(figure: Figure, key: str, alt: str) -> str:
    """Return a figure as an element of a page, in CSS colours; within `styled`.

    Args:
        figure: Drawn in the light colours.
        key: Of the figure in its page: its ids start with it.
        alt: What the figure shows, for who cannot see it.
    """
    out = io.StringIO()
    figure.savefig(out, format="svg", transparent=True, metadata={"Date": None})
    text = re.sub(r"<metadata>.*?</metadata>", "", out.getvalue(), flags=re.DOTALL)
    box = re.search(r'viewBox="([^"]*)"', text)
    assert box is not None
    inside = text[text.index(">", text.index("<svg")) + 1 :]
    inside = re.sub(r"<!--.*?-->", "", inside, flags=re.DOTALL).replace("xlink:href", "href")
    inside = _own_ids(inside, key)
    inside = re.sub(r' d="[^"]*"', lambda found: _rounded(found[0]), inside)
    inside = re.sub(r"#[0-9a-f]{6}\b", lambda found: _VARIABLES.get(found[0], found[0]), inside)
    inside = re.sub(r"\n\s*", "\n", inside)

    return f'<svg role="img" aria-label="{escape(alt)}" viewBox="{box[1]}">{inside.strip()}'


def _own_ids(text: str, key: str) -> str:
    """Return SVG with the ids that something refers to, told apart by the figure's key."""
    used = set(re.findall(r'(?:url\(#|href="#)([^")]+)', text))

    def renamed(found: re.Match[str]) -> str:
        return f' id="{key}-{found[1]}"' if found[1] in used else ""

    text = re.sub(r' id="([^"]*)"', renamed, text)
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{key}-", text)


def _rounded(path: str) -> str:
    """Return path data with coordinates to a hundredth of a point."""
    return re.sub(r"-?\d+\.\d{3,}", lambda found: f"{float(found[0]):.2f}", path)


_VARIABLES = {pair[0]: f"var(--{name})" for name, pair in (COLOURS | SOFT).items()}
