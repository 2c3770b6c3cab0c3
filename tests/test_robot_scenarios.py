"""Robots' scenarios: what ships passes, what is read is run, what cannot be is refused."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from pyarrow import parquet
from shell import Shell

from fivebar_sim import Result, Scenario, rollout, run
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import resources
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.columns import COLUMNS
from fivebar_sim.regression import baseline, comparison
from fivebar_sim.robots import LEGS, Air, Floor
from fivebar_sim.robots.columns import columns
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking import energy
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import walk

SHIPPED = sorted(name for name in resources.shipped("scenarios") if name.startswith("robot-"))
QUICK = ("robot-q8bot-stand", "robot-q8bot-trot-fast")
EACH = [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in SHIPPED]
STAND = "robot-q8bot-stand"


@cache
def result(name: str) -> Result:
    return run(Scenario.load(name))


def stand(*settings: str) -> RobotScenario:
    """Return a robot that stands, in a run as short as can be, with changes."""
    short = ["duration=0.1", "path.seconds=0.1", "path.ramp=0.05", "limits={}"]
    scenario = Scenario.load(STAND, [*short, *settings])
    assert isinstance(scenario, RobotScenario)
    return scenario


# law


@pytest.mark.parametrize("name", EACH)
def test_shipped_scenario_passes_its_limits_and_its_baseline(name: str) -> None:
    recorded = baseline.read(baseline.place(name))
    assert recorded is not None
    found = comparison.compare(result(name), recorded)
    assert found.failures == []
    assert result(name).verdict == "pass"


@pytest.mark.parametrize("name", QUICK)
def test_energy_of_the_whole_robot_is_accounted_for(name: str) -> None:
    assert result(name).metrics["energy"]["imbalance"] < 1e-5


@pytest.mark.long
def test_energy_balances_over_ten_seconds_of_trot() -> None:
    settings = ["duration=10", "guards.heat=10", "limits={}"]
    found = run(Scenario.load("robot-q8bot-trot-fast", settings)).metrics
    assert found["energy"]["imbalance"] < 1e-4


def test_torque_that_did_not_act_opens_the_balance() -> None:
    """A hundredth more of one motor's torque of eight shows."""
    planned = plan_scenario(
        stand("path.points=[[0, -0.043], [0.01, -0.045]]", "duration=0.3", "path.seconds=0.3")
    )
    went = walk(planned)
    closed = energy.balance(went).imbalance
    went.record["RL_torque_E"] *= 1.01
    opened = energy.balance(went).imbalance
    assert closed is not None
    assert opened is not None
    assert 100.0 * closed < 1e-4 < opened


def test_record_has_the_columns_of_the_contract() -> None:
    record = result("robot-q8bot-trot-fast").record
    assert [*record] == columns(Floor())
    for name in ("x", "y", "z", "qw", "qx", "qy", "qz"):
        assert f"trunk_{name}" in record
    for leg in LEGS:
        assert {f"{leg}_{name}" for name in COLUMNS[1:]} <= set(record)
    assert len(record["time"]) == 2050


def test_metrics_are_those_of_the_four_legs_together() -> None:
    """RMS over all, the worst of all, and parts of the robot that add up to it."""
    metrics = result("robot-q8bot-trot-fast").metrics
    legs = [metrics["legs"][leg] for leg in LEGS]
    for motor in ("A", "E"):
        rms = [leg["torque_rms"][motor] for leg in legs]
        peak = max(leg["torque_peak"][motor] for leg in legs)
        assert metrics["load"]["torque_rms"][motor] == pytest.approx(
            np.sqrt(np.mean(np.square(rms)))
        )
        assert metrics["load"]["torque_peak"][motor] == metrics["torque_peak"][motor] == peak
        assert metrics["load"]["heat"][motor] == max(leg["heat"][motor] for leg in legs)
    error = [leg["tracking_rms"] for leg in legs]
    assert metrics["tracking"]["rms"] == pytest.approx(np.sqrt(np.mean(np.square(error))))
    assert sum(leg["slip"] for leg in legs) == pytest.approx(metrics["ground"]["slip"])
    for part in ("share_of_robot", "weight_share"):
        assert sum(leg[part] for leg in legs) == pytest.approx(1.0)


