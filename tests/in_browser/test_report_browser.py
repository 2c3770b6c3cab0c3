"""A report in a browser: it loads nothing else, draws everything, and fits its window."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import pytest
from reports import unrecorded

from fivebar_sim import report, rollout
from fivebar_sim.scenario import Scenario

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

WIDTHS = (390, 1280)
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")

FIGURES = """() => [...document.querySelectorAll('figure')].map(figure => {
    const box = figure.querySelector('svg').getBoundingClientRect();
    const all = tag => [...figure.querySelectorAll('svg ' + tag)];
    const lines = all('path').filter(path => path.getTotalLength() > 50);
    const letters = all('text').map(text => text.getBoundingClientRect());
    return {
        width: box.width, height: box.height, lines: lines.length, letters: letters.length,
        outside: letters.filter(b => b.left < box.left - 3 || b.right > box.right + 3
            || b.top < box.top - 3 || b.bottom > box.bottom + 3).length,
        smallest: Math.min(...letters.filter(b => b.width >= b.height).map(b => b.height)),
    };
})"""

TOO_WIDE = """() => {
    document.querySelectorAll('details').forEach(folded => { folded.open = true; });
    return [...document.querySelectorAll('table')]
        .filter(table => table.scrollWidth > table.parentElement.clientWidth)
        .map(table => [table.caption.textContent, table.scrollWidth]);
}"""

SQUEEZED = """() => [...document.querySelectorAll('caption')]
    .filter(caption => caption.getBoundingClientRect().width < 100)
    .map(caption => caption.textContent)"""

SEEN = """selector => {
    const style = getComputedStyle(document.querySelector(selector));
    return [style.color, style.stroke, style.backgroundColor];
}"""


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the pages of one run, of two and of five, one name of which is too long for a line."""
    folder = tmp_path_factory.mktemp("runs")
    runs = [folder / "trot", folder / ("a" * 60 + " " + "b" * 90)]
    for place, name in zip(runs, ("treadmill-trot", "classic-ellipse"), strict=True):
        with unrecorded():
            rollout.run(Scenario.load(name, ["duration=0.8"])).write(place)
    more = [Path(shutil.copytree(runs[0], folder / name)) for name in ("trot-2", "trot-3", "hop")]
    return {
        "one": report.write(runs[:1])[-1],
        "two": report.write(runs, folder / "two.html")[-1],
        "five": report.write([*runs, *more], folder / "five.html")[-1],
    }


def opened(browser: Browser, path: Path) -> tuple[Page, list[str]]:
    """Return a page in light colours, and a list that gathers what it says or asks for."""
    page = browser.new_page(viewport={"width": WIDTHS[0], "height": 800}, color_scheme="light")
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("requestfailed", lambda request: said.append(request.url))
    page.on("request", lambda request: said.append(request.url))
    page.goto(path.as_uri(), wait_until="networkidle")
    return page, said


@pytest.mark.parametrize("which", ["one", "two", "five"])
def test_page_is_alone_drawn_and_fits(
    browser: Browser, reports: dict[str, Path], which: str
) -> None:
    page, said = opened(browser, reports[which])
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(TOO_WIDE) == []
        assert page.evaluate(SQUEEZED) == []
        figures = page.evaluate(FIGURES)
        assert len(figures) == (12 if which == "one" else 6)
        for figure in figures:
            assert 300.0 < figure["width"] <= width
            assert figure["height"] > 120.0
            assert figure["lines"] >= 2
            assert figure["letters"] >= 6
            assert figure["outside"] == 0
            assert figure["smallest"] >= 8.0
    assert said == [reports[which].as_uri()]
    page.close()


def test_dark_and_light_and_print(browser: Browser, reports: dict[str, Path]) -> None:
    """Paper, letters and a line differ between light and dark; paper is printed white."""
    selectors = ("body", "#torque text", "#tracking-error path[style*='--foot']")
    looks = {}
    page, _ = opened(browser, reports["one"])
    for scheme in SCHEMES:
        page.emulate_media(media="screen", color_scheme=scheme)
        looks[scheme] = [page.evaluate(SEEN, each) for each in selectors]
        page.emulate_media(media="print", color_scheme=scheme)
        assert page.evaluate(SEEN, "body")[2] == "rgb(255, 255, 255)"
    page.close()
    for light, dark in zip(looks["light"], looks["dark"], strict=True):
        assert light != dark
    assert looks["dark"][0][2] == "rgb(21, 24, 29)"
