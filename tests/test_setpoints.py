"""Tables of setpoints: the angles of the path, what servos take, and text that C and CSV read."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from fivebar_sim import kinematics, setpoints
from fivebar_sim.control import hobby
from fivebar_sim.errors import ArgumentError, ConfigError, UnreachableError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.scenario import Scenario
from fivebar_sim.setpoints import text
from fivebar_sim.setpoints.commands import SERVOS

STEP = """
duration = 1.0
leg = "classic"
[path]
kind = "lines"
points = [[0.0, -0.07], [0.01, -0.08]]
seconds = 0.3
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    return Shell(tmp_path, capsys)


@pytest.fixture(scope="module")
def ellipse() -> Scenario:
    return Scenario.load("classic-ellipse")


def test_rows_of_a_period_put_the_foot_on_the_path(ellipse: Scenario) -> None:
    period = ellipse.path.period
    assert period is not None
    table = setpoints.rows(ellipse, 60.0 / period)
    assert (table.periodic, table.theta.shape) == (True, (60, 2))
    times = np.arange(60) * period / 60.0
    foot = kinematics.forward(ellipse.leg, table.theta)
    # 1e-12: rounding of forward and inverse, some eps of 0.1 m over the sine of the least angle.
    np.testing.assert_allclose(foot, ellipse.path.nominal(times).position, rtol=0, atol=1e-12)
    # At the seam as everywhere: no row is far from the one before, whatever the turns.
    steps = np.diff(table.theta, axis=0, append=table.theta[:1])
    assert np.abs(steps).max() < 0.3


def test_path_without_a_period_goes_to_its_end(tmp_path: Path) -> None:
    (tmp_path / "step.toml").write_text(STEP)
    scenario = Scenario.load(tmp_path / "step.toml")
    table = setpoints.rows(scenario, 20.0)
    assert (table.periodic, len(table.theta)) == (False, 7)
    ends = kinematics.forward(scenario.leg, table.theta[[0, -1]])
    np.testing.assert_allclose(ends, [[0.0, -0.07], [0.01, -0.08]], rtol=0, atol=1e-12)


def test_angles_go_on_over_half_a_turn(tmp_path: Path) -> None:
    """A servo that turns past its back must not be sent a whole turn round."""
    (tmp_path / "step.toml").write_text(
        STEP.replace("[[0.0, -0.07], [0.01, -0.08]]", "[[-0.065, 0.0], [-0.055, 0.06]]")
    )
    scenario = Scenario.load(tmp_path / "step.toml")
    theta = setpoints.rows(scenario, 100.0).theta
    foot = kinematics.forward(scenario.leg, theta)
    jumps = np.diff(kinematics.inverse(scenario.leg, foot), axis=0)
    assert np.abs(jumps).max() > 6.0
    assert np.abs(np.diff(theta, axis=0)).max() < 0.2


def test_commands_are_the_servos(ellipse: Scenario) -> None:
    leg = ellipse.leg
    theta = setpoints.rows(ellipse, 100.0).theta
    assert setpoints.commands(leg, theta, "rad").values is theta
    degrees = setpoints.commands(leg, theta, "deg").values
    np.testing.assert_array_equal(degrees, np.degrees(theta))

    # Whole degrees: what `hobby.servo_angles` commands.
    count = setpoints.commands(leg, theta, "count").values
    np.testing.assert_array_equal(count, np.rint(np.degrees(hobby.servo_angles(leg, theta))))
    # 500 to 2500 us over 180 deg: 11.1 us a degree.
    pulse = setpoints.commands(leg, theta, "us").values
    offset = np.radians([225.0, 135.0])
    exact = 500.0 + np.degrees(theta + offset) * 2000.0 / 180.0
    assert np.abs(pulse - exact).max() <= 0.5 + 1e-6
    fine = setpoints.commands(leg, theta, "count", ends=(0, 2047)).values
    back = fine / 2047.0 * np.pi - offset
    assert np.abs(back - theta).max() <= 0.5 * np.pi / 2047.0 * (1.0 + 1e-6)
    # 4096 counts a turn, 2048 where the cranks point 45 deg outwards and down.
    turn = setpoints.commands(leg, theta, "count", servos="xl330").values
    exact = 2048.0 + (theta + np.radians([135.0, 45.0])) * 4096.0 / (2.0 * np.pi)
    assert np.abs(turn - exact).max() <= 0.5 + 1e-6


def test_published_conversions_differ_by_their_rounding() -> None:
    """An upright leg; by hand: 12.7 deg is 103 rounded and 102 cut off, -12.7 deg 77 and 78."""
    leg = FiveBar.load("airhockey")
    theta = np.radians([[12.7, -12.7], [12.5, -12.5], [45.0, -90.0]])
    rounded = setpoints.commands(leg, theta, "published-rounded").values
    cut = setpoints.commands(leg, theta, "published-truncated").values
    assert rounded.tolist() == [[103, 77], [103, 78], [135, 0]]
    assert cut.tolist() == [[102, 78], [102, 78], [135, 0]]
    # The rounded one is the servo table of that name.
    table = np.rint(np.degrees(hobby.servo_angles(leg, theta, SERVOS["published"])))
    np.testing.assert_array_equal(rounded, table)


