"""Results and legs in a notebook: short reprs, HTML, data frames, figures, the report."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from fivebar_controllers.pd import Pd
from matplotlib.figure import Figure

from fivebar_sim import FiveBar, Result, Scenario, rollout, run
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError, RunDirectoryError
from fivebar_sim.files import resources
from fivebar_sim.paths import Ellipse, Gait, Hop
from fivebar_sim.recording.check import PROPERTY
from fivebar_sim.regression import comparison
from fivebar_sim.render import leg_lines
from fivebar_sim.report import look, notebook
from fivebar_sim.report.draw import Drawn
from fivebar_sim.runs import inline
from fivebar_sim.scenario.forces import Constant
from fivebar_sim.scenario.scenes import Treadmill
from fivebar_sim.simulation.provenance import identity

ELLIPSE = Ellipse(centre=(0.0, -0.072), radii=(0.02, 0.008), frequency=2.0, ramp=0.25)


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
    path = ELLIPSE
    shipped = Scenario.load("classic-ellipse", ["limits={}"])
    plain = Scenario(leg=FiveBar(name="classic"), path=path)
    assert msgspec.structs.replace(plain, name=shipped.name) == shipped
    assert Scenario(leg=FiveBar(), path=path, controller=Pd()).controller_name == "pd"
    table = plain.table()
    assert Scenario.from_table(table, "again", Path()) == plain


GAIT = Gait(centre=(0.0, -0.075), stride=0.04, lift=0.012, frequency=1.5, ramp=0.25)
HOP = Hop(low=0.055, high=0.085, frequency=2.0, thrust=0.15, flight=0.25)

UNFIT: list[tuple[dict[str, Any], str]] = [
    ({"leg": "classic"}, r"Scenario: leg must be a FiveBar, got 'classic'"),
    ({"path": None}, r"Scenario: path must be a FootPath, got None"),
    ({"servo": "xl330"}, r"Scenario: servo must be a Servo, got 'xl330'"),
    ({"name": "a/b"}, r"Scenario: name must be a plain file name"),
    ({"duration": -1.0}, r"Scenario: duration must be in \(0, inf\) s, got -1.0"),
    ({"duration": 0.5}, r"duration must be longer than the ramp of 0.25 s and one period"),
    ({"servo": Servo(rate=1500.0)}, r"servo\.rate must be"),
    ({"force": Constant(value=(0.0, 1.0))}, r"\[force\] has no effect in scene 'air'"),
    ({"limits": {"tracking.rmss": 1e-3}}, r"unknown key 'tracking.rmss'.*did you mean"),
    ({"limits": {"tracking.rms": (2.0, 1.0)}}, r"limits.tracking.rms must be an upper bound or"),
    ({"limits": {"ground.slip": 1.0}}, r"limits.ground.slip needs a ground"),
    ({"limits": {"load.heat.A": 1.0}}, r"limits.load.heat.A needs servo.kt"),
    ({"path": HOP}, r"needs a ground"),
    ({"scene": Treadmill(mass=0.5), "path": ELLIPSE}, r"scene.speed is missing"),
]


@pytest.mark.parametrize(("changed", "message"), UNFIT)
def test_what_does_not_fit_is_refused_in_python_too(changed: dict[str, Any], message: str) -> None:
    """As in a file; and where a part of a legal scenario is replaced."""
    legal = Scenario(leg=FiveBar(), path=GAIT)
    with pytest.raises(ConfigError, match=message):
        Scenario(**{"leg": FiveBar(), "path": GAIT, **changed})
    with pytest.raises(ConfigError, match=message):
        msgspec.structs.replace(legal, **changed)


def test_belt_and_limits_are_filled_in_as_in_a_file() -> None:
    limits: Any = {"tracking.rms": 1e-3, "load.share_A": (0.4, 0.6)}
    built = Scenario(leg=FiveBar(), path=GAIT, scene=Treadmill(mass=0.5), limits=limits)
    assert isinstance(built.scene, Treadmill)
    assert built.scene.speed == GAIT.stance_speed
    assert built.limits == {"tracking.rms": (-np.inf, 1e-3), "load.share_A": (0.4, 0.6)}


def test_repr_of_a_scenario_makes_the_scenario() -> None:
    names: dict[str, Any] = {"Scenario": Scenario, "FiveBar": FiveBar, "inf": np.inf}
    names |= {"Ellipse": Ellipse, "Gait": Gait, "Treadmill": Treadmill, "Servo": Servo}
    assert repr(Scenario(leg=FiveBar(), path=GAIT)) == f"Scenario(leg=FiveBar(), path={GAIT!r})"
    built = Scenario(leg=FiveBar(), path=ELLIPSE, servo=Servo(kp=4.0), duration=2.0)
    for each in (built, Scenario.load("classic-ellipse")):
        assert eval(repr(each), names) == each
        assert len(repr(each)) < 500


def test_html_of_a_leg_has_its_picture_and_its_numbers() -> None:
    for preset in sorted(resources.shipped("models/legs")):
        leg = FiveBar.load(preset)
        page = leg._repr_html_()
        # The chain of E ends at C, that of A at the foot where it is farther.
        chains = [d for d in re.findall(r'stroke-linecap="round" d="M([^"]*)"', page)]
        assert [d.count("L") for d in chains] == [2 + (leg.L6 > 0.0), 2]
        numbers = [
            float(x) for d in re.findall(r' d="M([^"]*)"', page) for x in re.split("[L ]", d)
        ]
        width, height = map(float, re.findall(r'viewBox="0 0 (\S+) (\S+)"', page)[0])
        assert min(numbers) >= 0.0
        assert max(numbers) <= max(width, height)
        rows = dict(re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td></tr>", page))
        assert ("L6" in rows) == (leg.L6 > 0.0)
    assert "<td>L1</td><td>40 mm</td>" in FiveBar()._repr_html_()


def test_html_of_a_scenario_has_its_path_and_limits_with_units() -> None:
    shown = Scenario.load("classic-ellipse", ["name=a&b", "leg.L2=0.065", "limits={}"])
    limits: Any = {"tracking.rms": 1.3e-3, "load.share_A": (0.4, 0.6)}
    page = msgspec.structs.replace(shown, limits=limits)._repr_html_()
    assert "<p>a&amp;b: classic leg, L2 = 65 mm</p>" in page
    rows = dict(re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td></tr>", page))
    assert rows["path"] == "ellipse"
    assert rows["limit: tracking RMS"] == "&lt;= 1.3 mm"
    assert rows["limit: load share A"] == "40 to 60 %"
    assert page.count("<path") == len(leg_lines.edges(shown.leg)) + 1 + 2
    # A robot's is that of one of its legs.
    assert "robot q8bot" in Scenario.load("robot-q8bot-trot")._repr_html_()


def test_html_of_a_comparison_is_the_table_of_ci(result: Result) -> None:
    page = comparison.compare(result, None)._repr_html_()
    assert "<p>a&amp;b: " in page
    (row,) = re.findall(r"<tr><td>tracking max</td>(.*?)</tr>", page)
    assert row.endswith("<td>FAIL</td>")
    assert "<td>&lt;= 1 nm</td>" in row


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
    drawn = result.plot("torque-speed")
    assert isinstance(drawn, Figure)
    # What IPython asks for.
    assert vars(drawn)["_repr_png_"]().startswith(b"\x89PNG")
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


class ViewerOfNotebooks:
    """Stands in for Rerun's: keeps what it is sent."""

    def __init__(self, *, recording: Any, width: str, height: int) -> None:
        import rerun_bindings

        assert (width, height) == ("auto", inline.HEIGHT)
        self.sent: list[bytes] = []
        self.seen = 0
        rerun_bindings.set_callback_sink(recording=recording.to_native(), callback=self.sent.append)

    def display(self) -> None:
        """Show what came so far."""
        self.seen = sum(map(len, self.sent))


