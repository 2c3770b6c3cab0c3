"""The page of a design study: every design in every picture, and nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reports import Page

from fivebar_sim import design
from fivebar_sim.design.evaluation.evaluate import evaluate
from fivebar_sim.design.proof.simulate import Simulated
from fivebar_sim.design.proof.table import Proof
from fivebar_sim.design.report import charts, words
from fivebar_sim.design.report.axes import Axis, amount
from fivebar_sim.design.report.script import SCRIPT
from fivebar_sim.design.report.study import Built, Study, to_simulate
from fivebar_sim.design.report.write import write
from fivebar_sim.design.robust.sensitivity import Sensitivity
from fivebar_sim.design.robust.tolerance import Yield
from fivebar_sim.design.search import front
from fivebar_sim.render.leg_lines import thinned


@pytest.fixture(scope="module")
def study() -> Study:
    """A front of some designs, the first and the last of which are the best; numbers made up."""
    task = design.load("classic-lengths")
    found = evaluate(task, task.sample(300, 0))
    best = front.empty(task, found).joined(task, 0, found)
    rows = best.designs.values[[0, -1]]
    runs = [Simulated({"heat": 0.14}, (), ""), Simulated({}, (), "broke <down>")]
    total = {"L1": 0.7, "L2": 0.2, "L3": 0.05, "L4": 0.05}
    robust = [
        Built(
            2e-4,
            Yield(0.973, 0.002, {"reach": 0.027}, {}),
            [
                Sensitivity("torque_peak", 0.01, total, total),
                Sensitivity("mass", 0.01, total, dict.fromkeys(total, 0.25)),
            ],
        ),
        Built(2e-4, Yield(1.0, 0.0, {}, {}), []),
    ]
    proof = Proof(rows, {"heat": np.array([0.139, 0.2])}, {"heat": np.array([0.14, np.nan])}, runs)
    presets = ["best/a-01.toml", "best/a-02.toml"]
    return Study(task, best, rows, presets, ["3.1 mm <inside>", "as well"], robust, proof)


@pytest.fixture(scope="module")
def page(study: Study, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return Page(write(study, tmp_path_factory.mktemp("study")))


def test_every_design_is_in_every_picture(study: Study, page: Page) -> None:
    shown = {str(k) for k in range(len(study.front.rows))}
    for tag, kind in (("circle", "dot"), ("path", "strand"), ("g", "one"), ("p", "told")):
        found = [e.attributes for e in page.all(tag) if kind in e.attributes.get("class", "")]
        assert {each["data-k"] for each in found} == shown, kind
        on = [each["data-k"] for each in found if "on" in each["class"].split()]
        assert on == ["0"], kind
    rows = [e for e in page.all("tr") if "data-k" in e.attributes]
    assert [e.attributes["data-k"] for e in rows] == ["0", "1"]
    assert all(preset in "".join(e.text) for e, preset in zip(rows, study.presets, strict=True))


def test_simulated_are_the_best_then_others_of_the_front(study: Study) -> None:
    task = study.task
    found = study.front
    best = study.best
    assert (to_simulate(task, found, best, 1) == best[:1]).all()
    some = to_simulate(task, found, best, 9)
    assert (some[:2] == best).all()
    assert len(np.unique(some, axis=0)) == 9
    every = to_simulate(task, found, best, 10_000)
    assert len(np.unique(every, axis=0)) == len(every) == len(found.rows)
    assert to_simulate(task, found, best[:0], 0).shape == (0, 2)


def test_page_is_its_own_and_runs_its_own_script_only(page: Page) -> None:
    digest = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
    policy = [e.attributes.get("content", "") for e in page.all("meta")]
    assert any("default-src 'none'; " in p and f"script-src 'sha256-{digest}'" in p for p in policy)
    (script,) = page.all("script")
    assert "".join(script.text) == SCRIPT
    assert not re.search(r"https?://|//[a-z]", page.source.replace(SCRIPT, ""))
    assert "broke &lt;down&gt;" in page.source
    assert "3.1 mm &lt;inside&gt;" in page.source


def test_page_tells_yield_blame_and_what_to_take(study: Study, page: Page) -> None:
    text = re.sub(r"<[^>]*>", "", page.source)
    assert "97.3 % keep to every constraint" in text
    assert "What breaks: reach in 2.7 %" in text
    assert "The peak torque scatters by 1 %: the printer must get L1 right" in text
    assert "The mass scatters by 1 %, for which no dimension alone is to blame" in text
    assert "2 designs in MuJoCo, on the same motions. 1 broke down, the first: broke" in text
    assert "Take this one, best/a-01.toml" in text
    assert f"L1 = {float(study.best[0][0])!r}\n" in text


def test_page_has_words_with_units_for_keys(page: Page) -> None:
    """All but the task itself, which is shown as it is typed."""
    text = re.sub(r"<[^>]*>", " ", page.source.partition("<pre>leg = ")[0])
    assert not re.search(r"[a-z]+_[a-z]+|leg\.L", text.partition("The front")[2])
    (head,) = re.findall(r"<thead>.*built right.*</thead>", page.source)
    heads = re.findall(r"<th[^>]*>([^<]*)</th>", head)
    assert heads == ["design", "peak torque", "mass", "built right"]
    for told in ("peak torque [mN m]", "peak torque ", "L1 "):
        assert told in text


VARIED = """
leg = "classic"
objectives = ["mass"]
[vary]
leg.L1 = [0.03, 0.05]
leg.tilt = [0.0, 0.1]
leg.gravity.1 = [-9.8, -1.6]
servo = { choice = ["xl330", "hobby-9g"] }
motion.2.path.centre.1 = [-0.080, -0.070]
motion.2.payload = [0.0, 0.01]
motion.2.force.value.1 = [1.0, 2.0]
region.1.low.0 = [-0.01, 0.0]
[motion.2]
payload = 0.01
path = { kind = "ellipse", centre = [0.0, -0.075], radii = [0.01, 0.006], frequency = 1.0 }
force = { kind = "constant", value = [0.0, 2.0] }
[region.1]
kind = "box"
low = [-0.01, -0.080]
high = [0.01, -0.070]
[search]
method = "sobol"
"""


def test_variables_have_the_units_of_their_keys(tmp_path: Path) -> None:
    (tmp_path / "task.toml").write_text(VARIED, "utf-8")
    task = design.load(tmp_path / "task.toml")
    shown = {words.short(key): words.unit(task, key) for key in task.names}
    assert shown == {
        "L1": "m",
        "tilt": "rad",
        "gravity.1": "m/s^2",
        "servo": "",
        "2.path.centre.1": "m",
        "2.payload": "kg",
        "2.force.value.1": "N",
        "1.low.0": "m",
    }
    assert words.setting(task, "motion.2.path.centre.1", -0.0718) == "2.path.centre.1 -71.8 mm"
    assert words.setting(task, "servo", "xl330") == "servo xl330"
    k = task.names.index("servo")
    assert [word for _, word in words.axis(task, k, np.zeros(3)).ticks()] == ["xl330", "hobby-9g"]


def test_long_names_of_axes_go_over_lines_that_do_not_meet() -> None:
    assert charts.axis_lines("peak torque [mN m]") == ["peak torque", "[mN m]"]
    assert charts.axis_lines("heat over a serial leg's") == ["heat over a", "serial leg's"]
    assert charts.axis_lines("walk.path.centre.1 [mm]") == ["walk.path.", "centre.1", "[mm]"]
    assert charts.axis_lines("gear") == ["gear"]


def test_front_of_one_objective_is_drawn_over_a_variable(study: Study, tmp_path: Path) -> None:
    import dataclasses

    task = dataclasses.replace(study.task, objectives=("mass",))
    found = evaluate(task, task.sample(60, 0))
    only = front.empty(task, found).joined(task, 0, found)
    alone = Study(task, only, only.designs.values[:1], ["best/a.toml"], [""], [], None)
    source = write(alone, tmp_path).read_text("utf-8")
    assert "mass [g] over L1 [mm] of 1 designs" in source
    assert "Built a little off" not in source


@given(st.floats(-1e3, 1e3), st.floats(1e-6, 1e3))
def test_ticks_are_round_and_within(low: float, span: float) -> None:
    axis = Axis.of("x", "", np.array([low, low + span]))
    ticks = axis.ticks()
    assert 2 <= len(ticks) <= 7
    for part, text in ticks:
        assert -1e-9 <= part <= 1.0 + 1e-9
        at = axis.low + part * (axis.high - axis.low)
        assert float(text) == pytest.approx(at, abs=2e-3 * span + 1e-9 * abs(low))


def test_numbers_are_in_the_units_of_a_leg() -> None:
    assert amount(0.0614, "N m") == "61.4 mN m"
    assert amount(0.0045, "m") == "4.5 mm"
    assert amount(0.0132, "kg") == "13.2 g"
    assert Axis.of("a", "N m", np.array([0.04, 0.07])).label == "a [mN m]"
    assert Axis.of("a", "", np.array([np.nan])).low < 1.0


def test_thinned_curve_keeps_its_ends_and_stays_near() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 2000)
    curve = np.stack([np.cos(turn), 0.5 * np.sin(turn)], axis=1)
    few = thinned(curve, 1e-3)
    assert 20 < len(few) < 200
    assert (few[[0, -1]] == curve[[0, -1]]).all()
    # Every point of the curve is near one of the straight pieces.
    a = few[:-1, None]
    along = few[1:, None] - a
    part = np.clip(((curve - a) * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    away = np.linalg.norm(curve - (a + part[..., None] * along), axis=-1).min(axis=0)
    assert away.max() <= 1e-3 * (1.0 + 1e-9)


@pytest.fixture
def chromium() -> str:
    found = shutil.which("chromium")
    if found is None:
        pytest.skip("there is no chromium on the PATH")
    return found


@pytest.mark.long
@pytest.mark.parametrize("width", [390, 1280])
def test_design_under_the_pointer_is_shown(
    study: Study, tmp_path: Path, chromium: str, width: int
) -> None:
    pytest.importorskip("playwright")
    from playwright.sync_api import sync_playwright

    place = write(study, tmp_path)
    with sync_playwright() as playwright:
        flags = ["--no-sandbox", "--disable-gpu"]
        browser = playwright.chromium.launch(executable_path=chromium, args=flags)
        opened = browser.new_page(viewport={"width": width, "height": 900})
        told: list[str] = []
        opened.on("console", lambda message: told.append(message.text))
        opened.goto(place.as_uri())
        assert opened.evaluate("document.documentElement.scrollWidth") == width
        opened.hover('circle[data-k="3"]', force=True)
        on = "[...document.querySelectorAll('.on')].map(one => one.dataset.k)"
        assert set(opened.evaluate(on)) == {"3"}
        shown = "getComputedStyle(document.querySelector('g.one[data-k=\"{}\"]')).visibility"
        assert opened.evaluate(shown.format(3)) == "visible"
        assert opened.evaluate(shown.format(0)) == "hidden"
        assert told == []
        browser.close()
