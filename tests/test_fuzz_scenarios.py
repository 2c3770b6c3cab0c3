"""Scenarios, settings, legs, servos, CSVs and baselines at random, against the law of fuzz.py."""

from __future__ import annotations

import tomllib
from pathlib import Path

import fuzz_inputs as inputs
import pytest
from fuzz import Bench, Law, both_forms
from shell import ELLIPSE, JUDGED

from fivebar_sim.files import resources
from fivebar_sim.runs import recording_file

CORPUS = Path(__file__).with_name("corpus")
EXPECTED: dict[str, str] = tomllib.loads((CORPUS / "expected.toml").read_text("utf-8"))
"""Part of the line on stderr for each file of the corpus, "" for one that runs."""
TROT = resources.folder("scenarios") / "q8bot_trot.csv"
BASELINE = (resources.folder("scenarios") / "baselines" / "classic-ellipse.json").read_bytes()
FOOT = b"time_s,x_mm,z_mm\n0,0,-80\n0.2,10,-75\n0.4,0,-70\n0.6,-10,-75\n1,0,-80\n"
FORCE = b"time_s,x_N,z_N\n0,0,0\n0.2,0.5,1\n# a comment\n0.4,0,-2.5\n2,0,0\n"
WITH_PARTS = ELLIPSE.replace(
    "duration = 0.6", 'duration = 0.6\nleg = "leg.toml"\nservo = "servo.toml"'
)
WITH_CSVS = """
duration = {duration}
[scene]
kind = "payload"
mass = 0.1
[path]
kind = "csv"
file = "foot.csv"
periodic = {periodic}
ramp = 0.1
[force]
kind = "csv"
file = "force.csv"
"""


@pytest.fixture
def bench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Bench:
    files = {
        "q8bot_trot.csv": TROT.read_bytes(),
        "foot.csv": FOOT,
        "force.csv": FORCE,
        "leg.toml": b"L1 = 0.045\nL2 = 0.06\n",
        "servo.toml": b"kp = 6.0\n",
        "short.toml": JUDGED.encode(),
        "parts.toml": WITH_PARTS.encode(),
        "cycle.toml": WITH_CSVS.format(periodic="true", duration=1.15).encode(),
        "once.toml": WITH_CSVS.format(periodic="false", duration=0.5).encode(),
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    return Bench(tmp_path, monkeypatch, capfd)


def any_scenario(bench: Bench, content: bytes) -> None:
    (bench.folder / "any.toml").write_bytes(content)
    bench.run("any.toml")


def any_settings(bench: Bench, words: list[str]) -> None:
    pairs = [part for word in words for part in ("--set", word)]
    bench.run("short.toml", *pairs)


def any_leg(bench: Bench, content: bytes) -> None:
    (bench.folder / "leg.toml").write_bytes(content)
    bench.run("parts.toml", "--set", "servo.preset=ideal")


def any_servo(bench: Bench, content: bytes) -> None:
    (bench.folder / "servo.toml").write_bytes(content)
    bench.run("parts.toml", "--set", "leg.preset=classic")


def any_path(bench: Bench, content: bytes) -> None:
    (bench.folder / "foot.csv").write_bytes(content)
    (bench.folder / "force.csv").write_bytes(FORCE)
    for name in ("cycle.toml", "once.toml"):
        bench.run(name)


def any_force(bench: Bench, content: bytes) -> None:
    (bench.folder / "foot.csv").write_bytes(FOOT)
    (bench.folder / "force.csv").write_bytes(content)
    bench.run("cycle.toml")


def any_baseline(bench: Bench, content: bytes) -> None:
    (bench.folder / "baselines").mkdir(exist_ok=True)
    (bench.folder / "baselines" / "short.json").write_bytes(content)
    said = bench.lawful("check", "short.toml", "--quiet", "--keep", "kept")
    assert said.out == ""
    assert (bench.folder / "baselines" / "short.json").read_bytes() == content
    if (bench.folder / "kept" / "short").exists():
        assert said.status == 1
        bench.clear(bench.folder / "kept" / "short")


LEGS = inputs.parts("models/legs", ("classic", "q8bot"))
SERVOS = inputs.parts("models/servos", ("ideal", "xl330"))
LAWS = {
    "scenarios": Law(ELLIPSE.encode(), inputs.scenarios(), any_scenario, 16, 0.35),
    "settings": Law(["leg.L2=0.065"], inputs.settings(), any_settings, 14, 0.15),
    "legs": Law(b"L1 = 0.045", LEGS, any_leg, 12, 0.1),
    "servos": Law(b"kp = 6.0", SERVOS, any_servo, 12, 0.1),
    "paths": Law(FOOT, inputs.csvs("time_s,x_mm,z_mm", FOOT), any_path, 9, 0.1),
    "forces": Law(FORCE, inputs.csvs("time_s,x_N,z_N", FORCE), any_force, 14, 0.05),
    "baselines": Law(BASELINE, inputs.jsons(BASELINE), any_baseline, 18, 0.05),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_inputs_that_once_broke_something(bench: Bench, name: str) -> None:
    kind = name.partition("/")[0]
    if kind == "recordings":
        assert not recording_file.is_readable(CORPUS / name)
        return
    LAWS[kind].holds(bench, (CORPUS / name).read_bytes())
    said = EXPECTED[name]
    assert (bench.last.status == 2) == bool(said)
    assert said in bench.last.err


def test_every_file_of_the_corpus_is_expected_to_do_something() -> None:
    there = {path.relative_to(CORPUS).as_posix() for path in CORPUS.glob("*/*")}
    assert there == set(EXPECTED)


test_few_inputs_keep_the_law, test_many_inputs_keep_the_law = both_forms(LAWS)
