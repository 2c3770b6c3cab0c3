"""A scenario's plan with one thing disturbed: by how much it must not go unnoticed."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from faults import Change, fixed, loop_impedance, scaled
from msgspec.structs import replace as other

from fivebar_sim import rollout
from fivebar_sim.rollout import Plan

LENGTHS = ("L1", "L2", "L3", "L4", "L5")
GAINS = ("kp", "kd", "kp_near", "kd_near", "kp_far", "kd_far", "stiffness", "damping")


def weaker(compiled: Any) -> None:
    """Take 10 % off the gain of the motors, of angles or of torques."""
    compiled.actuator_gainprm[-2:, 0] *= 0.9
    compiled.actuator_biasprm[-2:, 1] *= 0.9


MODEL: dict[str, Change] = {
    "motors 10 % weak": weaker,
    "motors 10 % more damped": scaled("dof_damping", 1.1),
    "solref of the loop 10 % slow": scaled("eq_solref", np.array([1.1, 1.0])),
    "solimp of the loop 0.9 0.95": loop_impedance,
    "one iteration of the solver": fixed("opt.iterations", 1),
}


def in_the_model(plan: Plan, names: Iterable[str] = MODEL) -> dict[str, Plan]:
    """Return plans of which the model is not what the controller thinks it is."""
    plans = {}
    for name in names:
        compiled = copy(plan.model)
        MODEL[name](compiled)
        plans[name] = plan._replace(model=compiled)
    return plans


def in_time(plan: Plan) -> Plan:
    """Return a plan whose commands arrive a timestep late."""
    scenario = plan.scenario
    servo = plan.scenario.servo
    if plan.setpoints is not None:
        return plan._replace(setpoints=np.concatenate([plan.setpoints[:1], plan.setpoints[:-1]]))
    late = other(servo, delay=servo.delay + scenario.sim.timestep)
    return rollout.plan(other(scenario, servo=late))


def in_length(plan: Plan, names: Iterable[str] = LENGTHS) -> dict[str, Plan]:
    """Return plans of a leg of which one length is longer by 1 % of the leg's size."""
    leg = plan.scenario.leg
    legs = {name: replace(leg, **{name: getattr(leg, name) + 0.01 * leg.size}) for name in names}
    return {name: rollout.plan(other(plan.scenario, leg=leg)) for name, leg in legs.items()}


def in_gain(plan: Plan, factor: float) -> dict[str, Plan]:
    """Return plans of a controller of which one gain is scaled."""
    plans: dict[str, Plan] = {}
    controller: Any = plan.scenario.controller
    for name in GAINS:
        if hasattr(controller, name):
            gain = getattr(controller, name)
            value = tuple(factor * g for g in gain) if isinstance(gain, tuple) else factor * gain
            changed = other(controller, **{name: value})
            plans[name] = rollout.plan(other(plan.scenario, controller=changed))
    return plans
