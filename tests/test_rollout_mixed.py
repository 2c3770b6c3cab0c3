"""Legs of different structure in one call: simulated in groups, with the bits of one by one."""

from __future__ import annotations

import numpy as np

from fivebar_sim import rollout
from fivebar_sim.scenario import Scenario

RUNS = (
    ("classic-ellipse", "leg=extended"),
    ("classic-ellipse", "leg=classic"),
    ("classic-ellipse", "leg=minitaur"),
    ("rail-landing", "leg=classic"),
    ("payload-ellipse", "leg=classic"),
    ("classic-ellipse", "controller={name='pd'}"),
    ("classic-ellipse", "controller={name='pd', period=0.002}"),
)


def test_unlike_legs_give_the_bits_of_one_by_one() -> None:
    plans = []
    for name, setting in RUNS:
        path = {"minitaur": "path.centre=[0, -0.22]", "extended": "path.centre=[0, -0.085]"}
        extra = path.get(setting.removeprefix("leg="), "sim.seed=0")
        plans.append(rollout.plan(Scenario.load(name, [setting, extra, "duration=0.8"])))
    for plan, result in zip(plans, rollout.run_all(plans, nthread=2), strict=True):
        alone = rollout.execute(plan)
        assert result.scenario is plan.scenario
        for name, column in result.record.items():
            np.testing.assert_array_equal(column, alone.record[name], err_msg=name)
