"""Pushes on a robot's trunk: momentum, work, and whether it gets over them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fivebar_sim import Result, Scenario, run
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.report import look, robot_figures
from fivebar_sim.robots import Robot
from fivebar_sim.robots.columns import trunk
from fivebar_sim.robots.measure import Trunk
from fivebar_sim.robots.push import Push, forces, recovery
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.runs.stored import StoredRun
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import walk

ROBOT = Robot.load("q8bot")
SHORT = (
    *("duration=0.35", "path.seconds=0.35", "path.ramp=0.1", "limits={}"),
    "path.points=[[0, -0.04336], [0, -0.04336]]",
)


def pushed(push: str, *settings: str) -> Result:
    """Return a short run of a Q8bot that stands and is pushed."""
    return run(Scenario.load("robot-q8bot-stand", [*SHORT, f"push=[{push}]", *settings]))


@pytest.fixture(scope="module")
def nudged() -> Result:
    """A push of 40 mN s to the left, at the trunk's origin."""
    return pushed("{time=0.2, duration=0.02, force=[0, 2, 0]}", "robot.servo=ideal")


def test_a_push_gives_its_impulse_to_a_robot_on_ice() -> None:
    found = pushed("{time=0.2, duration=0.05, force=[0, 0.4, 0]}", "scene.friction=0")
    speed = found.record["trunk_dot_y"]
    assert np.abs(speed[:199]).max() < 1e-3
    # It rolls a little about the middle of its mass, which is not the trunk's origin.
    assert speed[-50:].mean() == pytest.approx(0.4 * 0.05 / ROBOT.mass, rel=0.03)


def test_work_of_a_push_is_force_times_way(nudged: Result) -> None:
    """At the trunk's origin, by the record alone; and the balance closes with it."""
    speed = nudged.record["trunk_dot_y"]
    # Of a step, with the mean of the rates at its ends.
    way = 1e-3 * 0.5 * (speed[199:219] + speed[200:220]).sum()
    energy = nudged.metrics["energy"]
    assert energy["force"] == pytest.approx(2.0 * way, rel=1e-9)
    assert energy["force"] > 1e-4
    assert energy["imbalance"] < 1e-4


def test_a_robot_that_stands_gets_over_a_nudge(nudged: Result) -> None:
    after = nudged.metrics["robot"]["recovery"]
    assert 0.0 <= after < 0.1
    assert nudged.metrics["robot"]["falls"] == 0


def test_a_robot_that_is_pushed_over_says_when_and_why() -> None:
    found = pushed('{time=0.1, duration=0.05, force=[0, 8, 0], at=[0, 0, "40 mm"]}')
    assert found.verdict == "fail"
    assert found.metrics["robot"]["recovery"] is None
    (fall,) = [guard for guard in found.measured.guards if guard.name == "fall"]
    assert fall.time is not None
    assert 0.1 < fall.time < 0.35
    assert "the robot fell: the trunk leans 60 deg" in str(fall)
    assert found.metrics["energy"]["imbalance"] < 1e-4


def test_pushes_reach_a_robot_whose_controller_is_asked() -> None:
    """Its commands come a control period at a time, and the pushes with them."""
    law = 'controller={name="pd", kp=0.6, kd=0.006, period=0.002}'
    push = "push=[{time=0.1, duration=0.1, force=[0, 0, -1]}]"
    scenario = Scenario.load("robot-q8bot-stand", [*SHORT, law, push])
    assert isinstance(scenario, RobotScenario)
    planned = plan_scenario(scenario)
    assert planned.setpoints is None
    went = walk(planned)
    force = went.states.ctrl[0, :, 2]
    np.testing.assert_array_equal(np.flatnonzero(force == -1.0), np.arange(100, 200))
    stood = np.sum([went.record[f"{leg}_ground_z"] for leg in ("FL", "FR", "RL", "RR")], axis=0)
    assert stood[190] - stood[95] == pytest.approx(1.0, abs=0.1)


