"""The report of a run and the comparison of several: what is on the page, and what is refused."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from reports import Page, drawn_once, two_figures, unfitted, unrecorded
from sealed import seal
from shell import Shell

from fivebar_sim import report, rollout
from fivebar_sim.errors import ArgumentError, RunDirectoryError
from fivebar_sim.files import tables
from fivebar_sim.metrics import judge, look_up
from fivebar_sim.metrics.catalogue import LISTED, SHOWN, shown
from fivebar_sim.metrics.limits import bounds, has
from fivebar_sim.report import comparison, look, single
from fivebar_sim.runs import directory, stored
from fivebar_sim.scenario import Scenario

AIR = [
    *("foot-path", "leg-moments", "tracking-error", "error-parts", "torque", "angles"),
    *("speeds", "power", "torque-speed", "load-share", "loop-gap"),
]
GROUNDED = [*AIR[:-1], "ground", "loop-gap"]
OVERLAID = ["foot-path", "torque", "tracking-error", "loop-gap", "load-share", "ground"]
APART = ("verdict", "limits", "guards", "provenance")
MISSING = object()
LIMITED = "_odd $a$ & <b>"
EVIL = "<script>alert('1')</script> &amp; $x$"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return run directories: in the air limited and failing, of an odd name; on the ground."""
    folder = tmp_path_factory.mktemp("runs")
    asked = {
        LIMITED: (
            "classic-ellipse",
            ["duration=0.8", "servo.limit=0.00283", "limits.tracking.rms=1e-9"],
        ),
        "trot": (
            "treadmill-trot",
            ["duration=0.7", "path.ramp=0.1", "limits={tracking={rms=1e-3}}"],
        ),
    }
    for name, (scenario, settings) in asked.items():
        loaded = Scenario.load(scenario, [*settings, f'leg.name="{EVIL}"'])
        with unrecorded():
            rollout.run(loaded).write(folder / name)
    return {name: folder / name for name in asked}


@pytest.fixture(scope="module")
def pages(runs: dict[str, Path]) -> dict[str, Page]:
    """Return the pages of all runs, and that of them together as "all"."""
    # A limit of the torque is a line of its own in these.
    with unfitted():
        with drawn_once(but=("torque", "torque-speed")):
            places = {name: report.write([runs[name]])[-1] for name in ("trot", LIMITED)}
        together = report.write(list(runs.values()), runs["trot"].parent / "all.html")[-1]
    return {name: Page(place) for name, place in {**places, "all": together}.items()}


def test_a_page_is_whole_and_says_its_verdict(
    runs: dict[str, Path], pages: dict[str, Page]
) -> None:
    for name, path in runs.items():
        run = stored.read(path)
        page = pages[name]
        assert page.all("html")[0].attributes["lang"] == "en"
        assert page.all("title")[0].text == [f"{run.scenario.name}: {run.metrics['verdict']}"]
        (word,) = (e for e in page.all("span") if "verdict" in e.attributes.get("class", ""))
        assert word.text == [run.metrics["verdict"].upper()]
        assert page.ids("figure") == (GROUNDED if name == "trot" else AIR)
    assert pages[LIMITED].all("title")[0].text == ["classic-ellipse: fail"]
    assert "treadmill-trot: pass" in pages["trot"].all("title")[0].text


def test_figures_have_alternatives_and_captions(pages: dict[str, Page]) -> None:
    for page in pages.values():
        drawn = len(page.ids("figure"))
        assert len(page.all("svg")) == len(page.all("figcaption")) == drawn
        for svg in page.all("svg"):
            assert svg.attributes["role"] == "img"
            assert len(svg.attributes["aria-label"]) > 30
            assert len("".join(svg.text)) > 20  # ticks and labels are letters, not shapes


def test_every_limit_is_there_with_value_and_verdict(
    runs: dict[str, Path], pages: dict[str, Page]
) -> None:
    seen = set()
    for name, path in runs.items():
        run = stored.read(path)
        rows = pages[name].rows()
        for limit in judge(run.metrics, run.scenario.limits):
            word = "pass" if limit.ok else "FAIL"
            seen.add(word)
            row = [SHOWN[limit.key][0], bounds(limit), shown(limit.key, limit.value), word]
            assert row in rows
    assert seen == {"pass", "FAIL"}


@pytest.mark.parametrize("lost", [[], ["torque"]])
def test_guards_are_folded_to_a_line_and_open_if_one_trips(
    runs: dict[str, Path], tmp_path: Path, lost: list[str]
) -> None:
    """Each has a sentence with its bound, and its worst value with a unit."""
    run = stored.read(runs["trot"])
    guards = [
        replace(guard, ok=guard.name not in lost, time=0.3 if guard.name in lost else None)
        for guard in run.measured.guards
    ]
    run = run._replace(measured=replace(run.measured, guards=guards))
    with look.project_style():
        (tmp_path / "page.html").write_text(single.page(run, []), encoding="utf-8")
    page = Page(tmp_path / "page.html")

    said = f"1 of {len(guards)} tripped: torque" if lost else f"all {len(guards)} hold"
    assert page.all("summary")[0].text == [f"Guards: {said}"]
    assert ("open" in page.all("details")[0].attributes) == bool(lost)
    for guard in guards:
        (row,) = (row for row in page.rows() if row[0].startswith(f"{guard.name}: "))
        assert len(row[0].split()) > 4
        assert re.fullmatch(r"undefined|[\d.e-]+ (mm|deg|N|%|flips|steps)", row[1])
        assert row[2] == ("pass" if guard.ok else "FAIL")
    sentence = "torque: a motor's torque had been clipped for more than 50 % of a second"
    assert any(row[0] == sentence for row in page.rows())
    assert "Guard(" not in page.source


