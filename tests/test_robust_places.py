"""One place, several writers: the last one wins whole, and what a killed one left is swept."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from shell import LIGHT, Shell

from fivebar_sim import rollout
from fivebar_sim.files import leftovers
from fivebar_sim.recording import rrd
from fivebar_sim.rollout import Result
from fivebar_sim.runs import directory, stored
from fivebar_sim.scenario import Scenario

fcntl = pytest.importorskip("fcntl", reason="this system has no locks on directories")


@pytest.fixture(scope="module")
def results() -> list[Result]:
    return [
        rollout.run(Scenario.load("classic-ellipse", [f"duration={duration}"]))
        for duration in (0.75, 0.9)
    ]


def test_two_runs_at_once_leave_one_whole_run(shell: Shell) -> None:
    before = shell.names()
    program = f"{LIGHT}from fivebar_sim.cli import main; sys.exit(main())"
    run = ["run", "short.toml", "--quiet", "--out", "mine"]
    command = [sys.executable, "-c", program, *run]
    started = [subprocess.Popen(command, stderr=subprocess.PIPE) for _ in range(2)]
    said = [process.communicate()[1] for process in started]
    assert said == [b"", b""]
    assert [process.returncode for process in started] == [0, 0]
    assert shell.names() == before | {"mine", *(f"mine/{name}" for name in directory.FILES)}
    assert len(stored.read(Path("mine")).record["time"]) == 600


def test_many_writers_of_one_place_all_end_well(
    tmp_path: Path, results: list[Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a recording they meet the more often: it takes most of the time."""
    monkeypatch.setattr(rrd, "write", lambda path, *run: path.write_bytes(b"RRF2"))
    place = tmp_path / "mine"
    errors = list[BaseException]()

    def write(result: Result) -> None:
        try:
            for _ in range(5):
                result.write(place)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=write, args=(result,)) for result in 2 * results]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert os.listdir(tmp_path) == ["mine"]
    run = stored.read(place)
    assert len(run.record["time"]) == run.scenario.steps


@pytest.mark.usefixtures("two_steps")
@pytest.mark.parametrize("there", [False, True])
def test_a_place_taken_in_between_is_exchanged_anew(
    tmp_path: Path, results: list[Result], monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    place = tmp_path / "mine"
    rename = Path.rename
    overtaken = []
    if there:
        results[0].write(place)

    def late(self: Path, target: Path) -> Path:
        if len(overtaken) < 2 and self.name.endswith(".partial"):
            overtaken.append(self)
            monkeypatch.setattr(Path, "rename", rename)
            results[0].write(place)  # another one was first
            monkeypatch.setattr(Path, "rename", late)
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", late)
    results[1].write(place)
    assert len(overtaken) == 2
    assert stored.read(place).scenario.duration == 0.9
    assert os.listdir(tmp_path) == ["mine"]


def test_what_always_fails_is_not_tried_for_ever(
    tmp_path: Path, results: list[Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = []

    def never(self: Path, target: Path) -> Path:
        tried.append(target)
        raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))

    monkeypatch.setattr(Path, "rename", never)
    with pytest.raises(OSError, match=r"cannot write .*: No such file or directory$"):
        results[0].write(tmp_path / "mine")
    assert len(tried) == directory.ATTEMPTS
    assert os.listdir(tmp_path) == []


def test_what_a_killed_run_left_is_swept_by_the_next_one(
    tmp_path: Path, results: list[Result]
) -> None:
    left = [".mine.abcdefgh.partial", ".mine.a_cdefg0.old"]
    others = [".mine.x.partial", ".other.abcdefgh.partial", "mine.abcdefgh.partial", ".mine.new"]
    fresh = ".mine.freshone.partial"
    held = ".mine.heldhere.partial"
    for name in (*left, *others, fresh, held):
        (tmp_path / name).mkdir()
        (tmp_path / name / "rollout.parquet").touch()
    (tmp_path / ".mine.linklink.partial").symlink_to(".other.abcdefgh.partial")
    long_ago = time.time() - 2.0 * leftovers.OLD
    for name in (*left, *others, held):
        os.utime(tmp_path / name, (long_ago, long_ago))
    with leftovers.held(tmp_path / held):
        results[0].write(tmp_path / "mine")
    kept = {"mine", *others, fresh, held, ".mine.linklink.partial"}
    assert set(os.listdir(tmp_path)) == kept
    results[0].write(tmp_path / "mine")  # its holder has gone
    assert set(os.listdir(tmp_path)) == kept - {held}