def test_weight_is_carried_and_shared_by_a_robot_that_stands() -> None:
    record = result(STAND).record
    scenario = result(STAND).scenario
    assert isinstance(scenario, RobotScenario)
    forces = [record[f"{leg}_ground_z"][-500:].mean() for leg in LEGS]
    assert sum(forces) == pytest.approx(scenario.robot.mass * 9.81, rel=1e-3)
    assert result(STAND).metrics["robot"]["cost_of_transport"] is None


def test_held_robot_has_no_trunk_and_no_floor() -> None:
    found = run(stand("scene=air"))
    assert [*found.record] == columns(Air())
    assert not {"robot", "ground", "ground_peak"} & set(found.metrics)
    assert not {"fall", "floor"} & {guard["name"] for guard in found.metrics["guards"]}


def test_fall_fails_the_run_and_says_why() -> None:
    """Its mass is beyond the feet of its left legs."""
    settings = ("robot.trunk.center=[0.0, 0.08, 0.006]", "duration=0.5", "path.seconds=0.5")
    found = run(stand(*settings))
    assert found.verdict == "fail"
    assert found.metrics["robot"]["falls"] == 1
    (said,) = [s for s in guards.tripped(found.measured.guards) if s.startswith("guard fall")]
    assert said.startswith("guard fall: the robot fell: the trunk touches the floor leaning")
    assert "at t = 0." in said


def test_robots_run_with_legs_and_alone_to_the_same_bits() -> None:
    plans = [
        rollout.plan(Scenario.load("classic-ellipse", ["duration=0.8"])),
        plan_scenario(stand()),
    ]
    together = rollout.run_all(plans[::-1])
    alone = run(stand())
    assert [each.scenario.name for each in together] == [STAND, "classic-ellipse"]
    for name, column in alone.record.items():
        np.testing.assert_array_equal(column, together[0].record[name])


# doors


def test_run_directory_is_read_back_and_runs_again(tmp_path: Path) -> None:
    place = tmp_path / "run"
    found = run(stand("robot.mass=0.25", "scene.friction=0.7", "robot.servo.kp=0.6"))
    found.write(place)
    again = Result.read(place)
    assert again.metrics == found.metrics
    assert again.scenario == Scenario.load(place / "scenario.toml")
    assert [*again.record] == [*found.record]
    repeated = run(Scenario.load(place / "scenario.toml"))
    for name, column in found.record.items():
        np.testing.assert_array_equal(column, repeated.record[name])


def test_program_runs_checks_and_refuses(shell: Shell) -> None:
    name = STAND
    ran = shell("run", name, "--set", "duration=0.1", "--set", "path.seconds=0.1", "--set",
                "path.ramp=0.05", "--set", "limits={}", "--out", "r")  # fmt: skip
    assert (ran.status, ran.err) == (0, "")
    assert "robot-q8bot-stand: robot q8bot of 220 g; window" in ran.out
    kept = {"scenario.toml", "metrics.json", "rollout.parquet", "recording.rrd"}
    assert {each.name for each in Path("r").iterdir()} == kept
    assert "robot" in json.loads(Path("r/metrics.json").read_text())


def test_settings_change_what_the_robot_is_made_of() -> None:
    changed = stand("robot.mass=0.3", "robot.leg.L2=0.042", "robot.servo.kp=0.7")
    assert (changed.robot.mass, changed.leg.L2, changed.servo.kp) == (0.3, 0.042, 0.7)
    # The rest is the preset's, rotors included.
    assert changed.servo.limit == stand().servo.limit
    assert changed.leg.armature == changed.servo.armature
    ideal = stand("robot.servo=ideal")
    assert ideal.servo.limit is None
    assert ideal.leg.armature != changed.leg.armature


