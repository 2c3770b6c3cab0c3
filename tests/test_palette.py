"""One palette: A is blue and E is orange in the model, pictures, reports and recordings."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest

from fivebar_sim import FiveBar, model
from fivebar_sim.recording import look as recording_look
from fivebar_sim.recording import plots
from fivebar_sim.recording.leg import COLOURS as LINKS
from fivebar_sim.render import palette, scene
from fivebar_sim.report import look

ROOT = Path(__file__).resolve().parents[1]
ALLOWED = {
    "fivebar_sim/render/palette.py": "the palette",
    "fivebar_sim/report/look.py": "paper, and what lies behind the lines",
    "fivebar_sim/page/compose.py": "what lies behind the lines of the page of a leg",
    "fivebar_sim/report/notebook/show.py": "the words of a verdict, on any notebook's paper",
    "fivebar_sim/report/workspace_map.py": "the ground of a map, behind the lines",
    "fivebar_sim/recording/web.py": "the page around Rerun's viewer",
}
"""The files of the package that may name a colour by its number."""

BEGINS = re.compile(r"""["'}][#\\]""")
"""Where a text begins with "#", or with an escape that may be one: no colour is without.

A field of an f-string may stand before it. Few files have any of it, and parsing all takes long.
"""


def hue(colour: tuple[int, int, int]) -> np.ndarray:
    """Return the direction of a colour from grey, of length 1."""
    away = np.array(colour) - np.mean(colour)
    return away / np.linalg.norm(away)


def test_the_model_has_the_colours_of_its_sides() -> None:
    built = model.build(FiveBar.load("extended"))
    for geoms, name in ((("L1", "L2", "L6"), "A"), (("L4", "L3"), "E")):
        wanted = palette.unit_rgb(palette.COLOURS[name].light)
        for geom in geoms:
            material = built.geom(geom).matid[0]
            np.testing.assert_allclose(built.mat_rgba[material][:3], wanted, atol=1e-3)


def test_reports_and_recordings_have_the_shades_of_the_palette() -> None:
    for name, shades in palette.COLOURS.items():
        assert look.COLOURS[name] == (shades.light, shades.dark)
    for k, shades in enumerate(palette.RUNS):
        assert look.COLOURS[f"run-{k + 1}"] == (shades.light, shades.dark)
    assert palette.unit_rgb(palette.COLOURS["target"].light) == scene.TARGET
    assert palette.unit_rgb(palette.COLOURS["foot"].light) == scene.FOOT
    assert palette.unit_rgb(palette.COLOURS["force"].light) == scene.FORCE


def test_lines_of_a_recording_are_seen_on_light_and_on_dark_plots() -> None:
    """Rerun's theme is its user's choice, and follows the system in a browser."""
    assert palette.contrast((0, 0, 0), (255, 255, 255)) == pytest.approx(21.0)
    drawn = [recording_look.shade(name) for name in palette.COLOURS]
    for colour in (*drawn, *recording_look.TINTS):
        for paper in palette.PAPER[:2]:
            assert palette.contrast(colour, palette.rgb(paper)) >= 3.0


@pytest.mark.parametrize(
    ("motor", "other", "joints", "links"),
    [("A", "E", "AB", ("L1", "L2")), ("E", "A", "ED", ("L4", "L3"))],
)
def test_a_chain_has_one_hue_in_a_recording(
    motor: str, other: str, joints: str, links: tuple[str, str]
) -> None:
    own = hue(recording_look.shade(motor))
    others = hue(recording_look.shade(other))
    colours = [plots.MOTOR_COLOURS[motor], *(LINKS[link] for link in links)]
    colours += [plots.ANGLE_COLOURS[f"theta_{joint}"] for joint in joints]
    for colour in colours:
        assert hue(colour) @ own > 0.95
        assert hue(colour) @ others < 0.0


def test_nothing_else_names_a_colour() -> None:
    """A colour that is typed a second time would drift from the palette."""
    found = []
    for file in sorted((ROOT / "fivebar_sim").rglob("*.py")):
        name = file.relative_to(ROOT).as_posix()
        source = file.read_text(encoding="utf-8")
        if not BEGINS.search(source):
            continue
        texts = [
            node.value
            for node in ast.walk(ast.parse(source))
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        ]
        if name not in ALLOWED and any(re.fullmatch(r"#[0-9a-fA-F]{6}", text) for text in texts):
            found.append(name)
    assert not found
