"""`replay --web` as a browser shows it: the leg is in sight, and nothing leaves this machine."""

from __future__ import annotations

import io
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import matplotlib.image
import numpy as np

from fivebar_sim import rollout
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.recording import rrd, web
from fivebar_sim.recording.look import Colour, shade
from fivebar_sim.scenario import Scenario

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

PATIENCE = 120.0
"""How long the viewer may take to show the leg [s]: without a graphics card it takes about 20."""
WIDE = 800
HIGH = 500
ENOUGH = 100
"""Pixels that a link has at least."""


def coloured(picture: Array, colour: Colour) -> Bools:
    """Return which pixels have the hue of a colour, lit or in shade, (height, width).

    A pixel is a multiple of its colour, but for what little white the light adds.
    """
    wanted = np.array(colour) / np.linalg.norm(colour)
    length = np.linalg.norm(picture, axis=-1)
    likeness = picture @ wanted / np.maximum(length, 1e-9)
    return (likeness > 0.995) & (length > 0.25)


def shot(page: Page) -> Array:
    """Return the picture of the 3D view, its colours in [0, 1], (height, width, 3)."""
    data = page.screenshot(timeout=1e3 * PATIENCE)
    picture = matplotlib.image.imread(io.BytesIO(data), format="png")
    return picture[70 : HIGH // 2, 10 : int(0.38 * WIDE), :3].astype(np.float64)


def test_the_leg_is_in_sight_and_nothing_leaves_the_machine(
    browser: Browser, tmp_path: Path
) -> None:
    result = rollout.run(Scenario.load("classic-ellipse", ["duration=0.8"]))
    rrd.write(tmp_path / "a.rrd", [result])
    asked: list[str] = []
    told: list[str] = []

    with web.Server(0) as server:
        server.pages = web.pages(tmp_path / "a.rrd", "ellipse")
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = browser.new_page(viewport={"width": WIDE, "height": HIGH})
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        page.on("console", lambda message: told.append(message.type))
        page.goto(server.url)
        page.wait_for_selector("#the_canvas_id.visible", timeout=1e3 * PATIENCE)
        end = time.monotonic() + PATIENCE
        seen = [0]
        while min(seen) < ENOUGH and time.monotonic() < end:
            page.wait_for_timeout(300)
            picture = shot(page)
            links = [shade(joint) for joint in "ABDE"]
            seen = [int(coloured(picture, link).sum()) for link in links]
        title = page.title()
        page.close()
        server.shutdown()

    assert min(seen) >= ENOUGH, f"pixels of L1, L2, L3, L4: {seen}"
    assert title == "ellipse"
    names = {urlsplit(url).path for url in asked}
    assert {"/", "/re_viewer_bg.wasm", "/recording.rrd"} <= names
    assert {urlsplit(url).netloc for url in asked} == {f"127.0.0.1:{server.port}"}
    # Thousands of lines about each shader would fill the console, and take half of the time.
    assert "debug" not in told