def test_own_file_has_its_robot_beside_it(tmp_path: Path) -> None:
    robot = stand().robot
    (tmp_path / "mine.toml").write_text(tomli_w.dumps(robot.table()))
    table = {"robot": "mine.toml", "path": stand().table()["path"], "duration": 0.1}
    (tmp_path / "walk.toml").write_text(tomli_w.dumps(table))
    loaded = Scenario.load(tmp_path / "walk.toml")
    assert isinstance(loaded, RobotScenario)
    assert loaded.robot == robot
    assert loaded.name == "walk"


# refusal


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("robot=q8bott", r"unknown robot preset 'q8bott'; known: .*you mean 'q8bot'\?"),
        ("robot.mas=0.2", r"\[robot\]: unknown key 'mas'"),
        ("robot.mass=0.01", r"\[robot\]: mass must be in \(0\.0\d+, 1e\+06\] kg"),
        ("robot.hips.RR.pos=[0.04, 0.036, 0.0]", r"hips\.RR is inside hips\.FL"),
        ("leg.L2=0.05", "unknown key 'leg'"),
        ("scene=rail", r"unknown scene of a robot 'rail'; known: air, floor"),
        ("scene.friction=-1", r"scene\.friction must be in \[0, 100\]"),
        ("gait.phases=trott", r"gait\.phases: unknown gait 'trott'; known: .*trot"),
        ("gait.phases.FX=0.5", r"gait\.phases: unknown leg 'FX'"),
        ("gait.phases.RL=0.0", r"gait\.phases\.FR is missing"),
        ("gait.phases=trot", r"gait\.phases must all be 0: the path does not repeat"),
        ("gait.stride=2", r"\[gait\]: unknown key 'stride'"),
        ("limits.robot.sped=1", r"\[limits\]: unknown key 'robot\.sped'; .*'robot\.speed'"),
        ("scene=air", r"limits\.robot\.falls needs a floor"),
        ("duration=0.01", "duration must be"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(setting: str, message: str) -> None:
    settings = [setting]
    if setting.startswith("gait.phases."):
        settings = ["gait.phases.FL=0", setting]
    with pytest.raises(ConfigError, match=message) as refused:
        Scenario.load(STAND, settings)
    assert "\n" not in str(refused.value)


def test_legs_have_no_limits_of_a_robot() -> None:
    with pytest.raises(ConfigError, match=r"unknown key 'robot\.speed'"):
        Scenario.load("classic-ellipse", ["limits.robot.speed=1"])


def test_leg_out_of_reach_is_named_with_when_and_where(shell: Shell) -> None:
    said = shell("run", "robot-q8bot-trot", "--set", "path.stride=0.2")
    assert said.status == 2
    assert "FL: " in said.err
    assert "out of reach" in said.err


def test_table_of_a_robot_is_a_robots_wherever_it_comes_from() -> None:
    again = Scenario.from_table(stand().table(), "table", Path())
    assert again == stand()


@pytest.mark.long
def test_sweep_has_the_metrics_of_robots(shell: Shell) -> None:
    short = ["duration=0.1", "path.seconds=0.1", "path.ramp=0.05", "limits={}"]
    settings = [word for setting in short for word in ("--set", setting)]
    swept = shell("sweep", STAND, "--vary", "robot.mass=0.2:0.3:2", *settings, "--out", "s")
    assert (swept.status, swept.err) == (0, "")
    found = parquet.read_table("s/runs.parquet").to_pydict()
    assert found["robot.mass"] == [0.2, 0.3]
    assert found["robot.falls"] == [0.0, 0.0]
    assert found["load.torque_rms.A"][0] < found["load.torque_rms.A"][1]
