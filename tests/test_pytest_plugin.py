"""The pytest plugin: a user's tests, run by a pytest of their own."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shell import ELLIPSE

from fivebar_sim import pytest_plugin
from fivebar_sim.report import in_plane, look, over_time
from fivebar_sim.runs import stored

ROOT = Path(__file__).resolve().parents[1]
LIMITS = '[limits]\ntracking.rms = 1e-6\n"load.share_A" = [0.4, 0.6]\nclosure.max = 1e-9\n'
FAST = ELLIPSE.replace("duration = 0.6", "duration = 0.4")
LAW = """
import msgspec

class Ahead(msgspec.Struct, frozen=True):
    lead: float = 0.0
    def setpoints(self, leg, servo, motion, integrator):
        return (motion.q + self.lead * motion.q_dot)[1:, [0, 2]]
"""
KEPT = {
    *("scenario.toml", "metrics.json", "rollout.parquet", "recording.rrd"),
    *("foot-path.png", "tracking-error.png"),
}

Session = Callable[..., str]
PYTEST = ["-p", pytest_plugin.__name__, "-W", "error", "--import-mode=importlib"]


@pytest.fixture
def repository(tmp_path: Path, quick_start: None) -> Path:
    """Return the folder of the tests of a repository, with two scenarios."""
    (tmp_path / "pyproject.toml").write_text("[tool.pytest.ini_options]\n", encoding="utf-8")
    tests = tmp_path / "tests"
    tests.mkdir()
    (tests / "mine.toml").write_text(FAST, encoding="utf-8")
    (tests / "strict.toml").write_text(FAST + LIMITS, encoding="utf-8")
    return tests


@pytest.fixture
def session(
    repository: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    light: None,
) -> Session:
    """Return a function that runs tests in a repository and returns what pytest said.

    Within this process, which has imported all that the runs need; that a user's own process does
    so is `test_passing_tests_leave_nothing`.
    """
    monkeypatch.chdir(repository.parent)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)

    def run(source: str, *options: str, **counts: int) -> str:
        (repository / "test_mine.py").write_text(LAW + source, encoding="utf-8")
        capfd.readouterr()
        with monkeypatch.context() as patch:
            for name in ("path", "meta_path"):
                patch.setattr(sys, name, list(getattr(sys, name)))
            status = pytest.main([*PYTEST, *options])
        for name in ("tests.test_mine", "tests"):  # the next one is another file
            sys.modules.pop(name, None)
        out, err = capfd.readouterr()
        return counted(status, out, err, **counts)

    return run


def counted(
    status: int, out: str, err: str, *, failed: int = 0, passed: int = 0, errors: int = 0
) -> str:
    """Return what pytest said, which must be that so many tests ended so."""
    assert "INTERNALERROR" not in out + err
    for count, what in ((failed, "failed"), (passed, "passed"), (errors, "error")):
        found = re.search(rf"(\d+) {what}", out)
        assert int(found[1] if found else 0) == count, out + err
    assert status == bool(failed or errors)
    return out


def errors(said: str) -> list[str]:
    """Return the lines that say what is wrong."""
    return [line[1:].strip() for line in said.splitlines() if re.match(r"E\s", line)]


def test_entry_point_is_the_plugin() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"fivebar": pytest_plugin.__name__}


def test_passing_tests_leave_nothing(repository: Path, tmp_path: Path) -> None:
    """In a process of their own, as a user starts it."""
    source = """
import sys
import pytest

def test_nothing_is_imported_before_it_is_used():
    loaded = {name for name in sys.modules if name.startswith("fivebar_sim")}
    assert loaded == {"fivebar_sim", "fivebar_sim.pytest_plugin"}
    heavy = {"numpy", "mujoco", "rerun", "matplotlib", "scipy", "pyarrow", "rich"}
    assert not heavy & set(sys.modules)

