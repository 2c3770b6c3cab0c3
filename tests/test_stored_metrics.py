"""metrics.json read back: what no run says is refused in one line, by every command that reads."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from sealed import seal
from shell import Shell

from fivebar_sim import rollout
from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.files import input_file
from fivebar_sim.rollout import Result
from fivebar_sim.runs import stored_metrics
from fivebar_sim.scenario import Scenario, scenes


class Kept(NamedTuple):
    """What a run's metrics.json says, and whether its scene has a ground."""

    text: str
    grounded: bool


@pytest.fixture(scope="module")
def kept() -> list[Kept]:
    sources = [("classic-ellipse", 0.75), ("q8bot-trot", 2.1), ("rail-landing", 0.8)]
    runs = [rollout.run(Scenario.load(name, [f"duration={t}"])) for name, t in sources]
    return [
        Kept(json.dumps(run.metrics), isinstance(run.scenario.scene, scenes.Ground)) for run in runs
    ]


def _saved(folder: Path, content: Any) -> Path:
    file = folder / "metrics.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content))
    return file


class Place(NamedTuple):
    """Where something is: its table or list, the key there, and all keys on the way to it."""

    holder: Any
    key: Any
    path: str


def _places(value: Any, path: str = "") -> list[Place]:
    """Return the places of everything at any depth; of lists the first and the last."""
    if not isinstance(value, (dict, list)):
        return []
    pairs = list(value.items()) if isinstance(value, dict) else list(enumerate(value))
    if isinstance(value, list):
        pairs = [*pairs[:1], *pairs[1:][-1:]]
    found = []
    for key, inner in pairs:
        below = f"{path}.{key}"
        found += [Place(value, key, below), *_places(inner, below)]
    return found


def test_what_a_run_writes_is_read(kept: list[Kept], tmp_path: Path) -> None:
    for text, grounded in kept:
        read = stored_metrics.read(_saved(tmp_path, text), grounded=grounded)
        assert read.table == json.loads(text)
        assert json.dumps(read.table) == text  # in the same order too


def test_everything_is_needed_and_nothing_else_is_known(
    kept: list[Kept], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every key of every table, taken away or exchanged for what is nothing, is missed.

    Of later runs those that no earlier one of the same kind had. What a file holds is handed over:
    to write and parse it all takes ten times as long as to check it.
    """
    file = tmp_path / "metrics.json"
    tried = set()
    for text, grounded in kept:
        metrics = json.loads(text)
        monkeypatch.setattr(input_file, "read_json", lambda path, held=metrics: held)
        for number, (holder, key, path) in enumerate(_places(metrics)):
            if (grounded, path) in tried:
                continue
            tried.add((grounded, path))
            table = type(holder) is dict
            said_of = table and "mujoco" in holder
            sound = holder[key]
            for value in (None, *in_turn(number)):
                if said_of or (key == "provenance" and value == {"x": 1}):
                    continue  # provenance may say anything
                if (key, value) in (
                    ("ok", True),
                    ("stance", None),
                    ("phase", None),
                    ("part", None),
                ):
                    continue  # so it may be
                if value is None and not table:
                    continue  # undefined in this bin
                holder[key] = value
                if value is None:
                    del holder[key]
                with pytest.raises(RunDirectoryError, match=r"metrics.json: .*\S"):
                    stored_metrics.read(file, grounded=grounded)
            holder[key] = sound
        assert metrics == json.loads(text)


NOTHING = ({"x": 1}, [[]], True, "\x1b[31m", -1e300, float("nan"))


def in_turn(number: int) -> tuple[Any, ...]:
    """Return two of all values that are nothing: of three keys in a row each has others."""
    first = 2 * number % len(NOTHING)
    return NOTHING[first : first + 2]


def _guard(**changes: Any) -> Callable[[Any], object]:
    return lambda metrics: metrics["guards"][1].update(changes)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda m: m["guards"][1].pop("ok"),
            "guards[1].ok is missing: run its scenario.toml again",
        ),
        (lambda m: m.pop("guards"), "guards is missing: run its scenario.toml again"),
        (lambda m: m.pop("provenance"), "provenance is missing: run its scenario.toml again"),
        (_guard(ok=False), "guards[1]: ok must be true with time None"),
        (_guard(name="loo"), "guards[1]: unknown guard 'loo'; known: "),
        (_guard(high="x"), "guards[1].high must be a number, got 'x'"),
        (
            lambda m: m["load"].update(share_A=1.5),
            "load.share_A must be a number <= 1.0, got 1",
        ),
        (lambda m: m.update(tracking=3), "tracking must be a table, got 3"),
        (
            lambda m: m.update(verdict="PASS"),
            "verdict must be one of 'pass', 'fail', 'not judged', got 'PASS'",
        ),
        (lambda m: m.update(more=1), "unknown key more"),
        (lambda m: m.update(ground={}), "ground.force_max is missing"),
        (
            lambda m: m["closure"].update(rms="big"),
            "closure.rms must be a number or null, got 'big'",
        ),
        (
            lambda m: m["closure"].update(rms=1e300),
            "closure.rms must be a number <= 1e+100",
        ),
    ],
)
def test_refusals_name_file_key_and_what_is_legal(
    kept: list[Kept], tmp_path: Path, change: Callable[[Any], object], said: str
) -> None:
    metrics = json.loads(kept[0].text)
    change(metrics)
    file = _saved(tmp_path, metrics)
    with pytest.raises(RunDirectoryError) as caught:
        stored_metrics.read(file, grounded=False)
    assert str(caught.value).startswith(f"{file}: {said}")


def test_metrics_of_another_scene_are_refused(kept: list[Kept], tmp_path: Path) -> None:
    for (text, grounded), said in ((kept[0], "lacks"), (kept[2], "must not have")):
        with pytest.raises(RunDirectoryError, match=f"a run of this scene {said} the key ground$"):
            stored_metrics.read(_saved(tmp_path, text), grounded=not grounded)


def test_every_reader_refuses_alike(shell: Shell) -> None:
    assert shell("run", "short.toml", "--quiet", "--out", "mine").status == 0
    shutil.copytree("mine", "other")
    metrics = json.loads(Path("mine/metrics.json").read_text())
    del metrics["guards"][0]["ok"]
    _saved(Path("mine"), metrics)
    seal(Path("mine"))
    commands = ["report mine", "report other mine", "replay mine", "replay other mine --web"]
    for command in [*commands, "render mine"]:
        said = shell.refused(*command.split())
        assert said.startswith("mine/metrics.json: guards[0].ok is missing")


def test_every_reader_refuses_metrics_that_were_made_better(shell: Shell) -> None:
    assert shell("run", "short.toml", "--quiet", "--out", "mine").status == 0
    shutil.copytree("mine", "other")
    metrics = json.loads(Path("mine/metrics.json").read_text())
    metrics["tracking"]["rms"] *= 0.5
    _saved(Path("mine"), metrics)
    commands = ["report mine", "report other mine", "replay mine", "replay other mine --web"]
    for command in [*commands, "render mine"]:
        said = shell.refused(*command.split())
        assert said.startswith("mine/metrics.json is not the run's: it was changed after the run")
    with pytest.raises(RunDirectoryError, match=r"metrics\.json is not the run's"):
        Result.read("mine")
