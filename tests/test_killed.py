"""Runs killed at any moment: what is left at their place is a whole run, or nothing."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from fivebar_sim.runs import directory, stored

WRITER = Path(__file__).with_name("writer.py")
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")


class Writer:
    """The writing process, and the place where it writes."""

    def __init__(self, place: Path) -> None:
        self.place = place
        command = [sys.executable, str(WRITER), str(place)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self.takes = float(self._line())

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def _start(self) -> int:
        assert self.process.stdin is not None
        self.process.stdin.write("go\n")
        return int(self._line())

    def kill_after(self, seconds: float) -> None:
        """Start to write, and kill what writes."""
        child = self._start()
        time.sleep(seconds)
        os.kill(child, signal.SIGKILL)

    def kill_once_written(self) -> None:
        """Start to write, and kill what writes as soon as a run is there."""
        child = self._start()
        while not self.place.exists():
            os.kill(child, 0)  # raises if it has ended by itself
            time.sleep(0.01)
        os.kill(child, signal.SIGKILL)

    def stop(self) -> None:
        """End the process."""
        self.process.communicate(timeout=30)


@pytest.fixture
def writer(tmp_path: Path, quick_start: None) -> Iterator[Writer]:
    started = Writer(tmp_path / "run")
    yield started
    started.stop()


def check(writer: Writer) -> str:
    """Return what is left, "nothing" or "run"; a run must be whole."""
    if not writer.place.exists():
        return "nothing"
    run = stored.read(writer.place)
    assert run.scenario.duration in (1.0, 1.2)
    assert len(run.record["time"]) == run.scenario.steps
    assert directory.is_run(writer.place)
    assert (writer.place / "recording.rrd").read_bytes()[:4] == b"RRF2"
    return "run"


def killed(writer: Writer, times: int, seed: int) -> None:
    rng = random.Random(seed)
    left = []
    for _ in range(times):
        writer.kill_after(rng.uniform(0.0, 3.0 * writer.takes))
        left.append(check(writer))
    # On a machine under load none of them may have come so far.
    writer.kill_once_written()
    left.append(check(writer))
    assert "run" in left


def test_killed_runs_are_whole_or_absent(writer: Writer) -> None:
    killed(writer, 5, seed=1)


@pytest.mark.long
def test_five_hundred_killed_runs_are_whole_or_absent(writer: Writer) -> None:
    killed(writer, 500, seed=2)