def test_report_shades_the_push(nudged: Result) -> None:
    stored = StoredRun(Path("run"), nudged.scenario, nudged.record, nudged.measured)
    body = trunk(stored.record)
    assert body is not None
    with look.project_style():
        drawn = robot_figures.pose(stored, body)
    assert "Dark bands: pushes. It is up again after" in drawn.caption
    bands = [patch for patch in drawn.figure.axes[0].patches if patch.get_label() == "push"]
    (band,) = bands
    assert band.get_window_extent().width > 0.0


def test_forces_begin_and_end_on_time() -> None:
    """Two that overlap; one shorter than a step is a step long."""
    long = Push(time=0.002, duration=0.003, force=(1.0, 2.0, 3.0))
    short = Push(time=0.004, duration=1e-6, force=(0.0, 0.0, 5.0))
    found = forces([long, short], 8, 0.001)
    np.testing.assert_array_equal(np.flatnonzero(found[:, 0]), [2, 3, 4])
    np.testing.assert_array_equal(np.flatnonzero(found[:, 5]), [4])


def test_recovery_is_the_last_time_that_it_leans_too_far() -> None:
    push = Push(time=0.1, duration=0.1, force=(0.0, 1.0, 0.0))
    assert recovery(leaning([0.05] * 30), [push], fell=False) == 0.0
    there_and_back = [0.0] * 15 + [0.2] * 10 + [0.0] * 5
    assert recovery(leaning(there_and_back), [push], fell=False) == pytest.approx(0.05)
    assert recovery(leaning([0.0] * 15 + [0.2] * 15), [push], fell=False) is None
    assert recovery(leaning(there_and_back), [push], fell=True) is None


def leaning(angles: list[float]) -> Trunk:
    """Return a trunk that rolls to angles [rad], one each 10 ms."""
    half: Array = 0.5 * np.array(angles)
    turned = np.stack([np.cos(half), np.sin(half), 0.0 * half, 0.0 * half], axis=-1)
    time: Array = 0.01 * np.arange(1, len(half) + 1, dtype=np.float64)
    return Trunk(time, np.zeros((len(half), 3)), turned, np.zeros((len(half), 3)))


def test_a_scenario_keeps_its_pushes() -> None:
    scenario = Scenario.load(
        "robot-q8bot-stand", ['push=[{time=1, duration="20 ms", force=["500 mN", 0, 0]}]']
    )
    assert isinstance(scenario, RobotScenario)
    assert scenario.pushes == (Push(time=1, duration=0.02, force=(0.5, 0, 0)),)
    assert Scenario.from_table(scenario.table(), "table", Path()) == scenario


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("push=3", r"push must be tables \[\[push\]\], got 3"),
        ("push=[{time=0, duration=1}]", r"push\[0\]\.force is missing"),
        ("push=[{time=0, duration=0, force=[0,0,1]}]", r"push\[0\]\.duration must be in \(0, .* s"),
        ("push=[{time=0, duration=1, force=[1]}]", r"push\[0\]\.force"),
        ("push=[{time=0, duration=1, force=[0,0,1], an=1}]", r"\[push\[0\]\]: unknown key 'an'"),
        ("push=[{time=9, duration=1, force=[0,0,1]}]", r"push\[0\] must end within the run of"),
        ("limits.robot.recovery=1", r"limits\.robot\.recovery needs a \[\[push\]\]"),
    ],
)  # fmt: skip
def test_push_that_is_none_is_refused(setting: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Scenario.load("robot-q8bot-stand", [setting])


def test_a_held_trunk_takes_no_push() -> None:
    push = "push=[{time=0, duration=1, force=[0,0,1]}]"
    with pytest.raises(ConfigError, match=r"push needs a floor: in the scene 'air'"):
        Scenario.load("robot-q8bot-stand", ["scene=air", "limits={}", push])
