"""Sweeps, searches, robots and certified programs damaged in any way: the law of fuzz.py."""

from __future__ import annotations

import functools
import shutil
import tempfile
from pathlib import Path

import fuzz_inputs as inputs
import pytest
from fuzz import LINE, Bench, Law, both_forms
from hypothesis import strategies as st
from shell import JUDGED

from fivebar_sim import cli
from fivebar_sim.certify import dialogue, suite
from fivebar_sim.files import resources

TASK = """
leg = "classic"
samples = 8
servo = "hobby-9g"
objectives = ["torque_peak", "size"]
[vary]
leg.L1 = [0.03, 0.05]
leg.L2 = [0.04, 0.07]
[motion.swing.path]
kind = "ellipse"
centre = [0.0, -0.075]
radii = [0.01, 0.008]
frequency = 2.0
[constraints]
singular = 0.1
[search]
method = "grid"
points = 6
best = 1
"""
ROBOT = """
robot = "robot.toml"
scene = "floor"
duration = 0.1
[path]
kind = "step"
start = [0.0, -0.04336]
stop = [0.0, -0.04336]
lift = 0.0
seconds = 0.1
ramp = 0.05
[controller]
name = "servo"
[limits]
robot.falls = 0
"""
Q8BOT = resources.shipped("models/robots")["q8bot"].read_bytes()
SWEEP = ["sweep", "short.toml", "--vary", "leg.L2=0.065", "--out", "out", "--quiet"]
DESIGN = ["design", "mine.toml", "--out", "out", "--simulate=0", "--tolerance=0", "--quiet"]
LEG = suite.load()[0]
LEG = LEG._replace(cases=LEG.cases[::20])
"""A leg of the conformance suite, with a few of its questions."""


@pytest.fixture
def bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Bench:
    _write(tmp_path)
    return Bench(tmp_path, monkeypatch, capfd)


def _write(folder: Path) -> None:
    (folder / "short.toml").write_text(JUDGED.replace("0.6", "0.36"), encoding="utf-8")
    (folder / "mine.toml").write_text(TASK, encoding="utf-8")
    (folder / "robot.toml").write_bytes(Q8BOT)
    (folder / "walks.toml").write_text(ROBOT, encoding="utf-8")


@functools.cache
def sound(*command: str) -> dict[str, bytes]:
    """Return the files that a command leaves, and of tables again those of its blocks."""
    with tempfile.TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        folder = Path(name)
        _write(folder)
        patch.chdir(folder)
        assert cli.main(command) == 0
        files = {path.name: path.read_bytes() for path in (folder / "out").iterdir()
                 if path.is_file()}  # fmt: skip
    kept = ("sweep.json", "runs.parquet", "state.json", "front.parquet")
    return {name: content for name, content in files.items() if name in kept} | {
        "blocks/00000000.parquet": files.get("runs.parquet", b""),
        "blocks/000000.parquet": files.get("designs.parquet", b""),
    }


Pair = tuple[str, bytes]


@st.composite
def damaged(draw: st.DrawFn, command: list[str], names: tuple[str, ...]) -> Pair:
    """Return a file of what a command leaves, and what may be in it."""
    name = draw(st.sampled_from(names))
    content = sound(*command)[name]
    some = inputs.jsons(content) if name.endswith("json") else inputs.mutated(content)
    return name, draw(some)


def _go_on(bench: Bench, command: list[str], damage: Pair | None, table: str) -> None:
    """Let a command go on where a file of it is damaged; None is no damage."""
    name, content = damage or (table, sound(*command)[table])
    place = bench.folder / "out"
    shutil.rmtree(place, ignore_errors=True)
    for each, own in sound(*command).items():
        in_blocks = each.startswith("blocks/")
        # A study whose table is there has no blocks.
        if own and (in_blocks == name.startswith("blocks/") or not each.endswith(table)):
            (place / each).parent.mkdir(parents=True, exist_ok=True)
            (place / each).write_bytes(own)
    if name.startswith("blocks/") and (place / "state.json").exists():
        state = (place / "state.json").read_text("utf-8").replace("true", "false")
        (place / "state.json").write_text(state, encoding="utf-8")
    (place / name).write_bytes(content)
    bench.lawful(*command)


def any_sweep(bench: Bench, damage: Pair | None) -> None:
    _go_on(bench, SWEEP, damage, "runs.parquet")


def any_search(bench: Bench, damage: Pair | None) -> None:
    _go_on(bench, DESIGN, damage, "front.parquet")


def any_task(bench: Bench, content: bytes) -> None:
    (bench.folder / "mine.toml").write_bytes(content)
    shutil.rmtree(bench.folder / "out", ignore_errors=True)
    bench.lawful(*DESIGN)


def any_robot(bench: Bench, damage: Pair) -> None:
    name, content = damage
    _write(bench.folder)
    (bench.folder / name).write_bytes(content)
    shutil.rmtree(bench.folder / "out", ignore_errors=True)
    said = bench.lawful("run", "walks.toml", "--out", "out", "--quiet")
    assert (bench.folder / "out").exists() == (said.status < 2 and not said.err)


def any_answers(bench: Bench, content: bytes) -> None:
    lines = content.decode(errors="replace").splitlines()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suite, "load", lambda: [LEG])
        patch.setattr(dialogue, "ask", lambda *args: dialogue.Said(lines, "", ""))
        said = bench.lawful("certify", "mine")
    assert said.err == ""
    assert all(len(line) <= LINE for line in said.out.splitlines())


@st.composite
def tasks(draw: st.DrawFn) -> bytes:
    """Return what may be a design task."""
    return draw(_texts(TASK))


def _texts(text: str) -> inputs.Strategy:
    """Return a strategy for what may be a TOML file: its numbers changed, or its text."""
    return st.one_of(inputs.tomls(text), inputs.mutated(text.encode()))


@st.composite
def answers(draw: st.DrawFn) -> bytes:
    """Return what a program may answer: right answers with some words exchanged, or as bytes."""
    precision = draw(st.sampled_from(suite.PRECISIONS))
    right = [["ok", *map(repr, case.answer)] if case.answer else ["unreachable"]
             for case in LEG.cases]  # fmt: skip
    lines = [[precision], ["ok"], *right]
    for _ in range(draw(st.integers(0, 3))):
        words = lines[draw(st.integers(0, len(lines) - 1))]
        words[draw(st.integers(0, len(words) - 1))] = draw(inputs.cells)
    text = "\n".join(" ".join(words) for words in lines).encode()
    return draw(inputs.mutated(text)) if draw(st.booleans()) else text


SWEEPS = damaged(SWEEP, ("sweep.json", "runs.parquet", "blocks/00000000.parquet"))
SEARCHES = damaged(DESIGN, ("state.json", "front.parquet", "blocks/000000.parquet"))
ROBOTS = st.one_of(
    _texts(ROBOT).map(lambda content: ("walks.toml", content)),
    _texts(Q8BOT.decode()).map(lambda content: ("robot.toml", content)),
)
LAWS = {
    "sweeps": Law(None, SWEEPS, any_sweep, 7, 0.01),
    "searches": Law(None, SEARCHES, any_search, 7, 0.01),
    "tasks": Law(TASK.encode(), tasks(), any_task, 6, 0.02),
    "robots": Law(("robot.toml", Q8BOT), ROBOTS, any_robot, 3, 0.02),
    "answers": Law(b"float64", answers(), any_answers, 9, 0.01),
}


test_few_inputs_keep_the_law, test_many_inputs_keep_the_law = both_forms(LAWS)
