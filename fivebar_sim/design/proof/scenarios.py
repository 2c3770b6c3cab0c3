"""The scenarios in which MuJoCo does what a design was evaluated for."""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from fivebar_sim import control
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.design.task.motions import FootMotion
from fivebar_sim.design.task.task import Task
from fivebar_sim.integrator import Sim
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Air, Payload

TIMESTEP = 2.5e-4
"""Longest timestep [s]: gear friction flips within a step, which shakes a soft servo by as much."""

FEWEST = 200
"""Least timesteps of a motion's span: a fast path gets shorter ones."""

SETTLING = 1
"""Periods after the ramp that are run before the one that is measured."""


class Case(NamedTuple):
    """A foot motion of a design, as a run.

    Attributes:
        scenario: The run.
        weight: Share of the motion, relative to the others'.
        seconds: How long the part lasts that is measured, at the end of the run [s].
    """

    scenario: Scenario
    weight: float
    seconds: float


def cases(task: Task, row: Array) -> list[Case]:
    """Return the runs of a design (d,), one for each foot motion of the task.

    The setpoints come at every timestep, exact and at once: a bus and its rounding are no part of
    what is evaluated. Motor, gear friction and rotor are the servo's.

    Raises:
        ConfigError: A leg that cannot be.
    """
    return [_case(task, row, motion) for motion in task.motions_of(row)]


def heard(servo: Servo) -> Servo:
    """Return a servo that hears every setpoint, exact and at once."""
    return msgspec.structs.replace(servo, rate=None, delay=0.0, resolution=0.0)


def _case(task: Task, row: Array, motion: FootMotion) -> Case:
    first, last = motion.span
    seconds = last - first
    period = motion.path.period
    duration = last if period is None else last + SETTLING * period
    steps = max(FEWEST, round(seconds / TIMESTEP))

    loaded = motion.force is not None or motion.payload > 0.0
    scenario = Scenario(
        name=f"{task.name}-{motion.name}",
        leg=task.leg_of(row),
        path=motion.path,
        controller=control.find("servo")(feedforward="torque"),
        controller_name="servo",
        scene=Payload(mass=motion.payload) if loaded else Air(),
        duration=duration,
        force=motion.force,
        servo=heard(task.geared(row)),
        sim=Sim(timestep=seconds / steps),
    )
    return Case(scenario, motion.weight, seconds)