def test_shipped_and_own(leg_run):
    leg_run("classic-figure-eight").assert_limits()
    slow = leg_run("mine.toml", controller=Ahead())
    fast = leg_run("mine.toml", controller=Ahead(lead=0.05 / 8), settings=["duration=0.5"])
    assert fast.metrics["tracking"]["rms"] < 0.1 * slow.metrics["tracking"]["rms"]
    assert len(fast.record["time"]) == 500
    assert fast.verdict == "not judged" and fast.limits == []
    assert fast.scenario.controller == Ahead(lead=0.05 / 8)
    fast.assert_metric("tracking.rms", low=0.0, high=1e-3)
    with pytest.raises(AssertionError):
        slow.assert_metric("tracking.rms", high=1e-3)

@pytest.mark.xfail(strict=True)
def test_known_to_fail(leg_run):
    leg_run("strict.toml").assert_limits()

def test_installed_controller_keeps_its_name(leg_run):
    from fivebar_controllers.servo import Servo

    assert leg_run("mine.toml", controller=Servo()).scenario.controller_name == "servo"

def test_runs_are_forgotten(request):
    from fivebar_sim.pytest_plugin import RUNS

    kept = [item.stash[RUNS] for item in request.session.items if RUNS in item.stash]
    assert kept == [[], [], []]
"""
    (repository / "test_mine.py").write_text(LAW + source, encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", *PYTEST],
        cwd=tmp_path,
        env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
    )
    said = counted(ended.returncode, ended.stdout, ended.stderr, passed=4)
    assert "1 xfailed" in said
    assert not (tmp_path / "fivebar-artifacts").exists()


SHARED = """
import pytest

@pytest.fixture(scope="module")
def slow(leg_run):
    return leg_run("mine.toml", settings=["name=mine"])

@pytest.fixture(scope="session")
def strict(leg_run):
    return leg_run("strict.toml", settings=["name=strict"])

def test_first(slow):
    assert slow.verdict == "not judged"

def test_second(slow, strict):
    strict.assert_limits()

def test_third(slow, leg_run):
    leg_run("mine.toml", settings=["name=own"])
    slow.assert_metric("tracking.rms", high=1e-9)

def test_fourth(leg_run):
    assert leg_run("mine.toml", settings=["name=own"]).verdict == "fail"

@pytest.mark.parametrize("k", [1, 2])
def test_nothing(k):
    assert k == 2
"""


@pytest.fixture
def sketched(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw nothing in pictures; `test_runs_of_a_test_and_its_fixture_are_kept_once` has real ones.

    A figure takes longer than the run that it is of.
    """
    for room, name in ((in_plane, "foot_path"), (over_time, "tracking_error")):
        empty = SimpleNamespace(key=name.replace("_", "-"), figure=None)
        monkeypatch.setattr(room, name, lambda run, drawn=empty: drawn)
    monkeypatch.setattr(look, "png", lambda figure: b"drawn")


@pytest.mark.usefixtures("sketched")
def test_fixtures_of_any_scope_run_legs(session: Session, tmp_path: Path) -> None:
    """A failed test keeps what the shared fixtures that it uses have run, and JUnit says where."""
    said = session(SHARED, "--junit-xml=junit.xml", failed=4, passed=2)
    kept = {
        "second": {"mine", "strict"},
        "third": {"mine", "own"},
        "fourth": {"own"},
    }
    named: dict[str, set[str]] = {}
    for case in ElementTree.parse(tmp_path / "junit.xml").getroot().iter("testcase"):
        places = [each.get("value", "") for each in case.iter("property")]
        assert all((tmp_path / place / "recording.rrd").is_file() for place in places)
        named[str(case.get("name"))] = {Path(place).name for place in places}
    assert named == {
        "test_first": set(),
        **{f"test_{name}": runs for name, runs in kept.items()},
        "test_nothing[1]": set(),
        "test_nothing[2]": set(),
    }
    for name, runs in kept.items():
        folder = tmp_path / "fivebar-artifacts" / f"tests-test_mine.py-test_{name}"
        assert {place.name for place in folder.iterdir()} == runs
    assert said.count("runs of the leg") == 3


