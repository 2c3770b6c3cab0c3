"""The workspace as a picture, and the command that draws it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from fivebar_sim import workspace
from fivebar_sim.cli import main
from fivebar_sim.errors import ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.report import workspace_map
from fivebar_sim.report.look import colour
from fivebar_sim.workspace.margin import margin


def test_area_of_a_ring() -> None:
    """A coaxial leg with equal sides reaches a ring: pi ((L1 + L2)^2 - (L1 - L2)^2)."""
    leg = FiveBar(L1=0.04, L2=0.06, L3=0.06, L4=0.04, L5=0.0)
    exact = np.pi * (0.1**2 - 0.02**2)
    # half a cell along the two circles, as often in as out
    assert workspace_map.survey(leg).area == pytest.approx(exact, rel=5e-3)


def test_map_is_cut_to_the_region() -> None:
    surveyed = workspace_map.survey(FiveBar(), cells=101)
    assert surveyed.distance.shape == (len(surveyed.z), len(surveyed.x))
    inside = surveyed.distance > 0.0
    edges = np.concatenate([inside[0], inside[-1], inside[:, 0], inside[:, -1]])
    assert not edges.any()
    # x is across: the classic leg is mirrored in x = 0
    np.testing.assert_allclose(surveyed.distance, surveyed.distance[:, ::-1], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "suffix", "path"),
    [("doggo", ".png", []), ("classic", ".svg", ["--path", "classic-ellipse"])],
)
def test_command_draws(
    name: str, suffix: str, path: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / f"map{suffix}"
    assert main(["workspace", name, "--out", str(out), *path]) == 0
    assert capsys.readouterr().out.startswith(f"{name}: the foot reaches ")
    assert out.stat().st_size > 10_000
    assert [path.name for path in tmp_path.iterdir()] == [out.name]
    if path:
        assert colour("target") in out.read_text(encoding="utf-8")


def test_map_colours_the_distance_on_both_sides_of_the_edge() -> None:
    """Inside to the boundary; outside to the nearest point that `workspace.nearest` gives."""
    leg = FiveBar()
    surveyed = workspace_map.survey(leg, cells=41)
    ax = Figure().add_subplot()
    workspace_map._shade(ax, surveyed)
    inside, outside = (mesh.get_array() for mesh in ax.collections)
    assert inside is not None
    assert outside is not None
    # every cell has one of the two colours
    assert (np.ma.getmaskarray(inside) != np.ma.getmaskarray(outside)).all()
    foot = np.stack(np.meshgrid(surveyed.x, surveyed.z), axis=-1)
    gap = np.hypot(*np.moveaxis(workspace.nearest(leg, foot, mode=leg.mode) - foot, -1, 0))
    lost = ~np.ma.getmaskarray(outside)
    np.testing.assert_allclose(np.asarray(outside)[lost], 1e3 * gap[lost], rtol=1e-9)
    assert not gap[~lost].any()


def test_map_shows_all_of_a_path() -> None:
    far = np.array([[0.0, -0.06], [0.02, -0.25]])
    surveyed = workspace_map.survey(FiveBar(), cells=61, path=far)
    assert surveyed.z[0] < -0.25
    assert surveyed.z[-1] < 0.15
    assert (surveyed.distance >= 0.0).any()


def test_margin_of_a_path_in_a_ring() -> None:
    """A coaxial leg reaches radii L1 - L2 to L1 + L2: the margin is known in closed form."""
    leg = FiveBar(L1=0.06, L2=0.04, L3=0.04, L4=0.06, L5=0.0)
    radius = np.array([0.05, 0.07, 0.093, 0.06])
    path = radius[:, None] * [0.6, -0.8]
    assert margin(leg, path) == (pytest.approx(0.007), 2, None, 0.0)
    radius[[1, 3]] = 0.015, 0.104
    found = margin(leg, radius[:, None] * [0.6, -0.8])
    assert found == (pytest.approx(-0.005), 1, 1, 0.5)


def test_command_says_the_least_margin_or_warns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = workspace_map.survey
    monkeypatch.setattr(workspace_map, "write", lambda leg, out, path: survey(leg, cells=21))
    circle = """
    duration = 2.0
    [path]
    kind = "circle"
    centre = [0.0, -0.075]
    radius = {}
    frequency = 2.0
    """
    (tmp_path / "in.toml").write_text(circle.format(0.01))
    (tmp_path / "out.toml").write_text(circle.format(0.03))
    arguments = ["workspace", "classic", "--out", str(tmp_path / "map.png"), "--path"]
    assert main([*arguments, str(tmp_path / "in.toml")]) == 0
    said = capsys.readouterr()
    angle = np.linspace(0.0, 2.0 * np.pi, 500)
    around = np.stack([0.01 * np.cos(angle), 0.01 * np.sin(angle) - 0.075], axis=-1)
    least = workspace.distance(FiveBar(), around, mode=FiveBar().mode)
    told = re.search(r"in: the path stays inside, ([\d.]+) mm from the edge at (.*) s\n", said.out)
    assert told is not None
    assert float(told[1]) == pytest.approx(1e3 * least.min(), rel=5e-3)
    x, z = (float(number) for number in re.findall(r"-?[\d.]+", told[2])[:2])
    at = workspace.distance(FiveBar(), [1e-3 * x, 1e-3 * z], mode=FiveBar().mode)
    assert at == pytest.approx(least.min(), abs=1e-4)  # of the place's one decimal
    assert said.err == ""
    assert main([*arguments, str(tmp_path / "out.toml")]) == 0
    said = capsys.readouterr()
    assert said.err.startswith("fivebar: warning: the path of out leaves the workspace of classic")
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["clasic"], "unknown leg preset 'clasic'; known: airhockey, classic"),
        (
            ["classic", "--out", "map.bmp"],
            "cannot draw map.bmp: the picture must end in .png, .svg",
        ),
        (["classic", "--out", "/nowhere/map.png"], "cannot write /nowhere/map.png: No such file"),
        (["classic", "--path", "trot"], "unknown scenario 'trot'"),
    ],
)
def test_refusal(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["workspace", *arguments]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"fivebar: {message}")
    assert said.count("\n") == 1


def test_refusal_in_python(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="must end in"):
        workspace_map.write(FiveBar(), tmp_path / "map")


def test_a_name_is_no_formula_and_without_a_path_none_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = workspace_map.survey
    monkeypatch.setattr(workspace_map, "survey", lambda leg, path: survey(leg, cells=21))
    out = tmp_path / "map.svg"
    workspace_map.write(FiveBar(name="$x^{$"), out)
    drawn = out.read_text(encoding="utf-8")
    assert "$x^{$" in drawn
    assert colour("singular") in drawn
    assert colour("target") not in drawn