def test_every_metric_is_in_the_table(runs: dict[str, Path], pages: dict[str, Page]) -> None:
    for name, path in runs.items():
        metrics = json.loads((path / "metrics.json").read_text())
        by_key = {row[3]: row for row in pages[name].rows() if len(row) == 4}
        for key, _ in tables.flat({k: metrics[k] for k in metrics if k not in APART}):
            if key in SHOWN:
                value = shown(key, look_up(metrics, key))
                assert by_key[key][:2] == [SHOWN[key][0], value]
            elif not key.startswith("load.phase."):
                assert key in by_key
                assert by_key[key][0].strip(", ") != ""
    rows = pages["trot"].rows()
    assert len([row for row in rows if re.fullmatch(r"[\d.]+ to [\d.]+ %", row[0])]) == 8


def test_what_was_run_can_be_run_again(runs: dict[str, Path], pages: dict[str, Page]) -> None:
    for name, path in runs.items():
        command, scenario = ("".join(pre.text) for pre in pages[name].all("pre"))
        assert scenario == (path / "scenario.toml").read_text(encoding="utf-8")
        assert shlex.split(command) == ["fivebar", "run", f"{name}/scenario.toml"]
        provenance = stored.read(path).metrics["provenance"]
        assert ["mujoco", provenance["mujoco"]] in pages[name].rows()


def test_nothing_is_loaded_run_or_let_through(pages: dict[str, Page]) -> None:
    for name, page in pages.items():
        assert not page.all("script")
        assert (EVIL in "".join(page.all("header")[0].text)) == (name != "all")
        ids = [e.attributes["id"] for e in page.elements if "id" in e.attributes]
        assert len(ids) == len(set(ids))
        for element in page.elements:
            for key, value in element.attributes.items():
                assert not key.startswith("on")
                assert "//" not in value
                for target in re.findall(r"url\((.*?)\)", value):
                    assert target.removeprefix("#") in ids
            link = element.attributes.get("href", "#")
            assert link == "#" or link.removeprefix("#") in ids
        assert "default-src 'none'" in page.source
        assert "@import" not in page.source


def test_comparison_tells_runs_apart(runs: dict[str, Path], pages: dict[str, Page]) -> None:
    page = pages["all"]
    rows = pages["all"].rows()
    assert page.ids("figure") == OVERLAID
    # what was changed comes before what came of it
    assert page.all("h2")[0].text == ["What differs in the scenarios"]
    assert rows[0] == ["key", *runs]
    start = rows.index(["metric", *runs])
    assert rows[start + 1] == ["verdict", "FAIL", "pass"]
    for svg in page.all("svg"):
        assert set(runs) <= {text.strip() for text in svg.text}
    read = [stored.read(path) for path in runs.values()]
    for key in LISTED:
        label = SHOWN[key][0]
        named = [row for row in rows if row[0] == label]
        if not any(has(run.metrics, key) for run in read):
            assert named == []
            continue
        (row,) = named
        for cell, run in zip(row[1:], read, strict=True):
            grounded = "ground" in run.metrics
            if key.startswith("ground") and not grounded:
                assert cell == ""
            else:
                assert cell.startswith(shown(key, look_up(run.metrics, key)))
                if run is not read[0] and not key.startswith("ground"):
                    assert comparison.difference(key, run, read[0]) in cell
    differing = {row[0]: row[1:] for row in rows}
    assert differing["servo.limit"] == ["0.00283", "-"]
    assert differing["path.kind"] == ["ellipse", "gait"]
    assert "path.ramp" in differing
    assert "sim.timestep" not in differing


OWN_STYLE: Any = {"svg.hashsalt": None, "xtick.major.size": 20.0, "font.size": 20}
"""What a user's matplotlibrc may say."""


