"""The look of figures: colours for light and dark, SVG for the page, PNG for other uses.

A figure is drawn in the light colours. In the page each of them becomes a CSS variable, which
follows the reader's choice of light or dark; so each light colour may have only one name.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any

from fivebar_sim.render import palette

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER = (palette.PAPER.light, palette.PAPER.dark)
"""The page itself, in light and in dark."""

COLOURS = {
    name: (shades.light, shades.dark)
    for name, shades in {
        **palette.COLOURS,
        **{f"run-{k + 1}": shades for k, shades in enumerate(palette.RUNS)},
    }.items()
}
"""Colours of lines, in light and in dark; each contrasts with the page."""

SOFT = {"grid": ("#dde1e6", "#31373f"), "wash": ("#7d8794", "#8b95a3")}
"""Colours of what lies behind the lines."""

WIDTH = 5.4
"""Width of a figure [in]: small enough that its text stays readable on a phone."""

RC: dict[Any, Any] = {
    # Text stays text: it can be searched, read aloud and copied.
    "svg.fonttype": "none",
    # Matplotlib's ids are random otherwise, and the same run would not give the same bytes.
    "svg.hashsalt": "fivebar",
    # A name with two $ is not a formula.
    "text.parse_math": False,
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
    """Return the light colour with a name; figures are drawn in it."""
    return (COLOURS | SOFT)[name][0]


def variables(dark: bool) -> str:
    """Return the CSS variables of all colours, light or dark."""
    pairs = {"paper": PAPER, **COLOURS, **SOFT}
    return " ".join(f"--{name}: {pair[dark]};" for name, pair in pairs.items())


@contextmanager
def project_style() -> Iterator[None]:
    """Within, figures have the project's look, whatever the user's matplotlibrc says."""
    import matplotlib

    with matplotlib.rc_context(), warnings.catch_warnings():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(RC)
        # The browser has other fonts for the letters that Matplotlib's lacks.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def png(figure: Figure) -> bytes:
    """Return a figure as PNG on white; call it within `project_style`."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=200, facecolor="white")
    return out.getvalue()


def svg(figure: Figure, key: str, alt: str) -> str:
    """Return a figure as an SVG element in CSS colours; call it within `project_style`.

    Args:
        figure: The figure, drawn in the light colours.
        key: Key of the figure; its ids start with it.
        alt: What the figure shows, for readers who cannot see it.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    out = io.StringIO()
    # What savefig does, which draws twice: once only to find the layout.
    for patch in (figure.patch, *(ax.patch for ax in figure.axes)):
        patch.set(facecolor="none", edgecolor="none")
    if layout := figure.get_layout_engine():
        layout.execute(figure)
        figure.set_layout_engine("none")
    # No date and no version of Matplotlib: the same run must give the same bytes.
    FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None})
    text = re.sub(r"<metadata>.*?</metadata>", "", out.getvalue(), flags=re.DOTALL)
    box = re.search(r'viewBox="([^"]*)"', text)
    assert box is not None
    # Without its size in points the element scales with the page.
    inside = text[text.index(">", text.index("<svg")) + 1 :]
    inside = re.sub(r"<!--.*?-->", "", inside, flags=re.DOTALL).replace("xlink:href", "href")
    # Ids must be unique in a page, and every figure of Matplotlib uses the same ones.
    inside = _own_ids(inside, key)
    inside = re.sub(r' d="[^"]*"', lambda found: _rounded(found[0]), inside)
    inside = re.sub(r"#[0-9a-f]{6}\b", lambda found: _VARIABLES.get(found[0], found[0]), inside)
    inside = re.sub(r"\n\s*", "\n", inside)

    return f'<svg role="img" aria-label="{escape(alt)}" viewBox="{box[1]}">{inside.strip()}'


def _own_ids(text: str, key: str) -> str:
    """Return SVG that keeps only the ids in use, each with the figure's key in front."""
    used = set(re.findall(r'(?:url\(#|href="#)([^")]+)', text))

    def rename(found: re.Match[str]) -> str:
        return f' id="{key}-{found[1]}"' if found[1] in used else ""

    text = re.sub(r' id="([^"]*)"', rename, text)
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{key}-", text)


def _rounded(path: str) -> str:
    """Return path data with coordinates rounded to a hundredth of a point."""
    return re.sub(r"-?\d+\.\d{3,}", lambda found: f"{float(found[0]):.2f}", path)


_VARIABLES = {
    pair[0]: f"var(--{name})" for name, pair in {"paper": PAPER, **COLOURS, **SOFT}.items()
}
