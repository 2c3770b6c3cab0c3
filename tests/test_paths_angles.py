"""A table of motor angles as a foot path: forward kinematics, smooth, refused where impossible."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from fivebar_sim import Scenario, kinematics
from fivebar_sim.errors import ArgumentError, ConfigError, LoopOpenError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.foot_motion import foot_motion
from fivebar_sim.logs import load
from fivebar_sim.paths import Angles, Csv
from fivebar_sim.scenario import forces

FOLDER = Path(__file__).parent / "logs"
CLASSIC = FiveBar.load("classic")
TRUTH = load(FOLDER / "truth.csv")
GERMAN = {
    "time": {"column": "Zeit [ms]", "unit": "ms"},
    "theta_A": {"column": "Winkel A [°]", "unit": "deg"},
    "theta_E": {"column": "Winkel E [°]", "unit": "deg"},
}


def table(**path: Any) -> dict[str, Any]:
    own = {"kind": "angles", "file": "truth.csv", "ramp": 0.0, **path}
    return {"name": "played", "leg": "classic", "duration": 0.1, "path": own}


def scenario(**path: Any) -> Scenario:
    return Scenario.from_table(table(**path), "mine.toml", FOLDER)


# law


@pytest.mark.parametrize("leg", [CLASSIC, FiveBar.load("extended")], ids=lambda leg: leg.name)
def test_the_motors_motion_gives_the_foot_whose_joints_move_so(leg: FiveBar) -> None:
    rest = kinematics.home(leg)[::2]
    rng = np.random.default_rng(3)
    theta = rest + rng.uniform(-0.1, 0.1, (20, 2))
    rates = rng.normal(0.0, 10.0, (2, 20, 2))
    moved = foot_motion(leg, theta, *rates)
    back = kinematics.joint_motion(leg, *moved)
    for found, due in zip(back, (theta, *rates), strict=True):
        np.testing.assert_allclose(found[:, ::2], due, rtol=1e-9, atol=1e-9)


def test_the_foot_is_that_of_forward_kinematics_at_every_row() -> None:
    path = scenario().path
    due = kinematics.forward(CLASSIC, TRUTH.pair("theta"))
    np.testing.assert_allclose(path.nominal(TRUTH.time).position, due, rtol=0.0, atol=1e-12)


def test_the_foot_is_smooth_up_to_its_acceleration() -> None:
    path = scenario().path
    knots = TRUTH.time[1:-1]
    tiny = 1e-9
    before = path.nominal(knots - tiny)
    after = path.nominal(knots + tiny)
    # The angles' third derivative is some 1e4 rad/s^3: between them nothing but that may show.
    for k, most in enumerate((1e-8, 1e-7, 1e-4)):
        np.testing.assert_allclose(after[k], before[k], rtol=0.0, atol=most)
    step = 1e-6
    inner = np.linspace(0.01, 0.1, 7)
    ahead = path.nominal(inner + step)
    behind = path.nominal(inner - step)
    here = path.nominal(inner)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * step), here[1], rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * step), here[2], rtol=1e-4, atol=1e-3)


def test_any_log_is_a_path_by_its_columns() -> None:
    due = scenario().path.nominal(TRUTH.time).position
    found = scenario(file="excel_german.csv", columns=GERMAN).path.nominal(TRUTH.time).position
    np.testing.assert_allclose(found, due, atol=1e-7)
    stamps = {"time": "stamp", "theta_A": "q_A", "theta_E": "q_E"}
    found = scenario(file="log.parquet", columns=stamps).path.nominal(TRUTH.time).position
    np.testing.assert_allclose(found, due, atol=1e-8)


def test_angles_may_be_taken_as_given() -> None:
    middle = 0.5 * (TRUTH.time[1:] + TRUTH.time[:-1])
    theta = TRUTH.pair("theta")
    lines = scenario(interpolation="linear").path
    halfway = kinematics.forward(CLASSIC, 0.5 * (theta[1:] + theta[:-1]))
    np.testing.assert_allclose(lines.nominal(middle).position, halfway, atol=1e-12)
    held = scenario(interpolation="hold").path
    due = kinematics.forward(CLASSIC, theta)
    np.testing.assert_allclose(held.nominal(middle).position, due[:-1], rtol=0.0, atol=1e-12)
    assert not held.nominal(middle).velocity.any()
    for path in (lines, held):
        np.testing.assert_allclose(path.nominal(TRUTH.time).position, due, rtol=0.0, atol=1e-12)
        assert path.span == TRUTH.time[-1]


@pytest.mark.parametrize("kind", ["path", "force"])
def test_any_log_is_a_foot_path_or_a_force_by_its_columns(kind: str, tmp_path: Path) -> None:
    unit = "mm" if kind == "path" else "mN"
    rows = "".join(f"{5 * k};{k},5;{-80 - k}\n" for k in range(5))
    (tmp_path / "bench.csv").write_text("ms;vor;hoch\n" + rows)
    columns = {
        "time": {"column": "ms", "unit": "ms"},
        "x": {"column": "vor", "unit": unit},
        "z": {"column": "hoch", "unit": unit, "sign": -1},
    }
    table = {"file": "bench.csv", "columns": columns}
    part: Any = Csv(**table, ramp=0.0) if kind == "path" else forces.Csv(**table)
    part = part.resolve(tmp_path)
    time = np.array([0.0, 0.005, 0.02])
    found = part.nominal(time).position if kind == "path" else part.at(time, Csv(**table))
    np.testing.assert_allclose(found, [[5e-4, 0.08], [1.5e-3, 0.081], [4.5e-3, 0.084]], atol=1e-15)
    with pytest.raises(ConfigError, match="x is missing"):
        msgspec.structs.replace(part, columns={"time": "ms", "z": "hoch"}).check_file()


# edge


def test_another_leg_gets_another_foot_path() -> None:
    one = scenario()
    longer = FiveBar(L1=0.04, L2=0.065, L3=0.065, L4=0.04, L5=0.03)
    other = msgspec.structs.replace(one, leg=longer)
    due = kinematics.forward(longer, TRUTH.pair("theta"))
    np.testing.assert_allclose(other.path.nominal(TRUTH.time).position, due, atol=1e-12)
    assert np.abs(other.path.nominal(0.0).position - one.path.nominal(0.0).position).max() > 1e-3


def test_the_file_goes_with_the_resolved_scenario(tmp_path: Path) -> None:
    one = scenario(
        file="log.parquet", columns={"time": "stamp", "theta_A": "q_A", "theta_E": "q_E"}
    )
    for name, content in one.files.items():
        (tmp_path / name).write_bytes(content)
    assert list(one.files) == ["log.parquet.csv"]
    again = Scenario.from_table(one.table(), "stored", tmp_path)
    np.testing.assert_array_equal(again.foot_path, one.foot_path)


# refusal


def test_angles_that_no_leg_has_are_refused() -> None:
    with pytest.raises(LoopOpenError, match=r"truth\.csv: the loop of the leg .* t = 0 s"):
        Scenario.from_table(table() | {"leg": {"L2": 0.03, "L3": 0.03}}, "mine.toml", FOLDER)
    radians = {"column": "Winkel A [°]"}
    with pytest.raises(LoopOpenError, match=r"excel_german\.csv: .*a guess"):
        scenario(file="excel_german.csv", columns=GERMAN | {"theta_A": radians})


def test_wrong_tables_are_refused() -> None:
    for said, keys in {
        "unknown column 'time'": {"file": "matlab_table.csv"},
        "theta_E is missing": {"columns": {"time": "time", "theta_A": "theta_A"}},
        "cannot read table of angles": {"file": "none.csv"},
        r"ramp must be in \[0, 0\.115\] s": {"ramp": 0.2},
    }.items():
        with pytest.raises(ConfigError, match=said):
            scenario(**keys)
    with pytest.raises(ArgumentError, match="needs its leg"):
        Angles(file=str(FOLDER / "truth.csv")).nominal(0.0)
