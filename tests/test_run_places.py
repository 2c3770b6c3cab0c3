"""Where a run directory may be written, and what stays there if it cannot be."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from pathlib import Path
from typing import Any, NoReturn

import pytest
from run_directories import a_result, names

from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.recording import rrd
from fivebar_sim.rollout import Result
from fivebar_sim.runs import directory
from fivebar_sim.runs.directory import FILES


@pytest.fixture(scope="module")
def result() -> Result:
    return a_result()


# refusal


def test_what_is_not_ours_is_refused_and_untouched(tmp_path: Path, result: Result) -> None:
    (tmp_path / "file").write_text("precious", encoding="utf-8")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "metrics.json").write_text("precious", encoding="utf-8")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    before = names(tmp_path)
    for name in ("file", "folder", "dangling"):
        with pytest.raises(RunDirectoryError) as caught:
            result.write(tmp_path / name)
        what = "something that is not a run directory is there"
        assert str(caught.value) == f"cannot write {tmp_path / name}: {what}"
        assert isinstance(caught.value, OSError)
    assert names(tmp_path) == before
    assert (tmp_path / "file").read_text(encoding="utf-8") == "precious"
    assert names(tmp_path / "folder") == {"metrics.json"}


def test_place_that_cannot_be_is_refused(tmp_path: Path, result: Result) -> None:
    (tmp_path / "file").touch()
    for name, message in {
        "file/mine": f"{tmp_path / 'file'} is not a directory one may write in",
        "x" * 300: "File name too long",
        f"{'x' * 300}/mine": "File name too long",
    }.items():
        with pytest.raises(RunDirectoryError) as caught:
            result.write(tmp_path / name)
        assert str(caught.value) == f"cannot write {tmp_path / name}: {message}"
    assert names(tmp_path) == {"file"}


def test_place_that_may_not_be_written_is_refused(
    tmp_path: Path, result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    # root may write anywhere, so the answer of the system is replaced
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(RunDirectoryError, match=r"is not a directory one may write in$"):
        result.write(tmp_path / "mine")
    assert not names(tmp_path)


@pytest.mark.parametrize("there", [False, True])
def test_full_disk_leaves_what_was_there(
    tmp_path: Path, result: Result, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    where = tmp_path / "mine"
    if there:
        result.write(where)
        (where / "notes.txt").touch()

    def full(*args: object) -> NoReturn:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(rrd, "write", full)
    with pytest.raises(RunDirectoryError) as caught:
        result.write(where)
    assert str(caught.value) == f"cannot write {where}: No space left on device"
    assert names(tmp_path) == ({"mine"} if there else set())
    assert not there or names(where) == {*FILES, "notes.txt"}


@pytest.mark.usefixtures("light", "two_steps")
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(errno.EIO, "Input/output error")])
def test_interrupt_between_the_renames_brings_the_old_run_back(
    tmp_path: Path, result: Result, monkeypatch: pytest.MonkeyPatch, error: Any
) -> None:
    where = result.write(tmp_path / "mine")
    (where / "notes.txt").touch()
    rename = Path.rename

    def broken(self: Path, target: Path) -> Path:
        if self.name.endswith(".partial"):
            raise error
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", broken)
    with pytest.raises((KeyboardInterrupt, RunDirectoryError)):
        result.write(where)
    assert names(where) == {*FILES, "notes.txt"}
    assert names(tmp_path) == {"mine"}


@pytest.mark.usefixtures("light")
@pytest.mark.parametrize("missing", FILES)
def test_incomplete_run_is_none(tmp_path: Path, result: Result, missing: str) -> None:
    where = result.write(tmp_path / "mine")
    (where / missing).unlink()
    assert not directory.is_run(where)
    with pytest.raises(RunDirectoryError) as caught:
        directory.check_run(where)
    again = f"; `fivebar run {where}/scenario.toml --out DIR` makes it again, in another place"
    hint = "" if missing == "scenario.toml" else again
    assert str(caught.value) == f"{where} is not a run directory: it lacks {missing}{hint}"
    with pytest.raises(RunDirectoryError, match=r"no such directory$"):
        directory.check_run(tmp_path / "nowhere")


# exchange


@pytest.mark.skipif(sys.platform != "linux", reason="no other system exchanges directories")
@pytest.mark.usefixtures("light")
def test_there_is_no_moment_without_a_run(
    tmp_path: Path, result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What kills the program between two renames would leave none."""
    where = result.write(tmp_path / "mine")
    (where / "notes.txt").touch()

    def never(*args: object) -> NoReturn:
        raise AssertionError("the old run was moved aside")

    monkeypatch.setattr(Path, "rename", never)
    result.write(where)
    assert names(where) == {*FILES, "notes.txt"}
    assert names(tmp_path) == {"mine"}


@pytest.mark.usefixtures("light")
def test_a_run_without_its_recording_is_replaced(tmp_path: Path, result: Result) -> None:
    where = result.write(tmp_path / "mine")
    (where / "recording.rrd").unlink()
    result.write(where)
    assert names(where) == set(FILES)


@pytest.mark.usefixtures("light")
def test_a_link_to_a_run_is_replaced_by_a_run(tmp_path: Path, result: Result) -> None:
    result.write(tmp_path / "mine")
    (tmp_path / "link").symlink_to(tmp_path / "mine")
    result.write(tmp_path / "link")
    assert names(tmp_path) == {"mine", "link"}
    assert names(tmp_path / "mine") == set(FILES)


@pytest.mark.usefixtures("light")
@pytest.mark.parametrize("steps", ["one", "two"])
def test_interrupt_while_deleting_leaves_nothing(
    tmp_path: Path,
    result: Result,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
    steps: str,
) -> None:
    if steps == "two":
        request.getfixturevalue("two_steps")
    where = result.write(tmp_path / "mine")
    delete = shutil.rmtree

    def interrupted(path: Path, **how: bool) -> None:
        monkeypatch.setattr(shutil, "rmtree", delete)
        raise KeyboardInterrupt

    monkeypatch.setattr(shutil, "rmtree", interrupted)
    with pytest.raises(KeyboardInterrupt):
        result.write(where)
    assert names(tmp_path) == {"mine"}
    assert names(where) == set(FILES)
