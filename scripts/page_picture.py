"""./.venv/bin/python scripts/page_picture.py: draws docs/page.png, the README's second picture.

The page of `fivebar page classic` in Debian's Chromium: the classic leg on a stride, with the
construction of its inverse. Needs Chromium and Playwright's Python package.
"""

from __future__ import annotations

import io
import shutil
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from fivebar_sim import page as pages

OUT = Path(__file__).resolve().parent.parent / "docs" / "page.png"

POSE = """() => {
    document.querySelector("input[value=inverse]").click();
    document.getElementById("stride").click();
    fivebar.path.playing = false;
    fivebar.path.phase = 0.62;
    fivebar.state.moveTo(fivebar.path.at(fivebar.path.phase));
    fivebar.changed("");
}"""


def shot() -> bytes:
    """Return a picture of the page as PNG."""
    flags = ["--no-sandbox", "--disable-gpu", "--font-render-hinting=none"]
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        place = Path(folder) / "leg.html"
        pages.write("classic", place)
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": 1280, "height": 900}, color_scheme="light")
        page.goto(place.as_uri())
        page.evaluate(POSE)
        # The page's policy forbids eval, which wait_for_function needs.
        while not page.evaluate("fivebar.map.done && !fivebar.dirty"):
            page.wait_for_timeout(50)
        page.wait_for_timeout(200)
        box = page.locator("#hint").bounding_box()
        assert box
        low = box["y"] + box["height"] + 12
        picture = page.screenshot(clip={"x": 0, "y": 0, "width": 1280, "height": low})
        browser.close()
    return picture


if __name__ == "__main__":
    Image.open(io.BytesIO(shot())).convert("RGB").save(OUT, optimize=True)
    print(f"wrote {OUT.name}: {OUT.stat().st_size / 1e3:.0f} kB")
