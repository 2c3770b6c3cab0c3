"""Random scenarios whose motors have torque limits, and the torque that their motion needed.

That torque comes from the momentum of every step, and not from the law of the servo.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.steps import States

BASES = {
    "classic-ellipse": 0.0025,
    "classic-figure-eight": 0.0025,
    "classic-pd-sensors": 0.005,
    "payload-ellipse": 0.05,
    "airhockey-pd": 1.0,
    "rail-landing": 0.4,
    "rail-hop": 0.5,
    "q8bot-squat": 0.1,
    "doggo-landing": 1.2,
    "treadmill-trot": 0.3,
    "minitaur-treadmill": 0.8,
}
"""Shipped scenarios, and about the torque that each needs [N m]."""


def settings(seed: int) -> tuple[str, list[str]]:
    """Return the name of a shipped scenario and settings that give its servo a random limit."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(list(BASES)))
    scenario = Scenario.load(name)

    def near(value: float, factor: float) -> float:
        return float(value * factor ** rng.uniform(-1.0, 1.0))

    sets = [
        "limits={}",
        f"duration={max(1.25, scenario.path.ramp + (scenario.path.period or 0.0))}",
        f"servo.limit={near(BASES[name], 2.0)}",
        f"servo.kp={near(scenario.servo.kp, 4.0)}",
        f"servo.kd={near(max(scenario.servo.kd, 1e-3), 6.0)}",
        f"sim.timestep={rng.choice([0.0005, 0.001, 0.002])}",
        f"sim.integrator={rng.choice(['discrete', 'implicitfast'])}",
    ]
    if rng.random() < 0.5:
        sets.append(f"servo.speed={near(30.0, 5.0)}")
    if scenario.controller_name == "servo":
        sets.append(f"controller.feedforward={rng.choice(['none', 'velocity', 'torque'])}")
    return name, sets


class Run(NamedTuple):
    """A run, its states, and its plan."""

    plan: Plan
    states: States
    result: Result


def run(name: str, sets: list[str]) -> Run:
    """Return a run with its states."""
    planned = rollout.plan(Scenario.load(name, sets))
    seen: list[States] = []
    result = rollout.execute(planned, seen.append)
    return Run(planned, States.joined(seen), result)


def needed(ran: Run) -> Array:
    """Return the torques of A and E that the momentum of every step needs [N m], (N, 2)."""
    built = ran.plan.model
    states = ran.states
    q = np.concatenate([ran.plan.start[None], states.qpos[0, :-1]])
    v = np.concatenate([np.zeros((1, built.nv)), states.qvel[0, :-1]])
    gained = (states.qvel[0] - v) / built.opt.timestep
    data = mujoco.MjData(built)
    M = np.zeros((built.nv, built.nv))
    torque = np.empty((len(q), 2))
    motors = slice(-4, None, 2)
    for k in range(len(q)):
        data.qpos[:] = q[k]
        data.qvel[:] = v[k]
        data.ctrl[:] = states.ctrl[0, k]
        mujoco.mj_forward(built, data)
        mujoco.mj_fullM(built, data, M)
        moved = M @ gained[k] + data.qfrc_bias - states.constraint[0, k]
        pushed = data.qfrc_actuator[motors] - data.actuator_force[-2:]
        torque[k] = moved[motors] - pushed
    return torque


def beyond(ran: Run) -> float:
    """Return the largest part of the limit by which the needed torque is beyond it in a step."""
    servo = ran.plan.scenario.servo
    assert servo.limit is not None
    line = needed(ran) + servo.back_emf * ran.states.qvel[0, :, -4::2]
    return max(float(np.abs(line).max() / servo.limit - 1.0), 0.0)


def untold(ran: Run) -> float:
    """Return the largest part of the limit by which the record's torque is not the needed one."""
    limit = ran.plan.scenario.servo.limit
    assert limit is not None
    told = np.stack([ran.result.record[f"torque_{motor}"] for motor in "AE"], axis=1)
    return float(np.abs(needed(ran) - told).max() / limit)
