"""The shipped controllers beside a user's own folder called controllers."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = """
from controllers.servo import MINE

from fivebar_sim import Scenario, run

result = run(Scenario.load("classic-ellipse", ["duration=0.8"]))
print(MINE, type(result.scenario.controller).__module__)
"""


def test_own_folder_of_controllers_does_not_collide(tmp_path: Path) -> None:
    (tmp_path / "controllers").mkdir()
    (tmp_path / "controllers" / "servo.py").write_text("MINE = 'mine'\n", encoding="utf-8")
    (tmp_path / "script.py").write_text(SCRIPT, encoding="utf-8")
    command = [sys.executable, "script.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "mine fivebar_controllers.servo\n"
