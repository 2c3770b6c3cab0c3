"""`fivebar identify`: a log as a file, what is printed and written, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from test_identify import made, plain

from fivebar_sim import cli
from fivebar_sim.cli.common import screen
from fivebar_sim.cli.identified import Told, print_told
from fivebar_sim.identify.motions import Suggestion

KEYS = ("servo.kp", "servo.delay")
FIT = [word for key in KEYS for word in ("--fit", key)]
MINE = """
duration = 2.0
scene = { kind = "payload", mass = 0.15 }
path = { kind = "ellipse", centre = [0.0, -0.072], radii = [0.020, 0.008], frequency = 2.0 }
sim = { timestep = 0.0025 }

[servo]
preset = "xl330-m288"
delay = 0.004
friction = { model = "constant", base = 0.012, viscous = 0.004 }
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    log = made(1, KEYS, 1.2).log
    table = np.column_stack([log.time, log.theta, log.ctrl])
    head = "time,theta_A,theta_E,ctrl_A,ctrl_E"
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=head, comments="")
    np.savetxt(tmp_path / "bare.csv", table[:, :3], delimiter=",", header=head[:20], comments="")
    (tmp_path / "mine.toml").write_text(MINE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_log_becomes_numbers_and_presets(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    args = ["identify", "mine.toml", "log.csv", *FIT, "--held-out", "log.csv", "--threads", "1"]
    assert cli.main([*args, "--json", "--out", "found.toml", "--motion", "motion.csv"]) == 0
    said = json.loads(capsys.readouterr().out)
    truth = dict(zip(KEYS, made(1, KEYS, 1.2).truth, strict=True))
    for key in KEYS:
        number = said["numbers"][key]
        assert abs(number["value"] - truth[key]) < 2.0 * number["half_width"]
        assert number["remark"] == ""
    assert said["held_out"]["log.csv"]["after"] == pytest.approx(said["rms"]["after"][0])
    assert "fivebar from log.csv, starting from mine" in Path("found-servo.toml").read_text()
    motion = np.loadtxt(folder / "motion.csv", delimiter=",", skiprows=1)
    assert motion.shape == (241, 3)


def test_what_is_printed_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    first = np.random.default_rng(3).standard_normal((400, 1))
    found = plain(np.concatenate([first, -(1.0 + 1e-9) * first], axis=1))
    best = Suggestion("fast", 0.6, np.zeros(2), np.zeros((2, 2)), np.array([1e-4, 2e-4]))
    told = Told(found, ["a.csv"], {"b.csv": (1e-3, 2e-3)}, [best])
    print_told(told, screen())
    printed = capsys.readouterr().out
    assert "leg.L4" in printed
    assert "not identified" in printed
    assert "a.csv: angles off by 0 mrad RMS before, 0 mrad now" in printed
    assert "b.csv: angles off by 1 mrad RMS before, 2 mrad now (held out): FAIL" in printed
    assert "the motion does not tell 0.71 leg.L1 + 0.71 leg.L4" in printed
    assert "a motion that would tell more: 'fast', swings of 0.6 rad; of it leg.L4" in printed


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["mine.toml"], "identify needs at least one LOG"),
        (["mine.toml", "no.csv"], "no.csv"),
        (["mine.toml", "bare.csv"], "bare.csv: ctrl_A, ctrl_E is missing: identify compares"),
        (["mine.toml", "log.csv", "--fit", "leg.mass"], "'leg.mass' cannot be identified"),
        (["mine.toml", "log.csv", "--out", "found.txt"], "--out must end in .toml, got found.txt"),
        (["rail-landing", "log.csv"], "identify needs a leg that hangs"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_refusal(args: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["identify", *args]) == 2
    assert message in capsys.readouterr().err
