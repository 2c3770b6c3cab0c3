"""Results and legs in a notebook: short reprs, HTML, data frames, figures, the report."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from fivebar_controllers.pd import Pd
from matplotlib.figure import Figure

from fivebar_sim import FiveBar, Result, Scenario, rollout, run
from fivebar_sim.errors import ArgumentError, RunDirectoryError
from fivebar_sim.files import resources
from fivebar_sim.paths import Ellipse
from fivebar_sim.report import look, notebook
from fivebar_sim.report.draw import Drawn


@pytest.fixture(scope="module")
def result() -> Result:
    settings = ["duration=0.8", "name=a&b", "limits.tracking.max=1e-9"]
    return run(Scenario.load("classic-ellipse", settings))


@pytest.mark.parametrize("preset", sorted(resources.shipped("models/legs")))
def test_repr_of_a_leg_makes_the_leg(preset: str) -> None:
    leg = FiveBar.load(preset)
    assert eval(repr(leg), {"FiveBar": FiveBar}) == leg
    assert repr(FiveBar(L2=0.07)) == "FiveBar(L2=0.07)"
    assert repr(FiveBar()) == "FiveBar()"


def test_leg_and_path_make_a_scenario() -> None:
    path = Ellipse(centre=(0.0, -0.072), radii=(0.02, 0.008), frequency=2.0, ramp=0.25)
    shipped = Scenario.load("classic-ellipse", ["limits={}"])
    plain = Scenario(leg=FiveBar(name="classic"), path=path)
    assert msgspec.structs.replace(plain, name=shipped.name) == shipped
    assert Scenario(leg=FiveBar(), path=path, controller=Pd()).controller_name == "pd"
    table = plain.table()
    assert Scenario.from_table(table, "again", Path()) == plain


def test_html_has_verdict_metrics_and_leg(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(look, "png", lambda figure: b"drawn")
    page = result._repr_html_()
    assert ">fail</b>" in page
    assert "a&amp;b: classic leg" in page
    assert "a&b" not in page
    rows = re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td>.*?</tr>", page)
    assert ("tracking RMS", "1.192 mm") in rows
    assert page.count("FAIL") == 1
    assert 'src="data:image/png;base64,ZHJhd24="' in page


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_data_frame_is_made_of_the_record(
    result: Result, monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    made = {library: SimpleNamespace(DataFrame=lambda columns: (library, columns))}
    monkeypatch.setattr(rollout.importlib, "import_module", made.__getitem__)
    frame = result.to_pandas() if library == "pandas" else result.to_polars()
    assert frame == (library, result.record)


@pytest.mark.long
def test_data_frame_of_pandas_is_the_record(result: Result) -> None:
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    frame = result.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame) == list(result.record)
    np.testing.assert_array_equal(frame["torque_A"], result.record["torque_A"])


def test_library_that_is_missing_is_named(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(rollout.importlib, "import_module", missing)
    with pytest.raises(ModuleNotFoundError, match=r"to_polars needs polars .*pip install polars"):
        result.to_polars()


def test_every_plot_is_a_figure_of_the_report(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert isinstance(result.plot("torque-speed"), Figure)
    figure = Figure()
    for name in notebook.PLOTS:
        monkeypatch.setitem(notebook.PLOTS, name, lambda run: Drawn("x", "", "", "", figure))
        assert result.plot(name) is figure
        assert name in (Result.plot.__doc__ or "")
    with pytest.raises(ArgumentError, match=r"^unknown plot 'torques'; known: .*'torque'"):
        result.plot("torques")


def test_what_is_not_there_is_not_drawn(result: Result) -> None:
    with pytest.raises(ArgumentError, match=r"^'ground' has nothing to draw in a&b"):
        result.plot("ground")


@pytest.mark.long
def test_report_is_the_commands(tmp_path: Path) -> None:
    run_ = run(Scenario.load("classic-ellipse", ["duration=0.8"]))
    place = run_.report(tmp_path / "page.html")
    assert place == tmp_path / "page.html"
    assert "classic-ellipse" in place.read_text("utf-8")


def test_refusal_of_a_report_without_a_name(tmp_path: Path) -> None:
    run_ = run(Scenario.load("classic-ellipse", ["duration=0.8"]))
    with pytest.raises(RunDirectoryError, match=r"a report must end in \.html"):
        run_.report(tmp_path / "page")
