"""./.venv/bin/python scripts/bench_page.py [LEG]: frames a second of the page of `fivebar page`.

Debian's Chromium without a GPU (SwiftShader and software canvas) at 1280 x 900 px: while a stride
is played, while the foot is dragged, and while the force turns, for which the whole map is computed
anew. It prints the frames that came, and how long the page itself worked on one.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from fivebar_sim import page as pages

SECONDS = 3.0

DRAG = """state => {
    const angle = performance.now() / 300;
    const size = fivebar.state.size;
    fivebar.state.moveTo([0.2 * size * Math.cos(angle), state.z + 0.1 * size * Math.sin(angle)]);
    fivebar.changed('');
}"""

TURN = """() => {
    const angle = performance.now() / 300;
    fivebar.state.setForce([6 * Math.cos(angle), 6 * Math.sin(angle)]);
    fivebar.changed('');
}"""

COUNT = """seconds => new Promise(done => {
    const each = BODY;
    const state = { z: fivebar.state.foot[1] };
    Object.assign(fivebar.stats, { frames: 0, busy: 0, longest: 0, points: 0, mostPoints: 0 });
    const began = performance.now();
    let frames = 0;
    const step = () => {
        const spent = performance.now() - began;
        if (spent > 1000 * seconds) done({ fps: 1000 * frames / spent, ...fivebar.stats });
        else { frames += 1; each(state); requestAnimationFrame(step); }
    };
    requestAnimationFrame(step);
})"""


ALONE = """frames => {
    const pixel = document.createElement("canvas").getContext("2d", {willReadFrequently: true});
    const each = BODY;
    const state = { z: fivebar.state.foot[1] };
    const spent = [];
    for (let k = 0; k < frames; k++) {
        const began = performance.now();
        each(state);
        fivebar.step(began);
        // What was drawn is only drawn once somebody looks.
        pixel.drawImage(fivebar.canvas, 0, 0, 1, 1, 0, 0, 1, 1);
        pixel.getImageData(0, 0, 1, 1);
        spent.push(performance.now() - began);
    }
    spent.sort((a, b) => a - b);
    return [spent[Math.floor(frames / 10)], spent[Math.floor(frames / 2)]];
}"""
"""One frame after another, each drawn to its last pixel. On a busy machine the tenth part that was
fastest says what a frame costs where nothing else runs."""


def measure(page: Page, what: str, body: str) -> None:
    """Print what frames cost while something happens in each of them."""
    said = page.evaluate(COUNT.replace("BODY", body), SECONDS)
    quick, usual = page.evaluate(ALONE.replace("BODY", body), 300)
    print(
        f"{what:18s} {said['fps']:5.1f} frames/s; a frame takes {usual:5.2f} ms, in the fastest "
        f"tenth {quick:5.2f} ms; at most {said['mostPoints']} points of the map"
    )


def main(leg: str) -> None:
    """Measure the page of a leg."""
    flags = ["--no-sandbox", "--disable-gpu"]
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        place = Path(folder) / "leg.html"
        pages.write(leg, place)
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(place.as_uri())
        # The page's policy forbids eval, which wait_for_function needs.
        while not page.evaluate("Boolean(window.fivebar?.map.done)"):
            page.wait_for_timeout(50)
        page.wait_for_timeout(1000)
        measure(page, "foot dragged", DRAG)
        measure(page, "force turned", TURN)
        page.click("#stride")
        measure(page, "stride played", "() => {}")
        page.click("input[value=inverse] + span")
        measure(page, "with construction", "() => {}")
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "classic")