def test_plugin_asks_nothing_of_an_old_pluggy() -> None:
    """One before 1.2 knows no `wrapper`, and would end every session of that Python."""
    hooks = [each for name, each in vars(pytest_plugin).items() if name.startswith("pytest_")]
    asked = [vars(hook)["pytest_impl"] for hook in hooks if "pytest_impl" in vars(hook)]
    assert len(asked) == 3
    assert not any(options["wrapper"] for options in asked)


@pytest.mark.usefixtures("sketched")
def test_failed_test_says_what_broke_and_keeps_its_runs(session: Session, tmp_path: Path) -> None:
    source = """
import pytest

@pytest.mark.parametrize("L2", [0.06, 0.062])
def test_strict(leg_run, L2):
    leg_run("strict.toml", settings=[f"leg.L2={L2}"]).assert_limits()

def test_flip(leg_run):
    leg_run("mine.toml", settings=["controller.name=pd", "controller.kp=0", "controller.kd=0",
        "limits={warnings=0}", "duration=1.0"]).assert_limits()

def test_range(leg_run):
    leg_run("mine.toml")
    leg_run("mine.toml").assert_metric("load.share_A", low=0.9)
"""
    said = session(source, failed=4)
    assert re.search(
        r"AssertionError: short fails:\nE +tracking RMS: [\d.]+ mm, limit <= 1 um\n", said
    )
    assert re.search(r"E +loop gap max \(run\): [\d.]+ um, limit <= 1 nm\n", said)
    assert re.search(r"E +load share A: [\d.]+ %, limit >= 90 %\n", said)
    assert re.search(
        r"E +guard branch: the leg left its branch at t = [\d.]+ s; guard stops: ", said
    )
    assert "leg_run.py" not in said  # the traceback is the test's alone
    assert len(re.findall("\nE +load share A", said)) == 1  # it holds in the other two
    folder = tmp_path / "fivebar-artifacts"
    tests = {place.name.removeprefix("tests-test_mine.py-") for place in folder.iterdir()}
    assert {re.sub(r"-\w{10}$", "", name) for name in tests} == {
        *("test_strict-0.06", "test_strict-0.062", "test_flip", "test_range")
    }
    places = [place for test in folder.iterdir() for place in test.iterdir()]
    assert sorted(place.name for place in places) == ["short"] * 4 + ["short-2"]
    for place in places:
        assert {file.name for file in place.iterdir()} == KEPT
        assert f"kept in {place.relative_to(tmp_path)} (recording.rrd" in said
        assert (place / "tracking-error.png").read_bytes() == b"drawn"
        stored.read(place)

    (folder / "mine.txt").touch()
    session(source.replace("low=0.9", "low=0.1"), "-k", "range", passed=1)
    assert not (folder / "tests-test_mine.py-test_range").exists()
    assert len(list(folder.iterdir())) == 4


