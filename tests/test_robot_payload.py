"""What a robot carries: its weight, where it is, and its energy."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from fivebar_sim import Scenario, model
from fivebar_sim.errors import ConfigError
from fivebar_sim.robots import Floor, Robot
from fivebar_sim.robots.floor import Payload
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking.measure import measure
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.walk import Walk, walk

ROBOT = Robot.load("q8bot")


def stood(*settings: str) -> Walk:
    """Return 0.4 s of a Q8bot that holds its legs still."""
    short = ["duration=0.4", "path.seconds=0.4", "path.ramp=0.2", "limits={}"]
    still = "path.points=[[0, -0.04336], [0, -0.04336]]"
    scenario = Scenario.load("robot-q8bot-stand", [*short, still, *settings])
    assert isinstance(scenario, RobotScenario)
    return walk(plan_scenario(scenario))


def test_feet_carry_the_payload_where_it_is() -> None:
    """All of both weights, and about the middle of the feet the moment of the payload's."""
    payload = 'scene.payload={mass="100 g", at=["20 mm", "10 mm", "30 mm"]}'
    went = stood(payload, "robot.servo=ideal")
    force = {leg: went.record[f"{leg}_ground_z"][-50:].mean() for leg in ("FL", "FR", "RL", "RR")}
    weight = 9.81 * (ROBOT.mass + 0.1)
    assert sum(force.values()) == pytest.approx(weight, rel=1e-3)
    left = force["FL"] + force["RL"] - force["FR"] - force["RR"]
    across = abs(ROBOT.hips["FL"].pos[1])
    # It leans by 0.1 degree on its servos.
    assert left * across == pytest.approx(9.81 * 0.1 * 0.01, rel=0.02)
    measured = measure(went)
    assert measured.energy.imbalance is not None
    assert measured.energy.imbalance < 1e-4


def test_a_payload_is_a_point_mass_on_the_trunk() -> None:
    payload = Payload(mass=0.3, at=(0.01, -0.02, 0.04))
    built = model.build_robot(ROBOT, Floor(payload=payload))
    data = mujoco.MjData(built)
    mujoco.mj_resetDataKeyframe(built, data, 0)
    mujoco.mj_forward(built, data)
    assert float(built.body_mass.sum()) == pytest.approx(ROBOT.mass + 0.3)
    place = data.body("payload").xpos - data.body("trunk").xpos
    np.testing.assert_allclose(place, payload.at, atol=1e-15)
    # The whole about the trunk's x axis, with and without it.
    with_it, without = (_about_x(Floor(payload=each)) for each in (payload, Payload()))
    assert with_it - without == pytest.approx(0.3 * (0.02**2 + 0.04**2), rel=1e-6)


def _about_x(scene: Floor) -> float:
    """Return the moment of inertia of the whole about the trunk's x axis [kg m^2]."""
    built = model.build_robot(ROBOT, scene)
    data = mujoco.MjData(built)
    mujoco.mj_resetDataKeyframe(built, data, 0)
    mujoco.mj_forward(built, data)
    mass = np.zeros((built.nv, built.nv))
    mujoco.mj_fullM(built, data, mass)
    return float(mass[3, 3])


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ('scene.payload={mass="-1 g"}', r"scene\.payload\.mass must be in \[0, 1e\+06\] kg"),
        ("scene.payload.at=[0, 0]", r"scene\.payload\.at must be .*3.*, got \[0, 0\]"),
        ("scene.payload.mas=1", r"\[scene\.payload\]: unknown key 'mas'"),
        ("scene.payload=1", r"scene\.payload must be a table, got 1"),
        ('scene={kind="air", payload={mass=1}}', r"\[scene\]: unknown key 'payload'"),
    ],
)  # fmt: skip
def test_payload_that_is_none_is_refused(setting: str, message: str) -> None:
    settings = [] if "air" in setting else ["scene.kind=floor"]
    with pytest.raises(ConfigError, match=message):
        Scenario.load("robot-q8bot-stand", [*settings, "limits={}", setting])
