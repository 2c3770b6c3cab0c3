"""The built documentation site: it builds without a warning, and asks nothing of other hosts.

FIVEBAR_SITE names the site that ./scripts/docs has built; without it these tests build it, which
takes longer than they do. The test in a browser needs Chromium and Playwright's Python package;
FIVEBAR_BROWSER=required makes their lack an error.
"""

from __future__ import annotations

import functools
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

import pytest

ROOT = Path(__file__).parents[1]
LINKS = ("canonical", "next", "prev")
ROOMS = ("kinematics", "dynamics", "paths", "scenario.forces", "tasks")


class Loaded(HTMLParser):
    """What a page makes a browser load from other hosts."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.outside: list[str] = []
        self.feed(html)

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
    for html in (
        '<script src="https://x.y/a.js"></script>',
        '<link rel="stylesheet" href="//x.y/a.css">',
        '<img src="http://x.y/a.png">',
        '<p style="background: url(https://x.y/a.png)"></p>',
    ):
        assert len(Loaded(html).outside) == 1, html


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
    html = "".join(page.read_text() for page in (site / "reference").rglob("index.html"))
    module = importlib.import_module(f"fivebar_sim.{room}")
    names = [
        n
        for n in module.__all__
        if inspect.isroutine(v := getattr(module, n)) or inspect.isclass(v)
    ]
    assert names
    missing = [n for n in names if not re.search(rf'id="fivebar_sim\.{room}(\.\w+)?\.{n}"', html)]
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
def test_a_browser_asks_no_other_host(address: str) -> None:
    lack = importlib.util.find_spec("playwright") is None or shutil.which("chromium") is None
    if lack and os.environ.get("FIVEBAR_BROWSER") == "required":
        pytest.fail("FIVEBAR_BROWSER is required, but there is no Playwright or no chromium")
    if lack:
        pytest.skip("there is no Playwright or no chromium")
    from playwright.sync_api import sync_playwright

    asked: list[str] = []
    with sync_playwright() as play:
        browser = play.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = browser.new_page()
        page.on("request", lambda request: asked.append(request.url))
        for path in ("", "/controllers/", "/reference/kinematics/"):
            page.goto(f"{address}{path}", wait_until="networkidle")
            assert page.locator("h1").count() == 1
        page.keyboard.press("/")  # the search, with its worker and its index
        page.wait_for_timeout(1000)
        browser.close()
    assert any(url.endswith("search.json") for url in asked)
    assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []
