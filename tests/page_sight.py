"""The page of `fivebar page` in a browser: its state, where things are, whether a pose is right."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.analysis import singularity
from fivebar_sim.geometry import FiveBar

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

ROOT = Path(__file__).resolve().parents[1]
CLASSIC = FiveBar.load("classic")
EPS = 2.0**-23

STATE = """() => {
    const { state, stats, path, hands, map } = fivebar;
    const { pose, foot, force, signs, lengths, target, distances } = state;
    return { pose, foot, force, signs, lengths, target, distances, stats, done: map.done,
        rows: path.rows.length, playing: path.playing, places: hands.places(),
        said: document.getElementById("status").textContent };
}"""

TOO_WIDE = """() => [...document.querySelectorAll('main *')].filter(element => {
    const box = element.getBoundingClientRect();
    return box.width > 0 && (box.right > innerWidth + 1 || box.left < -1);
}).map(element => element.id || element.className || element.tagName)"""

SMALL = """() => [...document.querySelectorAll('button:not(.handle), .segments span, label')]
    .filter(one => !one.closest('.slider'))
    .filter(one => one.getBoundingClientRect().height > 0)
    .filter(one => one.getBoundingClientRect().height < 28).map(one => one.textContent)"""


class Sight:
    """A page in a tab, and everything that it says or asks for."""

    def __init__(self, browser: Browser, place: Path, **options: Any) -> None:
        wanted = {"viewport": {"width": 1280, "height": 900}, "color_scheme": "light"} | options
        self.context = browser.new_context(**wanted)
        self.page: Page = self.context.new_page()
        self.said: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.said.append(request.url))
        self.page.goto(place.as_uri(), wait_until="load")
        self.settle()

    def settle(self) -> dict[str, Any]:
        """Return the state once everything has been drawn."""
        for _ in range(400):
            if self.page.evaluate("Boolean(window.fivebar && fivebar.stats.frames)"):
                state = self.page.evaluate(STATE)
                if state["done"] and not self.page.evaluate("fivebar.dirty"):
                    return state
            self.page.wait_for_timeout(25)
        raise AssertionError("the page never came to rest")

    def view(self, pixel: list[float]) -> tuple[float, float]:
        """Return where a pixel of the picture is in the window."""
        box = self.page.locator(".view").bounding_box()
        assert box
        return box["x"] + 1 + pixel[0], box["y"] + 1 + pixel[1]

    def pixel(self, point: list[float]) -> tuple[float, float]:
        """Return where a point of the leg's plane is in the window."""
        return self.view(self.page.evaluate("p => fivebar.view.pixel(p)", point))


def is_right(leg: FiveBar, state: dict[str, Any]) -> None:
    """Check a pose against the kinematics in double precision, within some roundings of float32."""
    pose = state["pose"]
    theta = kinematics.inverse(leg, state["foot"], tuple(state["signs"]))
    # 16 roundings of the leg's size, over the length that turns; tests stay away from the edge.
    angle = 16 * EPS * leg.size / min(leg.L1, leg.L4) * 8
    np.testing.assert_allclose(pose["theta"], theta, rtol=0, atol=angle)
    J = kinematics.jacobian(leg, theta, int(pose["assembly"]))
    np.testing.assert_allclose(np.reshape(pose["J"], (2, 2)), J, rtol=0, atol=4 * angle)
    force = np.array(state["force"])
    np.testing.assert_allclose(pose["tau"], -J.T @ force, rtol=0, atol=40 * angle)
    far = singularity.distances(leg, theta, assembly=int(pose["assembly"]))
    shown = [state["distances"][key] for key in ("A", "E", "loop")]
    np.testing.assert_allclose(shown, np.abs(far), rtol=0, atol=angle)


def drawn(sight: Sight) -> dict[str, Any]:
    """Return the state after a path was drawn by hand, paused."""
    sight.page.click("input[value=draw] + span")
    mouse = sight.page.mouse
    corners = ([0.015, -0.08], [-0.015, -0.08], [-0.01, -0.06], [0.01, -0.06], [0.015, -0.078])
    mouse.move(*sight.pixel(corners[0]))
    mouse.down()
    for corner in corners[1:]:
        mouse.move(*sight.pixel(corner), steps=8)
    mouse.up()
    sight.page.click("#play")
    return sight.settle()


def compiled(folder: Path, points: np.ndarray) -> None:
    """Check that the firmware takes the header: its forward puts the foot on the path."""
    compiler = shutil.which("cc")
    if compiler is None:
        return
    (folder / "main.c").write_text(r"""
#include <stdio.h>
#include "page_leg.h"
int main(void)
{
    int k;
    if (fivebar_prepare(&page_leg) != FIVEBAR_OK) return 1;
    for (k = 0; k < page_gait.rows; k++) {
        float foot[2];
        if (fivebar_forward(&page_leg, page_gait.theta[k], page_leg.assembly, foot)) return 2;
        printf("%.9g %.9g\n", (double)foot[0], (double)foot[1]);
    }
    return 0;
}
""")
    firmware = ROOT / "firmware"
    command = [
        compiler,
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-pedantic",
        "-Werror",
        "-I",
        str(firmware),
    ]
    sources = [str(folder / "main.c"), str(firmware / "fivebar_leg.c")]
    program = str(folder / "main")
    subprocess.run([*command, *sources, "-o", program], check=True)
    run = subprocess.run([program], capture_output=True, text=True, check=True)
    feet = np.array([line.split() for line in run.stdout.splitlines()], dtype=float)
    np.testing.assert_allclose(feet, points[:-1], rtol=0, atol=1e-6)
