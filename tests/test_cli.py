"""The command `fivebar`, called as a function: exit status, one clear line, and what is left."""

from __future__ import annotations

import errno
import json
import re
from pathlib import Path
from typing import NoReturn

import pytest
from shell import CSV, ELLIPSE, JUDGED, Shell

from fivebar_sim import FiveBar, Result, Scenario, control, paths
from fivebar_sim.cli import list as list_command
from fivebar_sim.files import resources
from fivebar_sim.recording import rrd
from fivebar_sim.report import single
from fivebar_sim.runs.directory import FILES

pytestmark = pytest.mark.usefixtures("light")

FROM_CSV = ["--set", "path.kind=csv", "--set", "path.file=foot.csv"]
DIVERGING = ["--set", "sim.integrator=implicitfast", "--set", "sim.timestep=0.02"]


# law


def test_run_shows_a_table_and_writes_where_it_says(shell: Shell) -> None:
    said = shell("run", "short.toml", "--out", "mine")
    assert (said.status, said.err) == (0, "")
    assert "short: classic leg" in said.out
    assert "MuJoCo warnings" in said.out
    assert said.out.endswith("written to mine\n")
    assert {f"mine/{name}" for name in FILES} <= shell.names()
    assert shell("run", "short.toml").out.endswith(f"written to {Path('runs') / 'short'}\n")


def test_json_is_the_metrics(shell: Shell) -> None:
    said = shell("run", "short.toml", "--out", "mine", "--json")
    assert json.loads(said.out) == json.loads(Path("mine/metrics.json").read_text("utf-8"))
    both = shell("run", "short.toml", "classic-ellipse", "--set", "duration=0.8", "--json")
    assert set(json.loads(both.out)) == {"short", "classic-ellipse"}
    assert (said.err, both.err) == ("", "")


def test_quiet_prints_nothing(shell: Shell) -> None:
    assert shell("run", "short.toml", "--quiet") == (0, "", "")
    assert shell("check", "short.toml", "--quiet") == (0, "", "")
    fails = ["--set", "limits.tracking.rms=0", "--quiet"]
    assert shell("run", "short.toml", *fails) == (1, "", "")


def test_several_scenarios_go_into_a_folder(shell: Shell) -> None:
    said = shell("run", "short.toml", "classic-ellipse", "--set", "duration=0.8", "--out", "all")
    assert said.status == 0
    for name in ("short", "classic-ellipse"):
        assert {f"all/{name}/{file}" for file in FILES} <= shell.names()
        assert f"written to {Path('all') / name}" in said.out
    first, second, last = said.out.splitlines()
    assert re.match(r"pass  short  tracking RMS [0-9.]+ mm  written to all", first)
    assert second.startswith("pass  classic-ellipse  tracking RMS 1.19")
    assert last == "2 runs: 2 pass"


def test_last_line_of_several_names_what_failed(shell: Shell) -> None:
    for name, more in {
        "strict": "[limits]\ntracking.rms = 1e-9\n",
        "free": "",
        "wild": "[sim]\nintegrator='implicitfast'\ntimestep=0.02\n",
    }.items():
        text = ELLIPSE.replace("short", name) + more
        Path(f"{name}.toml").write_text(text, encoding="utf-8")
    said = shell("run", "short.toml", "strict.toml", "free.toml", "wild.toml")
    assert said.status == 1
    lines = said.out.splitlines()
    assert lines[1].startswith("FAIL  strict  tracking RMS")
    assert re.fullmatch(r"  tracking RMS: [0-9.]+ mm, limit <= 1 nm", lines[2])
    assert lines[3].startswith("not judged (guards hold)  free")
    assert lines[4] == "4 runs: 1 pass, 1 fail, 1 not judged, 1 diverged: strict, wild"
    assert said.err.startswith("fivebar: wild: ")


def test_what_is_listed_can_be_used(shell: Shell) -> None:
    said = shell("list")
    assert (said.status, said.err) == (0, "")
    names = {kind: set[str]() for kind in list_command.WHATS}
    kind = ""
    for line in said.out.splitlines():
        kind = line.split(":")[0] if re.match(r"\w+: ", line) else kind
        named = re.match(r"  (\S+)  +\S", line)
        if named:
            names[kind].add(named[1])
    assert names == {
        "scenarios": set(resources.shipped("scenarios")),
        "legs": set(resources.shipped("models/legs")),
        "servos": set(resources.shipped("models/servos")),
        "robots": set(resources.shipped("models/robots")),
        "paths": set(paths.kinds()),
        "controllers": set(control.known()),
    }
    for kind, known in names.items():
        alone = shell("list", kind).out
        assert alone in said.out + "\n"
        assert all(f"  {name} " in alone for name in known)
    assert shell.refused("list", "leg").endswith("(did you mean 'legs'?)")


