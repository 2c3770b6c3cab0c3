"""The built documentation site: it builds without a warning, opens from disk, asks no other host.

FIVEBAR_SITE names the site that ./scripts/docs has built; without it these tests build it, which
takes longer than they do. The tests in a browser need Chromium and Playwright's Python package;
FIVEBAR_BROWSER=required makes their lack an error.
"""

from __future__ import annotations

import functools
import html
import http.server
import importlib
import importlib.util
import inspect
import os
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Page

ROOT = Path(__file__).parents[1]
LINKS = ("canonical", "next", "prev")
CUT = """() => [...document.querySelectorAll("article *")].filter(element => {
    const box = element.getBoundingClientRect();
    if (box.width === 0 || box.right <= document.documentElement.clientWidth + 1) return false;
    for (let around = element; around !== document.body; around = around.parentElement) {
        if (getComputedStyle(around).overflowX !== "visible") return false;
    }
    return true;
}).map(element => element.tagName + " " + element.textContent.slice(0, 40))"""
ROOMS = ("kinematics", "dynamics", "paths", "scenario.forces", "tasks")


class Loaded(HTMLParser):
    """What a page makes a browser load from other hosts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.outside: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag loads."""
        given = {name: value or "" for name, value in attrs}
        if tag == "a" or given.get("rel") in LINKS:
            return
        for name in ("src", "href", "srcset", "data", "poster", "style", "content"):
            value = given.get(name, "")
            if "://" in value or value.startswith("//"):
                self.outside.append(f"{tag} {name}={value}")


def test_what_a_page_loads_is_seen() -> None:
    inside = '<a href="https://x.y"></a><img src="a.svg"><link rel="canonical" href="https://x.y">'
    assert Loaded(inside).outside == []
    for text in (
        '<script src="https://x.y/a.js"></script>',
        '<link rel="stylesheet" href="//x.y/a.css">',
        '<img src="http://x.y/a.png">',
        '<p style="background: url(https://x.y/a.png)"></p>',
    ):
        assert len(Loaded(text).outside) == 1, text


@pytest.fixture(scope="module")
def site() -> Path:
    """Return the folder of the site, built anew unless it is given."""
    given = os.environ.get("FIVEBAR_SITE")
    if given is not None:
        return Path(given).resolve()
    command = [sys.executable, str(ROOT / "scripts" / "build_docs.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return ROOT / "build" / "site"


@pytest.mark.site
def test_pages_load_nothing_from_other_hosts(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 30
    found = [(page.name, each) for page in pages for each in Loaded(page.read_text()).outside]
    assert found == []
    for sheet in site.rglob("*.css"):
        assert "url(http" not in sheet.read_text().replace('"', "")
        assert "@import" not in sheet.read_text()


@pytest.mark.site
@pytest.mark.parametrize("room", ROOMS)
def test_all_exports_are_in_the_reference(site: Path, room: str) -> None:
    """A re-exported name that the generator leaves out would go unnoticed."""
    text = "".join(page.read_text() for page in (site / "reference").glob("*.html"))
    module = importlib.import_module(f"fivebar_sim.{room}")
    names = [
        n
        for n in module.__all__
        if inspect.isroutine(v := getattr(module, n)) or inspect.isclass(v)
    ]
    assert names
    missing = [n for n in names if not re.search(rf'id="fivebar_sim\.{room}(\.\w+)?\.{n}"', text)]
    assert missing == []


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves files without a word."""

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def address(site: Path) -> Iterator[str]:
    """Serve the site on loopback."""
    handler = functools.partial(Quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.site
def test_links_lead_to_what_is_there(site: Path) -> None:
    pages = {path: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    anchors = {path: set(re.findall(r'id="([^"]*)"', text)) for path, text in pages.items()}
    lost = []
    for path, text in pages.items():
        if path.name == "404.html":  # a server's
            continue
        for href in re.findall(r'<a[^>]*href="([^"]*)"', text):
            place, _, anchor = html.unescape(href).partition("#")
            if "://" in place or place.startswith(("mailto:", "/")):
                continue
            goal = (path.parent / unquote(place)).resolve() if place else path
            if not goal.exists() or (anchor and anchor not in anchors.get(goal, ())):
                lost.append((path.name, href))
    assert lost == []


@pytest.fixture
def page() -> Iterator[Page]:
    """Return a page of a browser as narrow as a phone."""
    lack = importlib.util.find_spec("playwright") is None or shutil.which("chromium") is None
    if lack and os.environ.get("FIVEBAR_BROWSER") == "required":
        pytest.fail("FIVEBAR_BROWSER is required, but there is no Playwright or no chromium")
    if lack:
        pytest.skip("there is no Playwright or no chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        yield browser.new_page(viewport={"width": 390, "height": 844})
        browser.close()


def found(page: Page, what: str) -> int:
    """Return how many results the search of a page has."""
    page.keyboard.press("/")
    page.keyboard.type(what)
    said = page.get_by_text(re.compile(r"^\d+ results?$"))
    said.wait_for(timeout=20_000)
    return int((said.text_content() or "").split()[0])


@pytest.mark.site
def test_served_pages_ask_no_other_host(page: Page, address: str) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    for path in ("/", "/controllers.html", "/reference/kinematics.html"):
        page.goto(f"{address}{path}", wait_until="networkidle")
        assert page.locator("h1").count() == 1
    assert found(page, "jacobian") > 5
    assert any(url.endswith("search.json") for url in asked)
    assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []


@pytest.mark.site
def test_pages_from_disk_fit_and_find(page: Page, site: Path) -> None:
    """Without a server: nothing is cut off or complained of, and the search works."""
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("request", lambda request: said.append(request.url))
    # The index of the search, which is megabytes, is not looked at before the last page.
    page.route("**/search.js", lambda route: route.fulfill(body="var __index = null;"))
    for path in sorted(site.rglob("*.html")):
        if path.name == "404.html":  # a server's
            continue
        page.goto(path.as_uri(), wait_until="load")
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, path
        assert page.evaluate(CUT) == [], path
    page.unroute("**/search.js")
    page.reload(wait_until="load")
    assert found(page, "jacobian") > 5
    assert [each for each in said if not each.startswith(("file:", "data:", "blob:"))] == []
