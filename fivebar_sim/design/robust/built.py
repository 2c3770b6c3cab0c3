"""A design as it is built: the task of one design in which only its own dimensions vary."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.design.task.options import Constraints
from fivebar_sim.design.task.task import Task
from fivebar_sim.design.task.variables import Variable
from fivebar_sim.design.task.variation import Variation

TOLERANCE = 2e-4
"""How far a distance between two holes may be off [m]: a printed part."""

LINKS = ("L1", "L2", "L3", "L4", "L5", "L6")


def built(task: Task, row: Array, tolerance: float = TOLERANCE) -> Task:
    """Return the task of one design (d,), whose variables are the dimensions of its leg.

    Each link is longer or shorter by up to the tolerance, L5 is the distance of the motors' holes,
    and `leg.tilt` turns by as much as one of them may sit higher than the other. Servo, gear, foot
    motions and regions are the design's.

    Args:
        task: The task.
        row: The design.
        tolerance: How far each distance and each hole may be off [m].

    Raises:
        ArgumentError: A tolerance that is not positive, or not below half of a link.
    """
    leg = task.leg_of(row)
    lengths = {key: getattr(leg, key) for key in LINKS}
    # A leg that has no extension, or whose motors share an axis, has no such dimension.
    lengths = {key: length for key, length in lengths.items() if length > 0.0}
    least = min(lengths.values())
    check_number("tolerance", tolerance, "m", low=0.0, high=0.5 * least, strict=True)

    varied = [
        Variable(f"leg.{key}", length - tolerance, length + tolerance)
        for key, length in lengths.items()
    ]
    if leg.L5 > 0.0:
        turn = math.atan(tolerance / leg.L5)
        varied.append(Variable("leg.tilt", leg.tilt - turn, leg.tilt + turn))
    table = {**task.table, "vary": {}}
    return dataclasses.replace(
        task,
        table=table,
        leg=leg,
        # The leg has the rotor's inertia already, through the gear.
        rotor=True,
        servos=(task.servo(row),),
        gear=gear(task, row),
        motions=task.motions_of(row),
        covers=task.covers_of(row),
        variation=Variation(tuple(varied), ()),
        _fixed={},
    )


def gear(task: Task, row: Array) -> float:
    """Return the gear ratio of a design."""
    found = task.variation.column(np.asarray(row, dtype=float)[None], "gear")
    return task.gear if found is None else float(found[0])


def unbound(task: Task) -> Task:
    """Return a task with nothing forbidden but what has no numbers: to see how they change."""
    return dataclasses.replace(
        task, constraints=Constraints(reach=0.0, singular=1e-9, line=1e9), _fixed={}
    )