def test_new_scenario_runs_and_all_its_lines_are_legal(shell: Shell) -> None:
    assert shell("new", "first.toml").status == 0
    text = Path("first.toml").read_text("utf-8")
    Scenario.load("first.toml")
    assert shell("run", "first.toml", "--set", "duration=1.0", "--quiet").status == 0
    # Each comment that is a key or a table belongs to the table above it.
    every = re.sub(r"^# (?=\[limits\]|[a-zA-Z_0-9.]+ = )", "", text, flags=re.MULTILINE)
    assert every.count("\n#") < text.count("\n#") - 15
    Path("every.toml").write_text(every, encoding="utf-8")
    whole = Scenario.load("every.toml")
    assert len(whole.limits) == 3
    assert whole.servo.delay == 0.002
    kept = {"L1", "L2", "L3", "L4", "L5", "density"}
    assert {key: getattr(whole.leg, key) for key in kept} == {
        key: getattr(FiveBar.load("classic"), key) for key in kept
    }
    for line in text.splitlines():
        number = re.match(r"#? ?\w+ = \[?[0-9.e-]+", line)
        unitless = re.match(r"#? ?(load\.share_A|seed)", line)
        assert not number or unitless or re.search(r"# \[[^]]+\]", line), line


def test_new_scenario_replaces_nothing(shell: Shell) -> None:
    assert shell.refused("new", "short.toml") == "short.toml exists already: choose another name"
    assert shell.refused("new", "mine") == "a scenario is a .toml file, got 'mine'"
    assert "No such file" in shell.refused("new", "nowhere/mine.toml")


def test_settings_repeat_and_reach_every_scenario(shell: Shell) -> None:
    settings = ["--set", "leg.L2=0.07", "--set", "path.kind=circle", "--set", "path.radius=0.01"]
    assert shell("run", "short.toml", *settings, "--out", "mine", "--quiet").status == 0
    resolved = Path("mine/scenario.toml").read_text("utf-8")
    for line in ("L2 = 0.07", 'kind = "circle"', "radius = 0.01", "frequency = 4.0"):
        assert line in resolved


def test_failing_limit_exits_1_and_still_writes(shell: Shell) -> None:
    fails = ["--set", "limits.tracking.rms=1e-9"]
    said = shell("run", "short.toml", *fails, "--out", "mine")
    assert said.status == 1
    assert "FAIL" in said.out
    assert json.loads(Path("mine/metrics.json").read_text("utf-8"))["verdict"] == "fail"
    checked = shell("check", "short.toml", *fails)
    assert (checked.status, checked.err) == (1, "")
    assert "FAIL" in checked.out


