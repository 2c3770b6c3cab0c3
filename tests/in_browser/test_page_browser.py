"""The page in a browser: alone, right to float32, by mouse, finger and keyboard, in any width."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from page_sight import CLASSIC, SMALL, TOO_WIDE, Sight, compiled, drawn, is_right

from fivebar_sim import kinematics, page, rollout
from fivebar_sim.geometry import FiveBar
from fivebar_sim.scenario import Scenario

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    for name in ("classic", "extended", "airhockey"):
        page.write(name, folder / f"{name}.html")
    return {path.stem: path for path in folder.iterdir()}


@pytest.fixture(scope="module")
def opened(browser: Browser, places: dict[str, Path]) -> Iterator[Sight]:
    sight = Sight(browser, places["classic"])
    yield sight
    sight.context.close()


@pytest.fixture
def classic(opened: Sight, places: dict[str, Path]) -> Iterator[Sight]:
    """Return the page as it begins; opening it anew for each test takes most of the time."""
    opened.page.keyboard.press("Escape")
    opened.page.click("#reset")
    opened.settle()
    yield opened
    assert opened.said == [places["classic"].as_uri()]


@pytest.mark.parametrize("name", ["classic", "extended", "airhockey"])
def test_page_is_alone_right_and_fits(
    browser: Browser, places: dict[str, Path], name: str, tmp_path: Path
) -> None:
    sight = Sight(browser, places[name])
    leg = FiveBar.load(name)
    is_right(leg, sight.settle())
    for which in ("forward", "inverse"):
        sight.page.click(f"input[value={which}] + span")
        for width in (390, 1280):
            sight.page.set_viewport_size({"width": width, "height": 844})
            sight.settle()
            assert sight.page.evaluate("document.documentElement.scrollWidth") <= width
            assert sight.page.evaluate(TOO_WIDE) == []
            assert sight.page.evaluate(SMALL) == []

    # Without a path of one's own: a scenario all the same, of this very leg.
    sight.page.click("#copy-scenario")
    file = tmp_path / "scenario.toml"
    file.write_text(sight.page.input_value("#given-text"), encoding="utf-8")
    scenario = Scenario.load(file)
    assert scenario.leg == leg
    rollout.plan(scenario)
    assert sight.said == [places[name].as_uri()]
    sight.context.close()


def test_mouse_moves_foot_force_and_knees(classic: Sight) -> None:
    mouse = classic.page.mouse
    state = classic.settle()
    for goal in ([0.02, -0.06], [-0.031, -0.075], [0.0, -0.05]):
        mouse.move(*classic.view(state["places"]["foot"]))
        mouse.down()
        mouse.move(*classic.pixel(goal), steps=3)
        mouse.up()
        state = classic.settle()
        np.testing.assert_allclose(state["foot"], goal, atol=3e-4)
        is_right(CLASSIC, state)

    foot = state["foot"]
    mouse.move(*classic.view(state["places"]["force"]))
    mouse.down()
    x, y = classic.view(state["places"]["foot"])
    mouse.move(x - 60, y + 80, steps=3)
    mouse.up()
    state = classic.settle()
    assert state["foot"] == foot
    assert state["force"][0] / state["force"][1] == pytest.approx(60 / 80, rel=0.05)
    is_right(CLASSIC, state)

    # A knee that is turned about its motor leaves the other motor's angle as it is.
    theta_A, theta_E = state["pose"]["theta"]
    mouse.move(*classic.view(state["places"]["A"]))
    mouse.down()
    x, y = classic.view(state["places"]["A"])
    mouse.move(x - 10, y + 20, steps=3)
    mouse.up()
    state = classic.settle()
    assert state["pose"]["theta"][0] > theta_A + 0.05
    assert state["pose"]["theta"][1] == pytest.approx(theta_E, abs=1e-5)


def test_out_of_reach_is_said_and_no_angle_made_up(classic: Sight) -> None:
    mouse = classic.page.mouse
    mouse.move(*classic.view(classic.settle()["places"]["foot"]))
    mouse.down()
    mouse.move(*classic.pixel([0.03, -0.108]), steps=4)
    state = classic.settle()
    assert state["said"].startswith("out of reach by ")
    # The nearest point, and the angles are that point's.
    near = np.array(state["foot"])
    assert kinematics.forward(CLASSIC, state["pose"]["theta"]) == pytest.approx(near, abs=1e-6)
    gap = float(np.linalg.norm(near - state["target"]))
    assert f"by {1000 * gap:.1f} mm" in state["said"]
    mouse.move(*classic.pixel([0.0, -0.07]))
    mouse.up()
    assert classic.settle()["said"] == ""


def test_keyboard_moves_everything(classic: Sight) -> None:
    before = classic.settle()
    classic.page.focus("#handle-foot")
    for key in ("ArrowLeft", "ArrowUp", "Shift+ArrowRight"):
        classic.page.keyboard.press(key)
    state = classic.settle()
    step = 0.005 * CLASSIC.size
    moved = np.array(state["foot"]) - before["foot"]
    np.testing.assert_allclose(moved, [9 * step, step], atol=1e-6)
    is_right(CLASSIC, state)

    classic.page.keyboard.press("Tab")
    classic.page.keyboard.press("Shift+ArrowUp")
    changed = np.array(classic.settle()["force"]) - state["force"]
    np.testing.assert_allclose(changed, [0.0, 2.0], atol=1e-6)
    for motor in (0, 1):
        before = classic.settle()
        classic.page.keyboard.press("Tab")
        classic.page.keyboard.press("ArrowUp")
        turned = np.subtract(classic.settle()["pose"]["theta"], before["pose"]["theta"])
        assert turned[motor] == pytest.approx(np.pi / 180.0, abs=1e-5)
        assert turned[1 - motor] == pytest.approx(0.0, abs=1e-5)

    classic.page.focus("#slide-L2")
    classic.page.keyboard.press("ArrowRight")
    assert classic.settle()["lengths"][1] == pytest.approx(0.0601, abs=1e-6)
    label = classic.page.get_attribute("#handle-foot", "aria-label")
    assert label
    assert label.startswith("Foot at ")


def test_finger_drags(browser: Browser, places: dict[str, Path]) -> None:
    phone = {"width": 390, "height": 844}
    sight = Sight(browser, places["classic"], viewport=phone, has_touch=True, is_mobile=True)
    state = sight.settle()
    session = sight.context.new_cdp_session(sight.page)

    def touch(kind: str, *points: tuple[float, float]) -> None:
        where = [{"x": x, "y": y} for x, y in points]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": where})

    touch("touchStart", sight.view(state["places"]["foot"]))
    for goal in ([0.005, -0.068], [0.012, -0.064], [0.02, -0.06]):
        touch("touchMove", sight.pixel(goal))
    touch("touchEnd")
    state = sight.settle()
    np.testing.assert_allclose(state["foot"], [0.02, -0.06], atol=8e-4)
    # The finger moved the foot, not the page.
    assert sight.page.evaluate("scrollY") == 0
    sight.context.close()


def test_modes_lengths_and_reset(classic: Sight) -> None:
    for signs in ((1, -1), (-1, -1), (1, 1)):
        value = ",".join(map(str, signs))
        classic.page.click(f'input[name=mode][value="{value}"] + span')
        state = classic.settle()
        assert tuple(state["signs"]) == signs
        theta = kinematics.inverse(CLASSIC, state["foot"], signs)
        np.testing.assert_allclose(state["pose"]["theta"], theta, atol=2e-5)
    # No leg has a base of 5 m between links of some centimetres: said, and nothing changes.
    before = classic.settle()["lengths"]
    classic.page.fill("#type-L5", "5000")
    classic.page.keyboard.press("Tab")
    assert classic.settle()["lengths"] == before
    assert classic.page.inner_text("#refused") == "L5 = 5000 mm: these lengths make no leg"
    classic.page.fill("#type-L6", "20")
    classic.page.keyboard.press("Tab")
    state = classic.settle()
    assert state["lengths"][5] == pytest.approx(0.02)
    assert classic.page.inner_text("#side-A-name") == "A, B, F in line"
    classic.page.click("#reset")
    assert classic.settle()["lengths"] == before


def test_work_of_a_frame_is_bounded(classic: Sight) -> None:
    """However fast the force moves, a frame computes at most so many points of the map."""
    state = classic.settle()
    classic.page.evaluate("Object.assign(fivebar.stats, { points: 0, mostPoints: 0 })")
    mouse = classic.page.mouse
    mouse.move(*classic.view(state["places"]["force"]))
    mouse.down()
    x, y = classic.view(state["places"]["force"])
    for k in range(12):
        mouse.move(x - 5 * k, y - 3 * k)
    mouse.up()
    stats = classic.settle()["stats"]
    assert 0 < stats["mostPoints"] <= 8192
    # While only the foot moves nothing of the map is computed.
    classic.page.evaluate("Object.assign(fivebar.stats, { points: 0, mostPoints: 0 })")
    classic.page.focus("#handle-foot")
    for _ in range(5):
        classic.page.keyboard.press("ArrowUp")
    assert classic.settle()["stats"]["points"] == 0


def test_path_is_drawn_played_and_given_as_scenario_and_header(
    classic: Sight, tmp_path: Path
) -> None:
    state = drawn(classic)
    assert state["rows"] == 120
    assert not state["playing"]
    assert classic.page.is_visible("#chart")

    classic.page.click("#copy-scenario")
    text = classic.page.input_value("#given-text")
    file = tmp_path / "scenario.toml"
    file.write_text(text, encoding="utf-8")
    scenario = Scenario.load(file)
    assert scenario.leg == CLASSIC
    points = np.array(scenario.path.points)  # pyright: ignore[reportAttributeAccessIssue]
    assert points.shape == (121, 2)
    assert np.all(kinematics.inverse_all(CLASSIC, points)[:, 1] < 0.0)
    assert np.allclose(scenario.force.value, state["force"], rtol=1e-5)  # pyright: ignore[reportOptionalMemberAccess, reportAttributeAccessIssue]
    rollout.plan(scenario)
    classic.page.keyboard.press("Escape")

    classic.page.click("#copy-header")
    text = classic.page.input_value("#given-text")
    assert text.count("},") == 120
    (tmp_path / "page_leg.h").write_text(text, encoding="utf-8")
    compiled(tmp_path, points)


def test_light_and_dark(classic: Sight) -> None:
    # A copy of the picture is read: the browser complains of reading its own canvas often.
    seen = """() => {
        const copy = document.createElement("canvas").getContext("2d", {willReadFrequently: true});
        copy.drawImage(fivebar.canvas, 0, 0);
        const pixel = copy.getImageData(4, 4, 1, 1).data.join();
        return [getComputedStyle(document.body).backgroundColor, pixel];
    }"""
    light = classic.page.evaluate(seen)
    assert light == ["rgb(255, 255, 255)", "255,255,255,255"]
    classic.page.emulate_media(color_scheme="dark")
    # The browser tells the page of it before it draws its next frame, and that may come late.
    classic.page.evaluate("new Promise(next => requestAnimationFrame(next))")
    classic.settle()
    dark = classic.page.evaluate(seen)
    assert dark == ["rgb(21, 24, 29)", "21,24,29,255"]
    classic.page.click("#theme")
    classic.settle()
    assert classic.page.evaluate(seen) == light
    classic.page.emulate_media(color_scheme="light")