def test_replay_is_below_the_cell_where_a_notebook_can_show_it(
    result: Result, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from rerun import notebook as of_rerun
    from rerun_bindings import RrdReaderInternal

    made: list[ViewerOfNotebooks] = []

    def make(**how: Any) -> ViewerOfNotebooks:
        made.append(ViewerOfNotebooks(**how))
        return made[-1]

    monkeypatch.setattr(of_rerun, "Viewer", make)
    monkeypatch.setattr(inline, "fits", lambda: True)
    result.replay()
    (viewer,) = made
    assert viewer.seen == sum(map(len, viewer.sent)) > 10_000
    chunks = []
    # Each is a whole file, the first of them the layout's.
    for k, part in enumerate(viewer.sent):
        file = tmp_path / f"{k}.rrd"
        file.write_bytes(part)
        reader = RrdReaderInternal(str(file))
        chunks += [c for each in reader.store_entries() for c in reader.stream(store=each)]
    (whose,) = [c for c in chunks if c.entity_path == f"/__properties/{PROPERTY}"]
    told = whose.to_record_batch()["sha256"].to_pylist()[0][0]
    assert told == identity(result)


@pytest.mark.parametrize("installed", [True, False])
def test_only_notebooks_with_the_viewer_show_recordings(
    installed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inline, "find_spec", lambda name: name if installed else None)
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    assert not inline.fits()

    of_terminal = SimpleNamespace()
    of_notebook = SimpleNamespace(kernel=1)
    for shell in (None, of_terminal, of_notebook):
        ipython = SimpleNamespace(get_ipython=lambda shell=shell: shell)
        monkeypatch.setitem(sys.modules, "IPython", ipython)  # pyright: ignore[reportArgumentType]
        assert inline.fits() == (installed and shell is of_notebook)