def test_without_limits_nothing_is_judged_but_guards(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A motor a thousandth as stiff lets the foot hang 18.9 mm beside its 40 x 16 mm ellipse."""
    loose = ["--set", "limits={}", "--set", "servo.kp=0.001"]
    said = shell("run", "classic-ellipse", *loose, "--out", "mine")
    assert (said.status, said.err) == (0, "")
    assert "verdict: not judged (guards hold)" in said.out
    assert "pass" not in said.out
    assert (
        "warning: the foot does not follow its path: its RMS error of 18.86 mm is more than a "
        "tenth of the path's 40 mm"
    ) in said.out
    metrics = json.loads(Path("mine/metrics.json").read_text("utf-8"))
    assert (metrics["verdict"], metrics["limits"]) == ("not judged", [])
    assert Result.read("mine").verdict == "not judged"
    monkeypatch.setattr(single, "figures", lambda run: [])  # what the page says is enough
    assert shell("report", "mine").status == 0
    page = Path("mine/report.html").read_text("utf-8")
    assert ">NOT JUDGED</span>" in page
    assert "Warning: the foot does not follow its path" in page

    said = shell("run", "classic-ellipse", "--set", "limits={}", "--set", "guards.energy=1e-12")
    assert said.status == 1
    assert "verdict: FAIL" in said.out
    assert "warning:" not in said.out


def test_check_refuses_what_it_could_not_judge(shell: Shell) -> None:
    assert shell("check", "short.toml", "--update", "--quiet").status == 0
    Path("short.toml").write_text(ELLIPSE, encoding="utf-8")
    for more in ([], ["--update"], ["--set", "servo.kp=9"]):
        assert shell.refused("check", "short.toml", *more) == (
            "short.toml: [limits] must set at least one limit: without any, check has nothing to "
            "judge"
        )


def test_highest_status_counts(shell: Shell) -> None:
    Path("wild.toml").write_text(
        JUDGED.replace("short", "wild") + "[sim]\nintegrator='implicitfast'\ntimestep=0.02\n",
        encoding="utf-8",
    )
    said = shell("run", "wild.toml", "short.toml", "--out", "all")
    assert said.status == 1
    assert said.err.startswith("fivebar: wild: the foot left its path at t = ")
    assert {name for name in shell.names() if name.startswith("all/")} == {
        *("all/short", *(f"all/short/{file}" for file in FILES))
    }
    assert shell("check", "wild.toml", "short.toml", "--quiet").status == 1
    # a wrong input is found before the first one runs
    Path("wrong.toml").write_text("[path]\nkind = 'line'\n", encoding="utf-8")
    assert "path.frequency is missing" in shell.refused("run", "short.toml", "wrong.toml")


@pytest.mark.parametrize("text", [CSV, "\ufeff" + CSV.replace("\n", "\r\n")])
def test_csv_drives_the_leg(shell: Shell, text: str) -> None:
    Path("foot.csv").write_bytes(text.encode())
    assert shell("run", "short.toml", *FROM_CSV, "--out", "mine", "--quiet") == (0, "", "")
    assert Path("mine/foot.csv").read_bytes() == text.encode()


def test_markup_in_names_is_shown_as_it_is(shell: Shell) -> None:
    said = shell("run", "short.toml", "--set", "leg.name='[/red]'", "--out", "[/red]")
    assert said.status == 0
    assert "short: [/red] leg" in said.out
    assert said.out.endswith("written to [/red]\n")
    assert "[red]" in shell("check", "short.toml", "--set", "name='[red]'").out


# refusal


def test_unknown_option_points_to_the_help_of_its_command(shell: Shell) -> None:
    with pytest.raises(SystemExit) as end:
        shell("run", "--outt", "x")
    assert end.value.code == 2
    err = shell.capture.readouterr().err
    assert set(re.findall(r"fivebar ?\w* --help", err)) == {"fivebar run --help"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], r"no command; known: certify, check, .*workspace"),
        ([""], r"no command; known: certify, check, .*workspace"),
        (["rnu"], r"unknown command 'rnu'; known: .* \(did you mean 'run'\?\)"),
        (["RUN", "short.toml"], r"unknown command 'RUN'; known: .* \(did you mean 'run'\?\)"),
        (["--quiet", "run"], r"unknown command '--quiet'; known: .*workspace"),
        (["walk", "--help"], r"unknown command 'walk'; known: .*workspace"),
    ],
)
def test_unknown_command_is_one_line(shell: Shell, words: list[str], message: str) -> None:
    assert re.fullmatch(f"{message}; see fivebar --help", shell.refused(*words))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            "path.centre=[0,-0.1]",
            "short.toml: path out of reach at t = 0 s: the foot at (0.00, -108.00) mm is "
            "9.13 mm out; the nearest reachable point is (0.00, -98.87) mm",
        ),
        ("duratoin=1", "short.toml: unknown key 'duratoin'; known: "),
        ("servo.kp='stiff'", "short.toml: servo.kp must be a number, got 'stiff'"),
        ("leg.L1=0", "short.toml: [leg]: L1 must be in (0, 1000) m, got 0"),
        ("leg.L3=-0.06", "short.toml: [leg]: L3 must be in (0, 1000) m, got -0.06"),
        ("leg.L5=1", "short.toml: [leg]: L5: the links can never close"),
        (
            "leg=dogg",
            "short.toml: leg.preset: unknown leg preset 'dogg'; known: airhockey, classic",
        ),
        (
            "path.kind=square",
            "short.toml: path.kind: unknown path 'square'; known: angles",
        ),
        ("controller.name=pid", "short.toml: controller.name: unknown controller 'pid'; known: c"),
        ("nonsense", "--set takes KEY=VALUE, got 'nonsense'"),
        ("name=a\tb", "short.toml: name must be a plain file name of 1 to 200 bytes, got 'a\\tb'"),
    ],
)
def test_wrong_input_is_one_line(shell: Shell, settings: str, message: str) -> None:
    for command in ("run", "check"):
        assert shell.refused(command, "short.toml", "--set", settings).startswith(message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,x_mm\n0,0\n", ", line 1: no column 'z_mm'; the header must be"),
        (
            CSV.replace("10,-75", "nan,-75", 1),
            ", line 3: x_mm must be a number in [-1e+06",
        ),
        (CSV.replace("0.4", "0.1"), ", line 4: times are not sorted: time_s must be > 0.2 s"),
        (CSV.replace("0.4", "0.2"), ", line 4: times are repeated: time_s must be > 0.2 s"),
        (CSV[:25], ": a foot path needs at least 2 rows, got 1"),
    ],
)
def test_wrong_csv_is_one_line(shell: Shell, text: str, message: str) -> None:
    Path("foot.csv").write_text(text, encoding="utf-8")
    said = shell.refused("run", "short.toml", *FROM_CSV)
    assert said.startswith(f"{shell.folder / 'foot.csv'}{message}")


def test_diverging_timestep_exits_1_and_leaves_nothing(shell: Shell) -> None:
    said = shell.refused("run", "short.toml", *DIVERGING, "--quiet", status=1)
    assert said.startswith(
        "short: the foot left its path at t = 0.02 s; the simulation broke down at t = 0.14 s: "
    )
    assert "try a timestep below 0.02 s" in said


def test_diverging_run_leaves_no_older_pass_at_its_place(shell: Shell) -> None:
    run = ["run", "short.toml", "--quiet", "--out", "mine"]
    before = shell.names()
    assert shell(*run).status == 0
    assert shell(*run, *DIVERGING).status == 1
    assert shell.names() == before

    assert shell(*run).status == 0
    Path("mine/notes.txt").touch()
    assert shell(*run, *DIVERGING).status == 1
    assert shell.names() == before | {"mine", "mine/notes.txt", "mine/diverged.txt"}
    assert "the simulation broke down at" in Path("mine/diverged.txt").read_text("utf-8")
    assert shell(*run).status == 0
    assert {"mine/notes.txt", "mine/metrics.json"} <= shell.names()
    assert not Path("mine/diverged.txt").exists()


def test_place_that_cannot_be_written_is_one_line(shell: Shell) -> None:
    Path("precious").mkdir()
    Path("precious/notes.txt").touch()
    taken = "something that is not a run directory is there"
    for place, message in {
        "precious": f"cannot write precious: {taken}",
        "short.toml": f"cannot write short.toml: {taken}",
        ".": f"cannot write .: {taken}",
        "short.toml/x": f"cannot write short.toml/x: {shell.folder / 'short.toml'} is not a dir",
        "x" * 300: f"cannot write {'x' * 300}: File name too long",
        "": "--out must name a directory, got ''",
    }.items():
        assert shell.refused("run", "short.toml", "--out", place).startswith(message)


def test_two_scenarios_of_one_name_are_refused(shell: Shell) -> None:
    message = "two scenarios are called 'short' and would write to one place"
    assert shell.refused("run", "short.toml", "short.toml") == message


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left")])
def test_trouble_while_writing_leaves_the_old_run(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    assert shell("run", "short.toml", "--out", "mine").status == 0
    before = Path("mine/metrics.json").stat().st_ino

    def broken(*args: object) -> NoReturn:
        raise error

    monkeypatch.setattr(rrd, "write", broken)
    interrupted = isinstance(error, KeyboardInterrupt)
    said = shell.refused("run", "short.toml", "--out", "mine", status=130 if interrupted else 2)
    assert said == ("interrupted" if interrupted else "cannot write mine: No space left")
    assert Path("mine/metrics.json").stat().st_ino == before


@pytest.mark.parametrize("args", [["run", "--fast"], ["run", "--out"], ["replay"]])
def test_usage_errors_exit_2(shell: Shell, args: list[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        shell(*args)
    assert caught.value.code == 2
    assert "Traceback" not in shell.capture.readouterr().err
