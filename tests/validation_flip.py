"""Pushed as hard as 80 N at every place that a leg reaches: does it stay in its assembly?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import validation_air as air
from validation_air import Key

from fivebar_sim import kinematics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import UnreachableError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.paths import Line
from fivebar_sim.rollout import Plan
from fivebar_sim.scenario.forces import Constant
from fivebar_sim.scenario.scenes import Payload
from fivebar_sim.simulation import steps

FORCE = 80.0  # [N]
# [s]
GROWS = 0.2
DURATION = 0.3
STIFF = Servo(kp=2000.0, kd=20.0)
SOFT = Servo(kp=50.0, kd=0.3)
"""Of `classic`; other legs have them scaled with their size."""

CLASSIC = FiveBar.load("classic").size  # [m]


class Count(NamedTuple):
    """What became of the leg at all places.

    Attributes:
        places: How many.
        assembly: At how many it left its assembly.
        mode: At how many it left its working mode alone: a knee was pushed straight.
        broken: At how many the simulation broke down.
        moved: The farthest that the foot was pushed, of those that did nothing of this [m].
        gap: The largest loop gap of those [m].
        flipped: Where it left its assembly, feet [m], (assembly, 2).
    """

    places: int
    assembly: int
    mode: int
    broken: int
    moved: float
    gap: float
    flipped: Array


def places(leg: FiveBar, cells: int) -> Array:
    """Return the centres of cells x cells squares over twice the leg's size, (cells^2, 2) [m]."""
    at = (2.0 * (np.arange(cells) + 0.5) / cells - 1.0) * leg.size
    return np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)


def held(
    leg: FiveBar, foot: Array, up: float, servo: Servo, integrator: Integrator, timestep: float
) -> Plan | None:
    """Return the plan of a foot held in a place under a force that grows to 80 N and stays.

    None where the leg cannot be. The force goes with up, +1 or -1.
    """
    x, z = foot.tolist()
    factor = leg.size / CLASSIC
    key = Key(leg.name, integrator, "none", timestep)
    scenario = air.scenario(
        leg,
        Line(start=(x, z), stop=(x, z), frequency=1.0 / DURATION, ramp=0.0),
        Servo(kp=servo.kp * factor, kd=servo.kd * factor),
        key,
        Payload(),
        DURATION,
        force=Constant(value=(0.0, up * FORCE)),
    )
    try:
        plan = rollout.plan(scenario)
    except UnreachableError:
        return None
    growth = np.minimum(plan.motion.time[:-1] / GROWS, 1.0)
    return plan._replace(pushes=growth[:, None] * plan.pushes)


def push(
    preset: str, up: float, servo: Servo, integrator: Integrator, timestep: float, cells: int = 14
) -> Count:
    """Return what becomes of a preset at all places that it reaches; see `held`."""
    leg = FiveBar.load(preset)
    asked = (held(leg, f, up, servo, integrator, timestep) for f in places(leg, cells))
    plans = [plan for plan in asked if plan is not None]
    states = steps.simulate(
        [plan.model for plan in plans],
        np.stack([plan.start for plan in plans]),
        np.stack([plan.ctrl for plan in plans]),
        nthread=2,
    )
    broken = np.array([steps.is_broken(states.rows([i]), slice(None)) for i in range(len(plans))])
    q = np.where(broken[:, None, None], states.qpos[:, :1], states.qpos)
    points = kinematics.chain_points(leg, q)
    s_A, s_E, assembly = kinematics.branch(leg, points)
    flips = (assembly != leg.assembly).any(axis=1)
    modes = ((s_A != leg.mode[0]) | (s_E != leg.mode[1])).any(axis=1) & ~flips
    good = ~(broken | flips | modes)
    start = np.stack([plan.motion.foot[0] for plan in plans])
    moved = np.linalg.norm(points.F - start[:, None], axis=-1)[good]
    gap = np.linalg.norm(points.C_left - points.C_right, axis=-1)[good]
    return Count(
        places=len(plans),
        assembly=int(flips.sum()),
        mode=int(modes.sum()),
        broken=int(broken.sum()),
        moved=float(moved.max()),
        gap=float(gap.max()),
        flipped=start[flips],
    )