@pytest.mark.parametrize("unit", setpoints.UNITS)
def test_header_compiles_and_holds_the_numbers(unit: str, tmp_path: Path) -> None:
    scenario = Scenario.load("classic-ellipse", ["leg.name=odd */ name"])
    table = setpoints.rows(scenario, 50.0)
    if unit.startswith("published"):
        table = table._replace(theta=table.theta + np.radians([135.0, 45.0]))
    sent = setpoints.commands(scenario.leg, table.theta, unit)
    place = tmp_path / "gait.h"
    setpoints.write(place, table, sent)
    source = place.read_text()
    assert "leg odd ? name" in source
    compiler = shutil.which("cc")
    if compiler is None:
        return
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "gait.h"\n'
        "int main(void) { int k; for (k = 0; k < CLASSIC_ELLIPSE_ROWS; k++)\n"
        'printf("%.9g %.9g\\n", (double)classic_ellipse[k][0], (double)classic_ellipse[k][1]);\n'
        'printf("%.9g %d\\n", (double)CLASSIC_ELLIPSE_RATE, CLASSIC_ELLIPSE_PERIODIC);\n'
        "return 0; }\n"
    )
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
    command = [compiler, *flags, str(tmp_path / "main.c"), "-o", str(tmp_path / "main")]
    subprocess.run(command, check=True)
    run = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=True)
    *lines, last = [line.split() for line in run.stdout.splitlines()]
    assert last == ["50", "1"]
    np.testing.assert_array_equal(np.array(lines, dtype=np.float32), sent.values.astype(np.float32))


def test_csv_holds_the_numbers(ellipse: Scenario) -> None:
    table = setpoints.rows(ellipse, 50.0)
    sent = setpoints.commands(ellipse.leg, table.theta, "us")
    lines = setpoints.csv(table, sent).splitlines()
    assert lines[0] == "time_s,A_us,E_us"
    read = np.array([line.split(",") for line in lines[1:]], dtype=float)
    np.testing.assert_array_equal(read[:, 1:], sent.values)
    np.testing.assert_allclose(read[:, 0], np.arange(len(read)) / 50.0, atol=1e-12)


def test_names_become_c_s() -> None:
    assert text.c_name("q8bot-trot") == "q8bot_trot"
    assert text.c_name("9 lives!") == "gait_9_lives"
    assert text.c_name("é") == "gait"


def test_refusals(ellipse: Scenario, tmp_path: Path) -> None:
    with pytest.raises(
        ArgumentError,
        match=r"whole number of rows .* 0\.5 s, got 33 Hz, 16\.5 rows; use 32 or 34 Hz",
    ):
        setpoints.rows(ellipse, 33.0)
    with pytest.raises(ArgumentError, match="rate must be"):
        setpoints.rows(ellipse, 0.0)
    with pytest.raises(ArgumentError, match="at least 2 rows"):
        setpoints.rows(ellipse, 2.0)
    theta = setpoints.rows(ellipse, 50.0).theta
    with pytest.raises(
        UnreachableError, match=r"\[0, 180\] deg at A, got .* legs that stand upright"
    ):
        setpoints.commands(ellipse.leg, theta, "published-rounded")
    with pytest.raises(ConfigError, match="unknown unit 'grad'"):
        setpoints.commands(ellipse.leg, theta, "grad")
    with pytest.raises(ConfigError, match="unknown servo table"):
        setpoints.commands(ellipse.leg, theta, "us", servos="hangin")
    with pytest.raises(ConfigError, match="--ends must be two whole numbers that grow"):
        setpoints.commands(ellipse.leg, theta, "us", ends=(2500, 500))
    table = setpoints.rows(ellipse, 50.0)
    with pytest.raises(ConfigError, match=r"must end in \.h or \.csv"):
        setpoints.write(tmp_path / "a.txt", table, setpoints.commands(ellipse.leg, theta, "rad"))


def test_command_writes_a_table(shell: Shell, tmp_path: Path) -> None:
    out = shell("export", "classic-ellipse", "--table", "a.csv", "--unit", "us")
    words = "servo commands, 500 to 2500: servo table 'hanging'"
    assert out == (0, f"classic-ellipse: 25 rows, {words}, written to a.csv\n", "")
    first = shell("export", "q8bot-trot", "--table", "b.h", "--unit", "count", "--servos", "xl330")
    assert first.status == 0
    assert "static const uint16_t q8bot_trot[" in (tmp_path / "b.h").read_text()
    said = shell("export", "classic-ellipse", "--table", "c.h", "--unit", "us", "--ends", "0", "9")
    assert "static const uint8_t classic_ellipse[" in (tmp_path / "c.h").read_text()
    assert said.status == 0


def test_command_refuses_in_one_line(shell: Shell) -> None:
    assert shell.refused("export", "q8bot-trot").startswith("say what to export: --mjcf FILE")
    one = ("export", "classic-ellipse", "--table", "a.h")
    assert shell.refused(*one, "--c", "x").endswith("export one at a time")
    assert shell.refused(*one, "--ends", "0", "9") == (
        "--ends is for the units count and us, got rad"
    )
    assert shell.refused(*one, "--unit", "published-rounded").startswith("90 deg + angle must be")
    assert shell.refused(*one, "--rate", "33").endswith("use 32 or 34 Hz")
    assert shell.refused("export", "classic", "--table", "a.h").startswith("unknown scenario")
    assert shell.refused("export", "classic-ellipse", "--table", "a.txt").startswith("cannot write")
