"""One browser for all tests here: to start it and what drives it takes longer than most of them.

Needs Chromium and Playwright's Python package; FIVEBAR_BROWSER=required makes their lack an error.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser

BROWSERS = ("chromium", "chromium-browser", "google-chrome")

FLAGS = (
    # It draws without a graphics card, scenes in 3D too.
    *("--disable-gpu", "--enable-unsafe-swiftshader", "--no-sandbox"),
    # It looks for nothing by itself.
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    "--no-first-run",
    # Chromium's own pages, which unfold from an address bar that nobody sees.
    "--disable-features=WebUIOmniboxPopup,WebUIOmniboxAimPopup",
)


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Return the browser; it ends with the last of these tests, as asyncio must be free again."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    missing = [] if found else ["Chromium"]
    if importlib.util.find_spec("playwright") is None:
        missing.append("the Python package playwright")
    if missing and os.environ.get("FIVEBAR_BROWSER") == "required":
        pytest.fail(f"FIVEBAR_BROWSER=required, but {' and '.join(missing)} is not installed")
    if missing:
        pytest.skip(f"{' and '.join(missing)} is not installed")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=found, args=list(FLAGS))
        yield started
        started.close()