def test_runs_of_a_test_and_its_fixture_are_kept_once(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    png = look.png
    drawn: list[bytes] = []  # a real picture, the same for all

    def once(figure: Any) -> bytes:
        if not drawn:
            drawn.append(png(figure))
        return drawn[0]

    monkeypatch.setattr(look, "png", once)
    said = session(
        """
import pytest

@pytest.fixture
def result(leg_run):
    yield leg_run("mine.toml", controller=Ahead())
    assert False

def test_good(result):
    assert result.verdict == "not judged"

def test_bad(result):
    assert result.verdict == "fail"
""",
        *("--fivebar-artifacts", "out/legs"),
        passed=1,
        failed=1,
        errors=2,
    )
    places = sorted((tmp_path / "out/legs").glob("*/*"))
    assert [f"{place.parent.name}/{place.name}" for place in places] == [
        *("tests-test_mine.py-test_bad/short", "tests-test_mine.py-test_good/short")
    ]
    place = places[0]
    assert {file.name for file in place.iterdir()} == KEPT
    assert 'name = "Ahead"' in (place / "scenario.toml").read_text(encoding="utf-8")
    assert "AssertionError: assert 'not judged' == 'fail'" in said
    for place in places:
        assert said.count(f"kept in {place.relative_to(tmp_path)}") == 1
        for picture in place.glob("*.png"):
            assert picture.read_bytes().startswith(b"\x89PNG")


def test_place_that_cannot_be_written_does_not_end_the_session(
    session: Session, tmp_path: Path
) -> None:
    (tmp_path / "taken").touch()
    said = session(
        'def test_it(leg_run):\n    leg_run("strict.toml").assert_limits()\n',
        *("--fivebar-artifacts", "taken"),
        failed=1,
    )
    assert "short: fail, but cannot all be kept in taken/tests-test_mine.py-test_it/short" in said


REFUSED = {
    '"classic-elipse"': "unknown scenario 'classic-elipse'; known: .*did you mean",
    '"none.toml"': r"cannot read .*/tests/none\.toml",
    '"mine.toml", settings=["leg.L9=1"]': "L9",
    '"mine.toml", settings="leg.L2=1"': "settings must be a list of",
    '"mine.toml", controller=7': "controller must be a msgspec Struct .*, got 7",
    '"mine.toml", controller=Ahead': "controller must be a msgspec Struct .*got <class",
    '"mine.toml", controller=Ahead(lead={1j})': "controller 'Ahead' has a field that TOML cannot",
    '"mine.toml", controller=Ahead(), settings=["controller.lead=1"]': "settings change the contr",
    '"mine.toml", settings=["path.centre=[0.0, -0.2]"]': "reach",
    '"mine.toml", settings=["controller.name=pd", "controller.kd=9"]': "at t = ",
}


def test_refusals_are_one_line(session: Session, tmp_path: Path) -> None:
    said = session(
        "\n".join(
            f"def test_{k}(leg_run):\n    leg_run({call})\n" for k, call in enumerate(REFUSED)
        ),
        failed=len(REFUSED),
    )
    for line, wanted in zip(errors(said), REFUSED.values(), strict=True):
        assert re.match(rf"fivebar_sim\.errors\.\w+: .*{wanted}", line), line
    assert "leg_run.py" not in said
    assert not (tmp_path / "fivebar-artifacts").exists()


def test_what_cannot_be_asserted(session: Session) -> None:
    session(
        """
import re
import pytest

def test_it(leg_run):
    run = leg_run("mine.toml")
    with pytest.raises(ValueError, match=re.escape("short has no [limits]: there is nothing")):
        run.assert_limits()
    for key, bounds, wanted in [
        ("tracking.rsm", {"high": 1}, "unknown metric 'tracking.rsm'; known: "),
        ("ground.slip", {"high": 1}, "unknown metric 'ground.slip'; known: "),
        ("tracking.rms", {}, "tracking.rms needs a bound"),
        ("tracking.rms", {"low": 1, "high": 0.5}, "high must be in [1, inf), got 0.5"),
        ("tracking.rms", {"low": float("nan")}, "low must be in (-inf, inf), got nan"),
    ]:
        with pytest.raises(ValueError, match=re.escape(wanted)):
            run.assert_metric(key, **bounds)
""",
        passed=1,
    )


PART = st.text(st.sampled_from("ab-_./:[] 1"), min_size=1, max_size=6)


@given(PART, PART)
def test_no_two_tests_share_a_folder(one: str, other: str) -> None:
    names = [pytest_plugin.name_of(f"tests/test_it.py::test_{each}") for each in (one, other)]
    assert (names[0] == names[1]) == (one == other)
    for name in names:
        assert re.fullmatch(r"[\w.-]{1,131}", name)
        assert Path(name).name == name


def test_long_names_are_cut() -> None:
    names = {pytest_plugin.name_of(f"test_it.py::test_{'x' * 300}{end}") for end in "ab"}
    assert len(names) == 2
    assert max(map(len, names)) <= 131
