"""Friction by load in the legs of robots: on a trunk that moves, over a floor that carries."""

from __future__ import annotations

import functools

import mujoco
import numpy as np
import pytest

from fivebar_sim.arrays import Array
from fivebar_sim.control.friction import FrictionArrays
from fivebar_sim.errors import ConfigError
from fivebar_sim.model.robot import build_robot
from fivebar_sim.robots import LEGS
from fivebar_sim.robots.columns import columns
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.steps import Legs
from fivebar_sim.walking import energy
from fivebar_sim.walking.plan import plan_scenario
from fivebar_sim.walking.record import before
from fivebar_sim.walking.walk import Walk, walk

SERVO = "robot.servo.preset=xl330-m288"


@functools.cache
def walked() -> Walk:
    settings = [SERVO, "duration=0.6", "path.ramp=0.1", "limits={}"]
    scenario = Scenario.load("robot-q8bot-trot", settings)
    assert isinstance(scenario, RobotScenario)
    return walk(plan_scenario(scenario))


def pairs(went: Walk, name: str) -> Array:
    """Return a column of all motors, A and E of each leg, (N, 8)."""
    names = [f"{leg}_{name}_{motor}" for leg in LEGS for motor in "AE"]
    return np.stack([went.record[each] for each in names], axis=1)


def from_outside(went: Walk) -> Array:
    """Return the motors' joint torques from outside in each step [N m], (N, 8).

    All that constraints do but the gears, less MuJoCo's own bias at the step's start.
    """
    built = went.plan.model
    data = mujoco.MjData(built)
    own = [int(built.joint(f"{leg}_{motor}").dofadr[0]) for leg in LEGS for motor in "AE"]
    q = before(went.plan.start, went.states.qpos[0])
    v = before(np.zeros(built.nv), went.states.qvel[0])
    bias = np.empty((len(q), 8))
    for k, (pose, rates) in enumerate(zip(q, v, strict=True)):
        data.qpos[:] = pose
        data.qvel[:] = rates
        mujoco.mj_fwdPosition(built, data)
        mujoco.mj_fwdVelocity(built, data)
        bias[k] = data.qfrc_bias[own]
    return went.states.constraint[0][:, own] - resisting(went) - bias


def resisting(went: Walk) -> Array:
    """Return the gears' dry friction in each step [N m], (N, 8)."""
    viscous = went.plan.robot.servo.gear.viscous
    return pairs(went, "friction") + viscous * pairs(went, "theta_dot")


def test_gears_resist_as_their_model_says_while_feet_stand_and_swing() -> None:
    """Where a joint turns, the record's friction is the formula of a step before, to 1e-9."""
    went = walked()
    rate = pairs(went, "theta_dot")
    law = FrictionArrays.of([went.plan.robot.servo.gear])
    most = law.largest(pairs(went, "torque")[:-1], from_outside(went)[:-1], rate[:-1])
    # Near a reversal the gear sticks, and MuJoCo's discrete step turns friction up to two early.
    side = np.sign(np.concatenate([rate, rate[-1:], rate[-1:]]))
    turns = (side[1:-2] == side[:-3]) & (side[1:-2] == side[2:-1]) & (side[1:-2] == side[3:])
    turns &= np.abs(rate[1:]) > 0.05
    stands = np.stack([went.record[f"{leg}_ground_z"] > 0.5 for leg in LEGS], axis=1)[1:]
    assert (turns & np.repeat(stands, 2, axis=1)).mean() > 0.2
    error = np.abs(resisting(went)[1:] + np.sign(rate[1:]) * most)
    assert most.max() > 0.1
    assert error[turns].max() < 1e-9
    imbalance = energy.balance(went).imbalance
    assert imbalance is not None
    assert imbalance < 1e-5


def test_robots_of_a_batch_are_robots_alone() -> None:
    """One with gears by load beside one with constant friction: the same bits."""
    built = []
    for friction in ("{model='load', base=0.01, load=0.2}", "0.02"):
        scenario = Scenario.load("robot-q8bot-trot", [SERVO, f"robot.servo.friction={friction}"])
        assert isinstance(scenario, RobotScenario)
        built.append(build_robot(scenario.robot))
    start = np.stack([each.key("stand").qpos for each in built])
    ctrl = np.stack([np.tile(each.key("stand").ctrl, (20, 1)) for each in built])
    ctrl += 0.3 * np.sin(np.arange(20))[:, None]
    together = Legs(built, start).advance(ctrl)
    for row in range(len(built)):
        alone = Legs(built[row], start[[row]]).advance(ctrl[[row]])
        np.testing.assert_array_equal(together.qpos[row], alone.qpos[0])
        np.testing.assert_array_equal(together.constraint[row], alone.constraint[0])


def test_the_record_has_the_columns_that_are_read_back() -> None:
    went = walked()
    assert list(went.record) == columns(went.plan.scene, rubbed=True)


@pytest.mark.parametrize(
    ("setting", "where"),
    [
        ('robot.hips.side_step={kp=4, kd=0.03, mass="20 g"}', "with hips.side_step"),
        ('scene={kind="floor", ground={kind="rough", height="2 mm"}}', "on uneven ground"),
    ],
)
def test_refusal_where_the_load_is_not_known(setting: str, where: str) -> None:
    with pytest.raises(ConfigError, match=f"friction of a robot {where} must be a number"):
        Scenario.load("robot-q8bot-trot", [SERVO, "limits={}", setting])
