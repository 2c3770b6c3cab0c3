"""Mutants of kinematics, dynamics and metrics: some that must die, and --long a sample of each."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[1] / "scripts"


def run(script: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Run a script outside of this run of pytest."""
    environment = {key: value for key, value in os.environ.items() if key[:6] != "PYTEST"}
    command = [sys.executable, str(SCRIPTS / script), *options]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_some_known_mutants_die() -> None:
    done = run("mutate_quick.py", "--count", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "3 of 3 mutants killed"


@pytest.mark.long
def test_all_known_mutants_die() -> None:
    done = run("mutate_quick.py", "--all")
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.long
def test_nine_of_ten_mutants_of_each_room_die() -> None:
    done = run("mutate.py", "--sample", "400")
    assert done.returncode == 0, done.stdout + done.stderr
    scores = [line for line in done.stdout.splitlines() if "% of 400 mutants" in line]
    assert [line.split(":")[0] for line in scores] == ["kinematics", "dynamics", "metrics"]
