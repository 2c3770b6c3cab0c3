"""The file that replay opens: the run's own if it can be read, else a new one from the record."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from recorded import digest

from fivebar_sim import rollout
from fivebar_sim.errors import ConfigError, RunDirectoryError
from fivebar_sim.recording import check
from fivebar_sim.runs import recording_file
from fivebar_sim.scenario import Scenario

BRIEF = ["duration=0.35", "path.frequency=4", "path.ramp=0.1"]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the directory of a short run."""
    folder = tmp_path_factory.mktemp("runs")
    result = rollout.run(Scenario.load("classic-ellipse", BRIEF))
    return result.write(folder / "short")


@pytest.fixture(scope="module")
def content(written: Path) -> str:
    """Return what its recording holds."""
    return digest(written / "recording.rrd")


@pytest.fixture
def run(written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of that directory; temporary files go to a folder beside it."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    shutil.copytree(written, tmp_path / "mine")
    return tmp_path / "mine"


def changed(file: Path, change: Callable[[bytes], bytes]) -> None:
    file.write_bytes(change(file.read_bytes()))


DAMAGES: dict[str, Callable[[Path], object]] = {
    "missing": lambda file: file.unlink(),
    "empty": lambda file: file.write_bytes(b""),
    "no recording": lambda file: file.write_bytes(b"hello, world" * 9),
    "a byte short": lambda file: changed(file, lambda data: data[:-1]),
    "torn": lambda file: changed(file, lambda data: data[: len(data) // 2]),
    "bad sector": lambda file: changed(file, lambda data: data[:4096] + bytes(512) + data[4608:]),
    "older Rerun": lambda file: changed(file, lambda data: data[:4] + bytes([0, 20]) + data[6:]),
    "newer Rerun": lambda file: changed(file, lambda data: data[:4] + bytes([0, 99]) + data[6:]),
    "much newer": lambda file: changed(file, lambda data: data[:4] + bytes([2, 0]) + data[6:]),
    "another format": lambda file: changed(file, lambda data: b"RRF9" + data[4:]),
}


def reads_here(path: Path, run: str | None = None) -> bool:
    """Return what `check.reads` returns, without a process: no damage here crashes the reader.

    Args:
        path: The recording.
        run: What identifies the run whose recording it must be; None for any.
    """
    try:
        found = check.read_through(path)
    except (ValueError, RuntimeError):
        return False
    return run in (None, found)


def test_a_good_recording_is_opened_as_it_is(run: Path) -> None:
    before = (run / "recording.rrd").stat().st_mtime_ns
    with recording_file.opened([run]) as file:
        assert file == run / "recording.rrd"
    assert (run / "recording.rrd").stat().st_mtime_ns == before


@pytest.mark.parametrize("name", DAMAGES)
def test_one_that_cannot_be_read_is_rebuilt(
    run: Path, content: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Were it left as it is, its bytes would still be the damaged ones."""
    if name != "torn":
        monkeypatch.setattr(check, "reads", reads_here)
    own = run / "recording.rrd"
    names = set(os.listdir(run))
    DAMAGES[name](own)
    damaged = own.read_bytes() if own.exists() else None
    with recording_file.opened([run]) as file:
        assert file == own
    assert own.read_bytes() != damaged
    assert digest(own) == content
    assert own.stat().st_mode & 0o777 == 0o644
    assert set(os.listdir(run)) == names


def test_damage_is_found_without_all_of_rerun(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its import takes longer than to find the damage."""
    (tmp_path / "rerun.py").write_text("import os; os._exit(0)", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    DAMAGES["torn"](run / "recording.rrd")
    assert not check.reads(run / "recording.rrd")


def test_the_recording_of_another_run_is_rebuilt(run: Path, content: str) -> None:
    other = rollout.run(Scenario.load("classic-ellipse", [*BRIEF, "servo.kp=20.0"]))
    own = run / "recording.rrd"
    shutil.copy(other.write(run.parent / "other") / "recording.rrd", own)
    assert digest(own) != content
    with recording_file.opened([run]) as file:
        assert file == own
    assert digest(own) == content

    # What was rebuilt is known as the run's.
    rebuilt = own.stat().st_mtime_ns
    with recording_file.opened([run]):
        assert own.stat().st_mtime_ns == rebuilt


def test_in_a_directory_one_may_not_write_in_it_is_temporary(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = digest(run / "recording.rrd")
    make = tempfile.mkstemp
    (run / "recording.rrd").write_bytes(b"old")

    def refuse(*args: object, dir: Path, **kwargs: object) -> tuple[int, str]:
        if dir == run:  # permissions do not stop the superuser, who may run the tests
            raise PermissionError(13, "Permission denied")
        return make(*args, dir=dir, **kwargs)  # pyright: ignore[reportCallIssue, reportArgumentType]

    monkeypatch.setattr(tempfile, "mkstemp", refuse)
    with recording_file.opened([run]) as file:
        assert file.is_relative_to(run.parent / "temporary")
        assert digest(file) == content
    assert (run / "recording.rrd").read_bytes() == b"old"
    assert os.listdir(run.parent / "temporary") == []


def test_several_are_one_temporary_file(run: Path) -> None:
    other = run.parent / "other"
    shutil.copytree(run, other)
    before = {path: path.stat().st_mtime_ns for path in run.parent.glob("*/*")}
    with recording_file.opened([run, other]) as file:
        check.read_through(file)
        assert file.is_relative_to(run.parent / "temporary")
    assert {path: path.stat().st_mtime_ns for path in run.parent.glob("*/*")} == before
    assert os.listdir(run.parent / "temporary") == []


def test_runs_are_called_as_their_directories_or_by_their_paths(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert recording_file.labels_of([Path("a"), Path("b/c")]) == ["a", "c"]
    paths = [Path("a/trot"), Path("b/trot")]
    assert recording_file.labels_of(paths) == [str(tmp_path / path) for path in paths]
    with pytest.raises(ConfigError, match=r"run directories must be different, got b/\.\./a twice"):
        recording_file.labels_of([Path("b"), Path("b/../a"), Path("a")])


def test_what_lacks_more_than_the_recording_is_no_run(run: Path) -> None:
    (run / "recording.rrd").unlink()
    (run / "rollout.parquet").unlink()
    lacks = r"is not a run directory: it lacks rollout\.parquet, recording\.rrd; `fivebar run "
    with pytest.raises(RunDirectoryError, match=lacks), recording_file.opened([run]):
        pass
