"""The parts of a page. All text is escaped here, and a page loads nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterable, Sequence
from html import escape, unescape
from importlib.metadata import version

from fivebar_sim.metrics.measured import NOT_JUDGED, Verdict
from fivebar_sim.report import look
from fivebar_sim.report.draw import Drawn
from fivebar_sim.units import LADDERS

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""What the browser may load: nothing."""

STYLE = """
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 76rem; background: var(--paper); color: var(--ink);
  font: 1rem/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: .5rem 0; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2rem 0 .5rem; }
h3 { font-size: 1rem; margin: 0 0 .25rem; }
p { margin: .5rem 0; overflow-wrap: anywhere; }
.verdict { display: inline-block; padding: .1rem .7rem; border: 2px solid; border-radius: .4rem;
  font-weight: 700; }
.pass { color: var(--target); }
.fail { color: var(--foot); font-weight: 700; }
.unjudged { color: var(--muted); }
.figures { display: grid; gap: 1.5rem;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 27rem), 1fr)); }
figure { margin: 0; min-width: 0; break-inside: avoid; }
figure svg { display: block; width: 100%; max-width: 37rem; height: auto; }
figcaption, .note { color: var(--muted); font-size: .9rem; max-width: 37rem; }
.scroll { overflow-x: auto; max-width: 100%; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--muted); font-size: .9rem; padding-bottom: .25rem;
  max-width: calc(100vw - 2rem); }
th, td { padding: .2rem .9rem .2rem 0; border-bottom: 1px solid var(--grid); text-align: left;
  vertical-align: top; }
th { font-weight: 600; overflow-wrap: anywhere; }
tbody th { font-weight: 400; }
.number { text-align: right; white-space: nowrap; }
td code { white-space: normal; font-size: .8em; }
.words { text-align: right; }
.words, thead .number { overflow-wrap: anywhere; white-space: normal; }
details { margin: .75rem 0; }
summary { cursor: pointer; font-weight: 600; }
td small { display: block; color: var(--muted); }
pre, code { font: .85rem/1.45 ui-monospace, monospace; }
pre { overflow-x: auto; padding: .75rem; border: 1px solid var(--grid); border-radius: .4rem; }
.swatch { display: inline-block; width: 1.4em; height: .35em; margin-right: .4em;
  vertical-align: middle; }
footer { margin-top: 2rem; color: var(--muted); font-size: .9rem; }
tbody th { min-width: 6.5rem; }
@media (max-width: 40rem) {
  table { font-size: .8rem; }
  th, td { padding-right: .4rem; }
  pre { white-space: pre-wrap; overflow-wrap: anywhere; }
  .stacked, .stacked caption, .stacked thead, .stacked tbody { display: block; }
  .stacked tr { display: grid; border-bottom: 1px solid var(--grid);
    grid-template-columns: repeat(var(--values), minmax(0, 1fr)); }
  .stacked th, .stacked td { border: 0; text-align: left; white-space: normal;
    overflow-wrap: anywhere; }
  .stacked tr > :first-child { grid-column: 1 / -1; padding-bottom: 0; }
  .stacked tbody th { color: var(--muted); }
}
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  .figures { grid-template-columns: 1fr 1fr; }
  .scroll { overflow: visible; }
  pre { white-space: pre-wrap; overflow-wrap: anywhere; }
}
"""


LONGEST = 16
"""Letters of a value that never goes over two lines, as numbers with a unit do."""


UNITS = {name for ladder in LADDERS for name in ladder} | {"%", "deg", "deg C"}
"""The units that numbers are shown in."""

NUMBER_AND_UNIT = re.compile(
    r"(?<=\d) (?:" + "|".join(map(re.escape, sorted(UNITS, key=len, reverse=True))) + r")(?![\w/])"
)
"""The blank after a number, and its unit; the longest unit first: "mN m" is not "mN"."""


class Cell(str):
    """Escaped HTML; any other text is escaped when it is put into a page."""


def text(value: object) -> Cell:
    """Return text as HTML on one line; HTML stays as it is."""
    return value if isinstance(value, Cell) else Cell(escape(" ".join(str(value).split())))


def page(title: str, parts: Iterable[str], *, style: str = "", script: str = "") -> str:
    """Return a whole page.

    Args:
        title: Title, as plain text.
        parts: HTML of the body, in order.
        style: Further styles.
        script: The page's own script; no other one runs in it.
    """
    policy = POLICY
    end = ""
    if script:
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        policy = f"{policy}; script-src 'sha256-{digest}'"
        end = f"<script>{script}</script>\n"
    # The reader's choice of light or dark only sets these; figures use them too.
    light = look.variables(False)
    dark = look.variables(True)
    head = f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{text(title)}</title>
