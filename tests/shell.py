"""A shell for tests: the command `fivebar` as a function, in a folder of its own."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from fivebar_sim import cli

ELLIPSE = """
name = "short"
duration = 0.6
[path]
kind = "ellipse"
centre = [0.0, -0.072]
radii = [0.02, 0.008]
frequency = 4.0
ramp = 0.1
"""
JUDGED = ELLIPSE + "[limits]\ntracking.rms = 0.02\n"
CSV = "time_s,x_mm,z_mm\n0,0,-80\n0.2,10,-75\n0.4,0,-70\n0.6,-10,-75\n"


def started(command: Sequence[str], interrupt: Any = None, **more: Any) -> subprocess.Popen[Any]:
    """Start a program as a terminal does, whatever the tests were started with.

    What is started behind `&` in a script ignores Ctrl-C, and so do its children: a handler of this
    process is not inherited, but that a signal is ignored is.

    Args:
        command: The program and its arguments.
        interrupt: Handler of SIGINT meanwhile; None is Python's, SIG_IGN starts it ignoring that.
        more: As of Popen; stdout and stderr are pipes.
    """
    before = signal.signal(signal.SIGINT, interrupt or signal.default_int_handler)
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    try:
        return subprocess.Popen(command, **(pipes | more))
    finally:
        signal.signal(signal.SIGINT, before)


LIGHT = """
import sys, types
rrd = types.ModuleType("fivebar_sim.recording.rrd")
rrd.write = lambda path, *run: path.write_bytes(b"RRF2")
sys.modules[rrd.__name__] = rrd
"""
"""Before a program: it writes no recording but its first bytes, and does not import Rerun."""


class Said(NamedTuple):
    """What a command came to."""

    status: int
    out: str
    err: str


class Shell:
    """Runs commands in a folder that holds short.toml, within this process."""

    def __init__(self, folder: Path, capture: pytest.CaptureFixture[str]) -> None:
        self.folder = folder
        self.capture = capture

    def __call__(self, *args: str) -> Said:
        """Return what a command came to."""
        self.capture.readouterr()
        status = cli.main(args)
        out, err = self.capture.readouterr()
        return Said(status, out, err)

    def names(self) -> set[str]:
        """Return everything in the folder."""
        return {str(path.relative_to(self.folder)) for path in self.folder.rglob("*")}

    def refused(self, *args: str, status: int = 2) -> str:
        """Return the one line on stderr of a command that changes nothing."""
        before = self.names()
        said = self(*args)
        assert (said.status, said.out) == (status, "")
        assert said.err.startswith("fivebar: ")
        assert said.err.endswith("\n")
        assert said.err.count("\n") == 1
        assert self.names() == before
        return said.err.removeprefix("fivebar: ").rstrip("\n")
