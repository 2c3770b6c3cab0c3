"""What a device cannot run, told before anything is compiled for it."""

from __future__ import annotations

import mujoco

from fivebar_sim.errors import ConfigError
from fivebar_sim.model import friction_law
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.tasks import KINDS, Task
from fivebar_sim.tasks.legs import model_of
from fivebar_sim.walking.plan import RobotPlan


def checked(planned: Plan | RobotPlan) -> Plan:
    """Return a plan that a device can run.

    Raises:
        ConfigError: It has what only the processor can do; says what.
    """
    if isinstance(planned, RobotPlan):
        reason = "a robot, only legs alone"
    else:
        reason = obstacle(planned)
        if reason is None:
            return planned
    name = planned.scenario.name
    raise ConfigError(f"{name}: no device can run {reason}; with device=None it runs")


def obstacle(planned: Plan) -> str | None:
    """Return what keeps a plan from running on a device; None if nothing does."""
    if planned.setpoints is None:
        name = planned.scenario.controller_name
        return f"the feedback controller {name!r}, which is asked in Python between the steps"
    return model_obstacle(planned.model)


def task_obstacle(task: Task) -> str | None:
    """Return what keeps a task's episodes from running on a device; None if nothing does."""
    if type(task) not in KINDS.values():
        return f"a task of another kind than {', '.join(KINDS)}, here {task.kind!r}"
    if task.sensors.noise > 0.0 or task.sensors.rate_noise > 0.0:
        return "noise of the sensors (sensors.noise, sensors.rate_noise)"
    return model_obstacle(model_of(task))


def model_obstacle(model: mujoco.MjModel) -> str | None:
    """Return what keeps a model from being stepped on a device; None if nothing does."""
    if friction_law(model) is not None:
        return "a gear friction that changes from step to step (servo.friction.model)"
    if model.opt.noslip_iterations > 0:
        return f"noslip_iterations = {model.opt.noslip_iterations}, which Warp lacks"
    return None