<style>
:root {{ color-scheme: light dark; {light} }}
@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}
{(STYLE + style).strip()}
</style>
</head>
<body>
"""
    by = f"<footer>Written by fivebar-sim {version('fivebar-sim')}.</footer>"
    foot = f"{by}\n{end}</body>\n</html>\n"

    return head + "\n".join(parts) + "\n" + foot


def section(title: str, *parts: str) -> str:
    """Return a section under a heading."""
    return "\n".join([f"<section>\n<h2>{text(title)}</h2>", *parts, "</section>"])


def folded(said: str, *parts: str, is_open: bool = False) -> str:
    """Return parts that are shown when their line is clicked."""
    how = " open" if is_open else ""
    return "\n".join([f"<details{how}><summary>{text(said)}</summary>", *parts, "</details>"])


def figures(drawn: Sequence[Drawn]) -> str:
    """Return figures, side by side if there is room; call it within `look.project_style`."""
    parts = [
        f'<figure id="{one.key}">\n<h3>{text(one.title)}</h3>\n'
        f"{look.svg(one.figure, one.key, one.alt)}\n"
        f"<figcaption>{text(one.caption)}</figcaption>\n</figure>"
        for one in drawn
    ]
    return "\n".join(['<div class="figures">', *parts, "</div>"])


def table(
    caption: str, head: Sequence[object], rows: Iterable[Sequence[object]], *, stacked: bool = False
) -> str:
    """Return a table; the first cell of a row is its heading, the others are values.

    A table wider than the page scrolls separately, also by keyboard.

    Args:
        caption: What the table shows.
        head: The heading of each column.
        rows: The cells of each row.
        stacked: Whether a narrow page has the heading of a row above its values.
    """
    top = "".join(
        f'<th scope="col"{_class(cell) if k else ""}>{text(cell)}</th>'
        for k, cell in enumerate(head)
    )
    body = "\n".join(
        f'<tr><th scope="row">{text(row[0])}</th>'
        + "".join(f"<td{_class(cell)}>{_units_kept(text(cell))}</td>" for cell in row[1:])
        + "</tr>"
        for row in rows
    )
    how = f' class="stacked" style="--values: {len(head) - 1}"' if stacked else ""
    # tabindex puts the table in the keyboard's order, which it must be in to scroll.
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{text(caption)}">\n'
        f"<table{how}>\n"
        f"<caption>{text(caption)}</caption>\n<thead><tr>{top}</tr></thead>\n"
        f"<tbody>\n{body}\n</tbody>\n</table>\n</div>"
    )


def _class(cell: object) -> str:
    """Return the class of a cell: long text wraps, or its table would be wider than the page."""
    # What is small stands on a line of its own.
    lines = [unescape(re.sub(r"<[^>]*>", "", line)) for line in text(cell).split("<small>")]
    return ' class="number"' if max(map(len, lines)) <= LONGEST else ' class="words"'


def _units_kept(cell: Cell) -> Cell:
    """Return a cell in which no line ends between a number and its unit, or within a unit."""
    return Cell(NUMBER_AND_UNIT.sub(lambda found: found[0].replace(" ", "&nbsp;"), cell))


def key(name: str) -> Cell:
    """Return a dotted key as code that may wrap after its dots and underscores."""
    broken = re.sub(r"([._])", r"\1<wbr>", escape(name))
    return Cell(f"<code>{broken}</code>")


def judgement(verdict: Verdict) -> Cell:
    """Return the verdict of a run: "PASS", "FAIL" or "NOT JUDGED", with its colour."""
    kind = "unjudged" if verdict == NOT_JUDGED else verdict
    return Cell(f'<span class="verdict {kind}">{verdict.upper()}</span>')


def verdict(ok: bool, more: str = "") -> Cell:
    """Return "pass" or "FAIL"."""
    # Both word and colour differ: not everybody sees colours, and paper may have none.
    word, kind = ("pass", "pass") if ok else ("FAIL", "fail")
    return Cell(f'<span class="{kind}">{word}{escape(more)}</span>')


def plain(value: object) -> str:
    """Return a value for people: numbers with five digits, lists with commas."""
    # Before the numbers, since a bool is an int too.
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(plain(item) for item in value) or "none"
    return str(value)
