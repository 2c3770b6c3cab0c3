"""One leg or robot alone is stepped by other code than many: every state has the same bits."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from test_clipping import CASES

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.steps import States, simulate
from fivebar_sim.tasks.stepped import SteppedLegs
from fivebar_sim.walking.plan import plan_scenario

# What MuJoCo warns of in the second step.
WILD = ["controller.feedforward=torque", "servo={kp=1e7, kd=0.0, limit=1e6}"]


TIGHT = ["servo={kp=8.0, kd=0.05, limit=0.004}"]


def planned(name: str, sets: list[str]) -> tuple[Plan, Array]:
    """Return a plan and its table of commands."""
    plan = rollout.plan(Scenario.load(name, [*sets, "limits={}"]))
    return plan, plan.ctrl


def differing(alone: States, both: States) -> list[str]:
    """Return which of the states of one, and of it beside a twin, differ in a bit."""
    return [
        name
        for name, one, two in zip(States._fields, alone, both, strict=True)
        if not all(one[0].tobytes() == np.ascontiguousarray(row).tobytes() for row in two)
    ]


@pytest.mark.parametrize("case", ["kd alone", "no mode agrees"])
def test_a_leg_alone_has_the_bits_of_one_beside_others(case: str) -> None:
    plan, ctrl = planned(*CASES[case])
    part = ctrl[:500]
    both = simulate(plan.model, np.tile(plan.start, (2, 1)), np.tile(part, (2, 1, 1)))
    assert not differing(simulate(plan.model, plan.start[None], part[None]), both)


def test_gears_alone_have_the_bits_of_gears_beside_others() -> None:
    plan, ctrl = planned("payload-xl330", [])
    part = ctrl[:60]
    both = simulate(plan.model, np.tile(plan.start, (2, 1)), np.tile(part, (2, 1, 1)))
    assert not differing(simulate(plan.model, plan.start[None], part[None]), both)


def test_a_leg_that_breaks_down_alone_repeats_its_last_state() -> None:
    plan, ctrl = planned("classic-ellipse", WILD)
    part = ctrl[:600] + 1e3 * np.sin(np.arange(600.0))[:, None]
    both = simulate(plan.model, np.tile(plan.start, (2, 1)), np.tile(part, (2, 1, 1)))
    alone = simulate(plan.model, plan.start[None], part[None])
    assert alone.warnings[0] > 0
    assert not differing(alone, both)


@pytest.mark.parametrize("name", ["classic-ellipse", "payload-xl330"])
def test_one_leg_that_begins_again_has_the_bits_of_one_beside_others(name: str) -> None:
    plan, ctrl = planned(name, TIGHT if name == "classic-ellipse" else [])
    start = plan.start[None]
    part = ctrl[None, :40]
    one = SteppedLegs([plan.model], start, 1)
    two = SteppedLegs([plan.model] * 2, np.tile(start, (2, 1)), 1)
    for legs in (one, two):
        legs.moved(np.tile(part, (legs._batch.nsim, 1, 1)))
        legs.restart(np.array([0]), start + 1e-3)

    alone = pickle.loads(pickle.dumps(one)).moved(part)
    beside = two.moved(np.tile(part, (2, 1, 1)))
    assert alone[0].tobytes() == one.moved(part)[0].tobytes()
    for first, second in zip(alone, beside, strict=True):
        assert first[0].tobytes() == np.ascontiguousarray(second[0]).tobytes()


def test_a_robot_alone_has_the_bits_of_one_beside_others() -> None:
    scenario = Scenario.load("robot-q8bot-trot", ["duration=0.6"])
    assert isinstance(scenario, RobotScenario)
    robot = plan_scenario(scenario)
    assert robot.setpoints is not None
    table = np.concatenate([robot.besides, robot.setpoints], axis=1)[-100:]
    both = simulate(robot.model, np.tile(robot.start, (2, 1)), np.tile(table, (2, 1, 1)))
    assert not differing(simulate(robot.model, robot.start[None], table[None]), both)
