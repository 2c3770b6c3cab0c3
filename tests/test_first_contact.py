"""No run's first contact hangs on the last bit of its start, which is the processor's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.files import resources
from fivebar_sim.model import CLEAR
from fivebar_sim.scenario import Scenario
from fivebar_sim.tasks import Hop
from fivebar_sim.tasks.legs import model_of, starts

SHIPPED = resources.shipped("scenarios")
STAND = "robot-q8bot-stand"
GROUNDS = [
    'ground={kind="steps", height="5 mm", length="30 mm"}',
    'ground={kind="rough", height="5 mm", cell="20 mm", size="1 m", seed=3}',
    'slope="5 deg"',
]


def contacts(model: mujoco.MjModel, qpos: Array) -> int:
    data = mujoco.MjData(model)
    data.qpos = qpos
    mujoco.mj_forward(model, data)
    return int(data.ncon)


def are_sure(model: mujoco.MjModel, start: Array) -> bool:
    """Return whether a start higher or lower by less than `CLEAR` has the same contacts."""
    # The hip's or the trunk's height, where there is one.
    height = 2 if model.joint(0).type == mujoco.mjtJoint.mjJNT_FREE else 0
    off = np.zeros((2, len(start)))
    off[:, height] = -0.9 * CLEAR, 0.9 * CLEAR
    return contacts(model, start + off[0]) == contacts(model, start + off[1])


@pytest.mark.parametrize("name", SHIPPED)
def test_of_shipped_scenarios(name: str) -> None:
    plan = rollout.plan(Scenario.load(name))
    assert are_sure(plan.model, plan.start)


@pytest.mark.parametrize("ground", GROUNDS)
def test_of_a_robot_on_other_ground(ground: str) -> None:
    plan = rollout.plan(Scenario.load(STAND, [f"scene.{ground}"]))
    assert are_sure(plan.model, plan.start)


@pytest.mark.parametrize("scene", ["rail", "{kind='treadmill', speed=0.3}"])
def test_of_a_leg_that_starts_on_the_floor(scene: str) -> None:
    plan = rollout.plan(Scenario.load("rail-hop", [f"scene={scene}"]))
    assert are_sure(plan.model, plan.start)


def test_of_a_task() -> None:
    task = Hop()
    model = model_of(task)
    assert all(are_sure(model, start) for start in starts(task))


def test_a_foot_exactly_on_the_floor_is_not_sure() -> None:
    plan = rollout.plan(Scenario.load(STAND))
    exact = plan.start - CLEAR * (np.arange(len(plan.start)) == 2)
    assert not are_sure(plan.model, exact)
