"""Robots in the loop: a controller of legs is asked for all four at every control step.

Each leg is to it what a leg alone is: its motors' sensors, and where its foot should be. What it
knows of no leg, it does not know of a robot's: neither trunk nor other legs.
"""

from __future__ import annotations

from contextlib import closing

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import DivergedError, PoseError
from fivebar_sim.metrics.columns import MOTOR_JOINTS
from fivebar_sim.robots import LEGS
from fivebar_sim.simulation.asked import Asked, Latest
from fivebar_sim.simulation.feedback import Glances
from fivebar_sim.simulation.plan import period_steps
from fivebar_sim.simulation.steps import Legs, States, Watch, is_broken
from fivebar_sim.walking.plan import RobotPlan


def steered(planned: RobotPlan, watch: Watch | None = None) -> States:
    """Return the states of a robot whose legs have a feedback controller.

    Fewer than there are steps if the simulation broke down on the way.

    Args:
        planned: The plan.
        watch: Is shown the states as they come.

    Raises:
        ConfigError: A controller that fails, or commands what is no finite (4, 2).
        DivergedError: A controller that has no answer, or commands what no motor can follow; says
            for which leg, and when.
    """
    asked = Asked([*planned.legs], [*range(len(LEGS))])
    robot = Legs(planned.model, planned.start[None])
    every = period_steps(planned.legs[0])
    steps = planned.scenario.steps
    parts: list[States] = []
    latest: Latest | None = None
    glances = Glances(watch)

    # What led to an error is worth seeing, too.
    with closing(glances):
        for k in range(0, steps, every):
            commands = _commands(planned, asked, k, latest)[:, : steps - k]
            # What else there is, then one leg's motors beside the other's, as in ctrl.
            besides = planned.besides[k : k + every]
            parts.append(robot.advance(np.concatenate([besides, *commands], axis=-1)[None]))
            glances.add(parts[-1])
            if is_broken(parts[-1], slice(None)):
                break
            latest = _seen(parts[-1], planned.robot.joints)
    return States.joined(parts)


def _commands(planned: RobotPlan, asked: Asked, k: int, latest: Latest | None) -> Array:
    """Return what reaches the motors of each leg until the next control step, (4, n, 2)."""
    try:
        sent = asked.sent(k, latest)
        refusal = asked.refusal()
        if refusal is not None:
            raise refusal.error
    except PoseError as error:
        leg = LEGS[error.index[0] if error.index else 0]
        time = k * planned.sim.timestep

        raise DivergedError(
            f"{planned.scenario.name}: controller {asked.name!r} has no answer for {leg} at "
            f"t = {time:g} s: {error}",
            time,
        ) from error
    return sent


def _seen(states: States, joints: int) -> Latest:
    """Return angles and rates of each leg's motors after some steps, (4, n, 2) each.

    Args:
        states: The states.
        joints: How many joints a leg has; A, B, E and D are the last.
    """
    count = joints * len(LEGS)
    shape = (-1, len(LEGS), joints)
    q = states.qpos[0, :, -count:].reshape(shape)[..., -4:][..., MOTOR_JOINTS]
    v = states.qvel[0, :, -count:].reshape(shape)[..., -4:][..., MOTOR_JOINTS]
    return np.swapaxes(q, 0, 1), np.swapaxes(v, 0, 1)
