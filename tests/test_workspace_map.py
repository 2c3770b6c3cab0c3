"""The workspace as a picture, and the command that draws it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fivebar_sim.cli import main
from fivebar_sim.errors import ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.report import workspace_map


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


@pytest.mark.parametrize(("name", "suffix"), [("classic", ".png"), ("doggo", ".svg")])
def test_command_draws(
    name: str, suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / f"map{suffix}"
    assert main(["workspace", name, "--out", str(out)]) == 0
    assert capsys.readouterr().out.startswith(f"{name}: the foot reaches ")
    assert out.stat().st_size > 10_000
    assert [path.name for path in tmp_path.iterdir()] == [out.name]


def test_path_is_drawn(tmp_path: Path) -> None:
    plain = tmp_path / "plain.svg"
    with_path = tmp_path / "path.svg"
    assert main(["workspace", "classic", "--out", str(plain)]) == 0
    assert main(["workspace", "classic", "--out", str(with_path), "--path", "classic-ellipse"]) == 0
    assert "#ffa500" in with_path.read_text()
    assert "#dc143c" in plain.read_text()  # the singular curve
    assert "#ffa500" not in plain.read_text()


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
