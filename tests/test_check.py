"""The command `fivebar check`: changes turn it red, repeats never do, and what it leaves behind."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from shell import ELLIPSE, JUDGED, Shell
from shipped import results

from fivebar_sim import rollout
from fivebar_sim.runs import directory

BASELINE = Path("baselines/short.json")
FAST = ("classic-ellipse", "classic-figure-eight", "payload-ellipse", "q8bot-trot", "rail-hop")


pytestmark = pytest.mark.usefixtures("light")

MADE: list[bytes] = []
"""The baseline of short.toml, once it was made."""


@pytest.fixture
def recorded(shell: Shell) -> Shell:
    """A shell in a folder where short.toml has a baseline."""
    if not MADE:
        assert shell("check", "short.toml", "--update").status == 0
        MADE.append(BASELINE.read_bytes())
    BASELINE.parent.mkdir(exist_ok=True)
    BASELINE.write_bytes(MADE[0])
    return shell


# law


def test_update_records_and_says_so(shell: Shell) -> None:
    assert "note: short: no baseline: judged by its" in shell("check", "short.toml").out
    said = shell("check", "short.toml", "--update")
    assert (said.status, said.err) == (0, "")
    assert said.out.endswith(f"note: short: baseline recorded in {BASELINE}\n")
    first = BASELINE.read_bytes()
    again = shell("check", "short.toml", "--update")
    assert again.status == 0
    assert "recorded" not in again.out
    assert BASELINE.read_bytes() == first
    assert shell.names() == {"short.toml", "foot.csv", "baselines", str(BASELINE)}


def test_repeats_never_alarm_and_give_equal_files(recorded: Shell) -> None:
    outputs = []
    for i in range(3):
        said = recorded("check", "short.toml", "--junit", f"{i}.xml", "--summary", f"{i}.md")
        assert (said.status, said.err) == (0, "")
        outputs.append((said.out, Path(f"{i}.xml").read_bytes(), Path(f"{i}.md").read_bytes()))
    assert outputs == 3 * outputs[:1]
    assert "note" not in outputs[0][0]
    assert "runs" not in recorded.names()


def test_shipped_scenarios_pass_their_baselines_whole(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What comes of them is simulated once for all tests."""
    every = results()

    def known(plans: list[rollout.Plan], nthread: int = 1) -> list[rollout.Result]:
        return [every[plan.scenario.name] for plan in plans]

    monkeypatch.setattr(rollout, "run_all", known)
    before = shell.names()
    said = shell("check", *every)
    assert (said.status, said.err) == (0, "")
    assert shell.names() == before
    for name in every:
        assert f" {name} " in said.out
    assert "FAIL" not in said.out
    assert "no baseline" not in said.out
    assert "…" not in said.out


@pytest.mark.parametrize(
    ("fault", "row"),
    [
        ("servo.kd=0.055", "tracking RMS"),
        ("servo.kp=7.2", "tracking RMS"),
        ("servo.delay=0.001", "tracking RMS"),
        ("servo.limit=0.00283", "motor A saturated"),
        ("leg.L1=0.0404", "torque A RMS"),
        ("leg.L4=0.0396", "torque E RMS"),
        ("leg.L2=0.0606", "torque A RMS"),
        ("path.frequency=4.4", "tracking RMS"),
        ("path.radii=[0.02,0.0088]", "tracking RMS"),
        ("sim.integrator=implicitfast", "loop gap RMS (run)"),
        ("leg.armature=2e-5", "torque A RMS"),
    ],
)
def test_change_of_a_scenario_is_red(recorded: Shell, fault: str, row: str) -> None:
    said = recorded("check", "short.toml", "--set", fault)
    assert (said.status, said.err) == (1, "")
    assert f"FAIL: short: {row}: " in said.out


def test_improvement_is_told_and_no_failure(recorded: Shell) -> None:
    said = recorded("check", "short.toml", "--set", "servo.kd=0.049")
    assert said.status == 0
    assert "better" in said.out
    told = "note: short: better than its baseline: tracking RMS, tracking max; --update"
    assert told in said.out


def test_update_accepts_what_moved_and_shows_it(recorded: Shell) -> None:
    Path("short.toml").write_text(JUDGED + "[servo]\nkd = 0.06\n", encoding="utf-8")
    before = BASELINE.read_bytes()
    assert recorded("check", "short.toml", "--quiet").status == 1
    said = recorded("check", "short.toml", "--update")
    assert said.status == 0
    assert "FAIL" not in said.out
    line = next(line for line in said.out.splitlines() if line.startswith("  tracking RMS"))
    assert line.split()[-3].startswith("+")
    assert line.split()[-1] == "new"
    assert BASELINE.read_bytes() != before
    assert recorded("check", "short.toml", "--quiet").status == 0


def test_update_leaves_the_baseline_of_a_failed_run(recorded: Shell) -> None:
    before = BASELINE.read_bytes()
    limit = "[limits]\ntracking.rms = 1e-9\n"
    Path("short.toml").write_text(ELLIPSE + limit, encoding="utf-8")
    said = recorded("check", "short.toml", "--update")
    assert said.status == 1
    assert "note: short: its baseline is not updated: it failed" in said.out
    assert BASELINE.read_bytes() == before


