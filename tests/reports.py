"""A report's page read back: its elements, attributes and text, without a browser."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import pytest

from fivebar_sim.report import in_plane, look, over_time
from fivebar_sim.report.draw import Drawn
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VOID = {"meta", "br", "link", "img", "input", "hr", "wbr"}


class Element(NamedTuple):
    """One element."""

    tag: str
    attributes: dict[str, str]
    text: list[str]


class Page(HTMLParser):
    """All elements of a page in order, each with the text within it; everything is closed."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.elements: list[Element] = []
        self.open: list[Element] = []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Open an element."""
        element = Element(tag, {key: value or "" for key, value in attrs}, [])
        self.elements.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep an element that has nothing inside, as SVG has."""
        self.elements.append(Element(tag, {key: value or "" for key, value in attrs}, []))

    def handle_endtag(self, tag: str) -> None:
        """Close the last element, which must be this one."""
        assert self.open.pop().tag == tag

    def handle_data(self, data: str) -> None:
        """Give text to all that are open."""
        for element in self.open:
            element.text.append(data)

    def all(self, tag: str) -> list[Element]:
        """Return the elements of a tag."""
        return [element for element in self.elements if element.tag == tag]

    def ids(self, tag: str) -> list[str]:
        """Return the ids of the elements of a tag."""
        return [element.attributes.get("id", "") for element in self.all(tag)]

    def rows(self) -> list[list[str]]:
        """Return the cells of all rows of all tables."""
        rows: list[list[str]] = []
        for element in self.elements:
            if element.tag == "tr":
                rows.append([])
            elif element.tag in ("td", "th"):
                rows[-1].append(" ".join("".join(element.text).split()))
        return rows


def two_figures(run: StoredRun) -> list[Drawn]:
    """Return the figures of one in the plane and one over time, without drawing the others."""
    drawn = [in_plane.foot_path(run), over_time.tracking_error(run)]
    return [one for one in drawn if one is not None]


@contextmanager
def unfitted() -> Iterator[None]:
    """Draw figures without fitting their axes to their words, which takes half of the time."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    from fivebar_sim.render.fitted import Fitted

    with pytest.MonkeyPatch.context() as patch:
        for engine in (ConstrainedLayoutEngine, Fitted):
            patch.setattr(engine, "execute", lambda engine, figure: None)
        yield


@contextmanager
def drawn_once(but: Sequence[str]) -> Iterator[None]:
    """Turn the figures of a key into SVG once: other runs' have other numbers, no other elements.

    Args:
        but: Keys of those that are drawn for every run.
    """
    svg = look.svg
    drawn: dict[str, str] = {}

    def once(figure: Figure, key: str, alt: str) -> str:
        if key not in drawn or key in but:
            drawn[key] = svg(figure, key, alt)
        return drawn[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(look, "svg", once)
        yield


@contextmanager
def unrecorded() -> Iterator[None]:
    """Write no more of a Rerun recording than its first bytes: a report does not read it."""
    with pytest.MonkeyPatch.context() as patch:
        write = "fivebar_sim.recording.rrd.write"
        patch.setattr(write, lambda path, *run: path.write_bytes(b"RRF2"))
        yield
