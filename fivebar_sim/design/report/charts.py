"""The page's charts as SVG in CSS colours; what belongs to a design says so by `data-k`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.report.axes import Axis

WIDTH = 540.0
HEIGHT = 340.0
LEFT = 64.0
RIGHT = 14.0
TOP = 14.0
BOTTOM = 46.0
"""Sizes of a chart, and what its labels take of it."""

LINE = 14.0
LETTERS = 13
"""Height of a line of an axis' name, and letters in it, in parallel coordinates."""


def scatter(
    x: Axis,
    y: Axis,
    points: Sequence[tuple[int, float, float, str, str]],
    alt: str,
    *,
    line: bool = False,
) -> str:
    """Return a chart of points.

    Args:
        x: The axis to the right.
        y: The axis upwards.
        points: Number of the design, x and y in SI units, CSS class, and words of each.
        alt: What the chart shows, for readers who cannot see it.
        line: Whether to draw the line of equal values.
    """
    parts = [*_frame(x, y)]
    if line:
        low = max(x.low / x.scale, y.low / y.scale)
        high = min(x.high / x.scale, y.high / y.scale)
        (a, b), (c, d) = (_place(x, y, v, v) for v in (low, high))
        parts.append(f'<path class="equal" d="M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}"/>')

    for k, px, py, kind, words in points:
        if np.isfinite(px) and np.isfinite(py):
            cx, cy = _place(x, y, px, py)
            parts.append(
                f'<circle class="dot {kind}" data-k="{k}" cx="{cx:.1f}" cy="{cy:.1f}" r="5">'
                f"<title>{escape(words)}</title></circle>"
            )
    return svg(WIDTH, HEIGHT, alt, parts)


def parallel(axes: Sequence[Axis], rows: Sequence[tuple[int, Array, str]], alt: str) -> str:
    """Return parallel coordinates: a line a design across an axis for each of its numbers.

    Args:
        axes: The axes.
        rows: Number of the design, its values in SI units (axes,), and CSS class.
        alt: What the chart shows.
    """
    step = 96.0
    width = LEFT + step * (len(axes) - 1) + 70.0
    height = 250.0
    names = [axis_lines(axis.label) for axis in axes]
    top = LINE * max(map(len, names)) + 16.0
    parts = []
    # Over the strands, or these hide them.
    ticks = []
    for j, (axis, name) in enumerate(zip(axes, names, strict=True)):
        across = LEFT + step * j
        for k, word in enumerate(reversed(name)):
            up = top - 12.0 - LINE * k
            parts.append(f'<text class="name" x="{across}" y="{up}">{escape(word)}</text>')
        parts.append(f'<path class="axis" d="M{across} {top}V{top + height}"/>')
        for part, text in axis.ticks(4):
            down = top + height * (1.0 - part)
            parts.append(f'<path class="axis" d="M{across - 4} {down:.1f}h4"/>')
            ticks.append(
                f'<text class="tick left" x="{across - 7}" y="{down + 4:.1f}">{escape(text)}</text>'
            )
    for k, values, kind in rows:
        shares = [axis.share(float(v)) for axis, v in zip(axes, values, strict=True)]
        places = [
            f"{LEFT + step * j:.1f} {top + height * (1.0 - share):.1f}"
            for j, share in enumerate(shares)
            if np.isfinite(share)
        ]
        parts.append(f'<path class="strand {kind}" data-k="{k}" d="M{"L".join(places)}"/>')
    return svg(width, top + height + 14.0, alt, [*parts, *ticks], fixed=True)


def axis_lines(label: str) -> list[str]:
    """Return an axis' name in lines that do not meet those of the next axis, then its unit."""
    name, bracket, unit = label.partition(" [")
    lines = [""]
    # Keys of a path's own numbers have dots where words have blanks.
    for word in re.split(r"(?<=[ ._])", name):
        if lines[-1] and len(lines[-1] + word.rstrip()) > LETTERS:
            lines.append("")
        lines[-1] += word
    return [line.rstrip() for line in lines] + [f"[{unit}"] * bool(bracket)


def _place(x: Axis, y: Axis, px: float, py: float) -> tuple[float, float]:
    """Return where a point lies in a chart."""
    across = LEFT + (WIDTH - LEFT - RIGHT) * x.share(px)
    down = TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - y.share(py))
    return across, down


def _frame(x: Axis, y: Axis) -> Iterable[str]:
    """Yield the axes of a chart."""
    right = WIDTH - RIGHT
    low = HEIGHT - BOTTOM
    for part, text in x.ticks():
        across = LEFT + (right - LEFT) * part
        yield f'<path class="grid" d="M{across:.1f} {TOP}V{low}"/>'
        yield f'<text class="tick" x="{across:.1f}" y="{low + 17}">{text}</text>'

    for part, text in y.ticks():
        down = TOP + (low - TOP) * (1.0 - part)
        yield f'<path class="grid" d="M{LEFT} {down:.1f}H{right}"/>'
        yield f'<text class="tick left" x="{LEFT - 7}" y="{down + 4:.1f}">{text}</text>'
    yield f'<path class="axis" d="M{LEFT} {TOP}V{low}H{right}"/>'
    middle = 0.5 * (TOP + low)
    yield f'<text class="name" x="{0.5 * (LEFT + right)}" y="{HEIGHT - 8}">{escape(x.label)}</text>'
    turned = f"translate(14 {middle}) rotate(-90)"
    yield f'<text class="name" transform="{turned}">{escape(y.label)}</text>'


def svg(width: float, height: float, alt: str, parts: Iterable[str], *, fixed: bool = False) -> str:
    """Return an SVG element that scales with the page, or keeps its size."""
    size = f' width="{width:g}" height="{height:g}"' if fixed else ""
    inside = "\n".join(parts)
    return (
        f'<svg role="img" aria-label="{escape(alt)}" viewBox="0 0 {width:g} {height:g}"{size}>\n'
        f"{inside}\n</svg>"
    )