def test_other_origin_is_told_and_no_failure(recorded: Shell) -> None:
    table = json.loads(BASELINE.read_text("utf-8"))
    table["made"] |= {"mujoco": "3.2.0", "platform": "Plan9 vax"}
    BASELINE.write_text(json.dumps(table), encoding="utf-8")
    said = recorded("check", "short.toml")
    assert said.status == 0
    assert "note: short: its baseline was made with mujoco 3.2.0, now 3" in said.out
    assert "; platform Plan9 vax, now " in said.out


def test_run_that_breaks_down_does_not_hide_the_others(recorded: Shell) -> None:
    wild = JUDGED.replace("short", "wild") + "[sim]\nintegrator='implicitfast'\ntimestep=0.02\n"
    Path("wild.toml").write_text(wild, encoding="utf-8")
    said = recorded("check", "wild.toml", "short.toml", "--junit", "x.xml", "--summary", "x.md")
    assert said.status == 1
    assert said.err.startswith("fivebar: wild: the foot left its path at t = ")
    assert "FAIL: wild: the foot left its path at t = " in said.out
    assert "tracking RMS" in said.out
    suite = ElementTree.parse("x.xml").getroot()[0]
    failed = {case.get("classname") for case in suite if case.find("failure") is not None}
    assert failed == {"wild"}
    assert "fivebar check: 1 of 2 failed" in Path("x.md").read_text("utf-8")
    assert not Path("runs").exists()


def test_failed_run_is_kept_and_stays(recorded: Shell) -> None:
    fault = ["--set", "servo.kd=0.055"]
    said = recorded("check", "short.toml", *fault)
    place = Path("runs/failed/short")
    assert f"note: short: its run is kept in {place}" in said.out
    directory.check_run(place)
    assert "kd = 0.055" in (place / "scenario.toml").read_text("utf-8")
    assert recorded("check", "short.toml").status == 0
    directory.check_run(place)
    assert recorded("check", "short.toml", *fault, "--keep", "mine", "--quiet").status == 1
    directory.check_run(Path("mine/short"))


def test_any_path_can_be_told(recorded: Shell) -> None:
    odd = ["--keep", "\udcff", "--set", "servo.kd=0.055"]  # as a byte that is no UTF-8 comes
    assert (
        recorded("check", "short.toml", *odd, "--junit", "x.xml", "--summary", "x.md").status == 1
    )
    directory.check_run(Path("\udcff/short"))
    assert "\\udcff" in Path("x.md").read_text("utf-8")
    ElementTree.parse("x.xml")


def test_empty_summary_is_none(recorded: Shell) -> None:
    """What "$GITHUB_STEP_SUMMARY" is outside of GitHub."""
    assert recorded("check", "short.toml", "--summary", "", "--quiet") == (0, "", "")


def test_summary_is_appended(recorded: Shell) -> None:
    Path("page.md").write_text("# My job\n", encoding="utf-8")
    for _ in range(2):
        assert recorded("check", "short.toml", "--summary", "page.md").status == 0
    page = Path("page.md").read_text("utf-8")
    assert page.startswith("# My job\n")
    assert page.count("## fivebar check: all 1 pass") == 2


# refusal


def test_wrong_use_is_one_line(recorded: Shell) -> None:
    said = recorded.refused("check", "short.toml", "--update", "--set", "duration=0.7")
    assert said == "--update records scenarios as their files say: leave out --set"
    said = recorded.refused("check", "short.toml", "short.toml")
    assert said == "two scenarios are called 'short': give each its own name"
    BASELINE.write_text('{"metrics": {"tracking": 1}}', encoding="utf-8")
    said = recorded.refused("check", "short.toml")
    assert said == f"{BASELINE} is not a baseline: made must be a table, got None"


@pytest.mark.parametrize(
    ("option", "place", "message"),
    [
        ("--junit", ".", "cannot write .: a directory is there"),
        ("--junit", "foot.csv/x.xml", "cannot write foot.csv/x.xml: "),
        ("--junit", "x" * 300, f"cannot write {'x' * 300}: File name too long"),
        ("--summary", ".", "cannot write .: Is a directory"),
        ("--summary", "foot.csv/x.md", "cannot write foot.csv/x.md: "),
    ],
)
def test_place_that_cannot_be_written_is_one_line(
    recorded: Shell, option: str, place: str, message: str
) -> None:
    assert recorded.refused("check", "short.toml", "--quiet", option, place).startswith(message)


def test_failed_run_that_cannot_be_kept_still_has_its_verdict(recorded: Shell) -> None:
    Path("runs").mkdir()
    Path("runs/failed").touch()
    said = recorded("check", "short.toml", "--set", "servo.kd=0.055")
    assert said.status == 2
    assert "FAIL: short: tracking RMS: " in said.out
    assert said.err.startswith("fivebar: cannot write runs/failed/short: ")
    assert said.err.count("\n") == 1


def test_all_runs_are_simulated_together(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes of them is simulated once for all tests."""
    calls = []

    def counted(plans: list[rollout.Plan], nthread: int = 1) -> list[rollout.Result]:
        calls.append((len(plans), nthread))
        return [results()[plan.scenario.name] for plan in plans]

    monkeypatch.setattr(rollout, "run_all", counted)
    assert shell("check", *FAST, "--quiet").status == 0
    assert calls == [(len(FAST), 0)]
