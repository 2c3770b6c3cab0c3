"""MuJoCo's contact with friction against dry friction on stiff springs: the squat of `classic`.

Its two servos push against each other through the floor, so what the foot slides and creeps
decides how they share the load.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import oracle
import oracle_coulomb
import validation_air as air
import validation_stance as stance
from validation_air import Key

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator


class Load(NamedTuple):
    """What a squat costs after its ramp: A's share, and the RMS torques of A and E [N m]."""

    share: float
    A: float
    E: float


@cache
def coulomb(duration: float, stiffness: float, damping: float) -> Load:
    """Return the load with dry friction of 1.

    Args:
        duration: Length of the squat [s].
        stiffness: Of the floor's springs [N/m].
        damping: Of them [N s/m].
    """
    leg = FiveBar.load("classic")
    floor = oracle_coulomb.Floor(stance.TRUNK, leg.foot_radius, 1.0, stiffness, damping)
    law = air.servo_of(stance.gains(leg), "velocity")
    path = air.path_of(stance.squat(leg))
    times = stance.GRID[: round(duration / air.TIMESTEPS[0])]
    return _load(oracle_coulomb.simulate(oracle.Leg.of(leg), floor, law, path, times).tau)


def mujoco(
    integrator: Integrator,
    timestep: float,
    duration: float,
    *,
    impratio: float | None = None,
    noslip: int = 0,
    hard: bool = False,
) -> Load:
    """Return the load with MuJoCo's contact of friction 1.

    Args:
        integrator: MuJoCo's integrator.
        timestep: h [s].
        duration: Length of the squat [s].
        impratio: How much harder friction is than the normal contact; None: as leg.xml has it.
        noslip: Iterations of the solver that takes all softness out of friction.
        hard: Whether the contact is that of `stance.harden`.
    """
    key = Key("classic", integrator, "velocity", timestep)
    plan = stance.planned(key, grips=True, duration=duration)
    if impratio is not None:
        plan.model.opt.impratio = impratio
    plan.model.opt.noslip_iterations = noslip
    record = air.sampled(rollout.execute(stance.harden(plan) if hard else plan), 0)
    return _load(air.pair(record, "torque_A", "torque_E"))


def _load(tau: Array) -> Load:
    """Return the load of torques at the rows of `stance.GRID`."""
    late = tau[stance.FIRST :]
    A, E = np.abs(late).sum(axis=0).tolist()
    rms = air.rms(late).tolist()
    return Load(A / (A + E), rms[0], rms[1])