def test_same_runs_same_bytes(
    runs: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two figures, on the page and as pictures: the others are drawn like these."""
    import matplotlib

    monkeypatch.setattr(single, "figures", two_figures)
    kept = []
    plain: Any = {}
    for style in (plain, OWN_STYLE):
        with matplotlib.rc_context(style):
            files = report.write([runs["trot"]], tmp_path / "a.html", tmp_path / "png")
        assert [file.name for file in files] == ["foot-path.png", "tracking-error.png", "a.html"]
        kept.append([file.read_bytes() for file in files])
    assert kept[0] == kept[1]
    assert all(picture.startswith(b"\x89PNG") for picture in kept[0][:2])


@pytest.mark.usefixtures("pages")
def test_a_run_directory_with_its_report_stays_one(runs: dict[str, Path], tmp_path: Path) -> None:
    run = shutil.copytree(runs["trot"], tmp_path / "run")
    assert (run / "report.html").is_file()
    assert directory.is_run(run)
    directory.check_place(run)
    with unrecorded():
        rollout.run(stored.read(run).scenario).write(run)
    # it was of the run before
    assert not (run / "report.html").exists()


def test_the_command_writes_a_report_anew_where_there_was_one(
    runs: dict[str, Path], shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(single, "figures", lambda run: [])  # that it is of the new run is enough
    run = shutil.copytree(runs[LIMITED], shell.folder / "mine")
    (run / "report.html").write_text("of the old run")
    # A motor that clips is slow to simulate, and nothing here asks for it.
    again = (
        *("run", "mine/scenario.toml", "--quiet"),
        *("--set", "path.frequency=3.0", "--set", "servo.limit=0.5"),
    )
    assert shell(*again, "--out", "mine").status in (0, 1)
    assert "frequency = 3.0" in (run / "report.html").read_text()
    assert shell(*again, "--out", "other").status in (0, 1)
    assert not (shell.folder / "other/report.html").exists()


def test_command_says_where(
    runs: dict[str, Path], shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(look, "png", lambda figure: b"")  # pictures: test_same_runs_same_bytes
    monkeypatch.setattr(look, "svg", lambda figure, key, alt: "<svg></svg>")
    monkeypatch.setattr(single, "figures", two_figures)
    run = shutil.copytree(runs[LIMITED], shell.folder / "mine")
    assert shell("report", "mine") == (0, "report of 1 run in mine/report.html\n", "")
    assert (run / "report.html").stat().st_mode & 0o777 == 0o644
    (shell.folder / "old.html").write_text("someone's")
    said = shell("report", "mine", str(runs["trot"]), "--png", "new/png", "--out", "old.html")
    assert said == (0, "report of 2 runs in old.html, 6 figures in new/png\n", "")
    assert (shell.folder / "old.html").read_text().startswith("<!DOCTYPE html>")
    assert {path.name for path in (shell.folder / "new/png").iterdir()} == {
        f"{key}.png" for key in OVERLAID
    }
    assert not [path for path in shell.folder.rglob("*") if path.suffix == ".partial"]
    assert report.place_of([run, run]) == Path("comparison.html")


def test_refusals_are_one_line(
    runs: dict[str, Path], shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(single, "page", lambda run, drawn: "")  # what nobody sees is not drawn
    monkeypatch.setattr(single, "figures", two_figures)
    monkeypatch.setattr(look, "png", lambda figure: b"")
    shutil.copytree(runs[LIMITED], shell.folder / "mine")
    (shell.folder / "d.html").mkdir()
    (shell.folder / "file").write_text("x")
    assert shell.refused("report", "no") == "no is not a run directory: no such directory"
    assert "a.txt: a report must end in .html" in shell.refused("report", "mine", "--out", "a.txt")
    assert "a directory is there" in shell.refused("report", "mine", "--out", "d.html")
    assert "cannot write file/a.html" in shell.refused("report", "mine", "--out", "file/a.html")
    assert "cannot write file/foot-path.png" in shell.refused("report", "mine", "--png", "file")
    assert shell.refused("report", "mine", "d.html/../mine").endswith("mine is given twice")
    assert shell("report").status == 2


def _with(key: str, value: object) -> Callable[[Path], object]:
    """Return what sets a key of metrics.json; MISSING takes it away."""

    def change(run: Path) -> None:
        file = run / "metrics.json"
        table = metrics = json.loads(file.read_text())
        *parts, last = key.split(".")
        for part in parts:
            table = table[part]
        table.pop(last)
        if value is not MISSING:
            table[last] = value
        file.write_text(json.dumps(metrics))
        seal(run)

    return change


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (
            lambda run: (run / "rollout.parquet").write_bytes(b"PAR1"),
            "rollout.parquet is not a record",
        ),
        (lambda run: (run / "scenario.toml").unlink(), "it lacks scenario.toml"),
        (_with("load.torque_rms.E", MISSING), "metrics.json: load.torque_rms.E is missing"),
        (_with("ground", MISSING), "metrics.json: a run of this scene lacks the key ground"),
    ],
)
def test_damage_is_refused(
    runs: dict[str, Path], tmp_path: Path, damage: Callable[[Path], object], said: str
) -> None:
    run = shutil.copytree(runs["trot"], tmp_path / "run")
    (run / "report.html").unlink(missing_ok=True)
    damage(run)
    with pytest.raises(RunDirectoryError) as caught:
        report.write([run])
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (run / "report.html").exists()


def test_too_many_or_no_runs() -> None:
    with pytest.raises(ArgumentError, match="a report needs 1 to 32 runs, got 0"):
        report.write([])
    with pytest.raises(ArgumentError, match="got 33"):
        report.write([Path(str(k)) for k in range(33)])
