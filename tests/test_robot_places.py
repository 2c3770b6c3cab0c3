"""Where the parts of a robot are, against MuJoCo's own kinematics; and its run, ready to draw."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from fivebar_sim import Scenario
from fivebar_sim.render import replay, view
from fivebar_sim.robots import LEGS, places
from fivebar_sim.robots.columns import of_leg, trunk
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.walking import Walk, walk
from fivebar_sim.walking.plan import plan_scenario

ROWS = range(5, 400, 31)


@pytest.fixture(scope="module")
def went() -> Walk:
    """A robot that trots, leans and turns, its rear legs turned round."""
    settings = ["duration=0.45", "path.ramp=0.2", "limits={}"]
    settings += ["robot.hips.RL.mirrored=true", "robot.hips.RR.mirrored=true"]
    scenario = Scenario.load("robot-q8bot-turn", settings)
    assert isinstance(scenario, RobotScenario)
    return walk(plan_scenario(scenario))


def at(went: Walk, row: int) -> mujoco.MjData:
    """Return MuJoCo's data of a state."""
    data = mujoco.MjData(went.plan.model)
    data.qpos[:] = went.states.qpos[0, row]
    data.qvel[:] = went.states.qvel[0, row]
    mujoco.mj_forward(went.plan.model, data)
    return data


@pytest.mark.parametrize("name", LEGS)
def test_feet_and_joints_are_where_mujoco_has_them(went: Walk, name: str) -> None:
    robot = went.plan.robot
    assert went.trunk is not None
    record = of_leg(went.record, name)
    feet = places.feet(went.trunk, robot.hips[name], record)
    depths = places.depths(robot, went.trunk, robot.hips[name], record)
    for row in ROWS:
        data = at(went, row)
        np.testing.assert_allclose(feet[row], data.geom(f"{name}_foot").xpos, atol=1e-12)
        for joint, body in (("A", "L1"), ("B", "L2"), ("E", "L4"), ("D", "L3")):
            height = data.body(f"{name}_{body}").xpos[2]
            wanted = max(robot.leg.radius - height, 0.0)
            assert depths[f"joint {joint}"][row] == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("name", LEGS)
def test_slip_is_the_way_of_the_contact_point(went: Walk, name: str) -> None:
    """The velocity of the ball's lowest point, of MuJoCo's Jacobian, over a step of 1 ms."""
    robot = went.plan.robot
    model = went.plan.model
    assert went.trunk is not None
    slid = places.slid(robot, went.trunk, robot.hips[name], of_leg(went.record, name))
    jac = np.zeros((3, model.nv))
    for row in ROWS:
        data = at(went, row)
        point = data.geom(f"{name}_foot").xpos - (0.0, 0.0, robot.leg.foot_radius)
        mujoco.mj_jac(model, data, jac, None, point, model.geom(f"{name}_foot").bodyid[0])
        wanted = 1e-3 * np.hypot(*(jac @ went.states.qvel[0, row])[:2])
        assert slid[row] == pytest.approx(wanted, abs=2e-5, rel=0.05)


def test_replay_has_the_states_that_were_simulated(went: Walk) -> None:
    drawn = replay.replay(went.plan.scenario, went.record)
    np.testing.assert_allclose(drawn.qpos, went.states.qpos[0], atol=1e-15)
    assert drawn.walked is not None
    assert trunk(went.record) is not None
    x, z = drawn.points_to_fit().T
    # The camera follows the trunk: what it must see is as wide as the robot, not as its way.
    assert np.ptp(x) < 2.0 * went.plan.robot.length
    assert z.min() < 0.01


def test_viewer_takes_a_robots_scenario() -> None:
    assert isinstance(view.load("robot-q8bot-stand"), RobotScenario)
