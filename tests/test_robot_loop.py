"""Robots in the loop: each leg is steered as one alone, and a leg without an answer is named."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import msgspec
import numpy as np
import pytest

from fivebar_sim import Scenario, run
from fivebar_sim.arrays import Array
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.interface import Drive
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError, DivergedError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import walk

PD = 'controller={name="pd", kp=0.6, kd=0.006, period=0.002}'
PATH = 'path={kind="ellipse", centre=[0.0, -0.045], radii=[0.01, 0.005], frequency=4.0, ramp=0.1}'
COMMON = (PD, PATH, "duration=0.4", "limits={}")


def loaded(*settings: str) -> RobotScenario:
    scenario = Scenario.load("robot-q8bot-stand", [*COMMON, *settings])
    assert isinstance(scenario, RobotScenario)
    return scenario


def test_legs_in_the_air_are_steered_as_a_leg_alone() -> None:
    table = loaded().table()
    alone = {key: table[key] for key in ("path", "controller", "sim", "duration")}
    alone |= {"name": "leg", "leg": "q8bot", "servo": "xl330"}
    wanted = run(Scenario.from_table(alone, "leg", Path())).record
    held = run(loaded("scene=air")).record
    for leg in LEGS:
        for name in wanted.keys() - {"time"}:
            scale = np.abs(wanted[name]).max()
            np.testing.assert_allclose(
                held[f"{leg}_{name}"], wanted[name], atol=1e-7 * scale + 1e-12, err_msg=name
            )


def test_commands_hold_for_a_period_and_noise_is_each_legs_own() -> None:
    bus = ("robot.servo.rate=500", "robot.servo.delay=0")
    noisy = loaded("sensors.noise=0.001", "scene=air", *bus)
    went = walk(plan_scenario(noisy))
    ctrl = {leg: went.record[f"{leg}_ctrl_A"] for leg in LEGS}
    for values in ctrl.values():
        np.testing.assert_array_equal(values[1::2], values[::2])
    assert len({values.tobytes() for values in ctrl.values()}) == len(LEGS)
    again = walk(plan_scenario(noisy))
    np.testing.assert_array_equal(again.record["RR_ctrl_E"], went.record["RR_ctrl_E"])


def test_robot_in_the_loop_stands_and_balances() -> None:
    found = run(loaded("path.frequency=2.0", "path.ramp=0.2", "duration=0.8"))
    assert found.metrics["robot"]["falls"] == 0
    assert found.metrics["energy"]["imbalance"] < 1e-4
    names = {guard["name"] for guard in found.metrics["guards"]}
    assert "feedback" in names


class Lost(msgspec.Struct, frozen=True):
    """It has no answer for the third leg from 0.1 s on."""

    drive: ClassVar[Drive] = "torque"
    period: float = 0.002

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return no torques, and then none that is a number."""
        del leg, servo, wanted
        torque = np.zeros_like(seen.theta)
        if seen.time >= 0.1:
            torque[2] = np.nan
        return torque


def test_leg_without_an_answer_is_named() -> None:
    planned = plan_scenario(msgspec.structs.replace(loaded("scene=air"), controller=Lost()))
    with pytest.raises(DivergedError, match=r"has no answer for RL at t = 0\.1 s: .*not finite"):
        walk(planned)


def test_period_must_be_whole_timesteps() -> None:
    with pytest.raises(
        (ConfigError, ValueError), match=r"controller\.period must be a whole number"
    ):
        plan_scenario(loaded("controller.period=0.0015"))
