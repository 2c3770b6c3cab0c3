"""Tolerance yield: the share of built legs that still keep to every constraint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.evaluate import evaluate
from fivebar_sim.design.evaluation.measures import limits
from fivebar_sim.design.robust.built import TOLERANCE, built
from fivebar_sim.design.task.task import Task

DRAWN = 4096
"""Built legs that are drawn of a design: a share of 0.99 is right to 0.2 %."""


class Yield(NamedTuple):
    """Built legs of one design.

    Attributes:
        share: The part of them that keeps to every constraint.
        error: Standard error of it.
        broken: By constraint, the part of them that breaks it first, the most frequent one first.
        spread: By objective, its relative 5th and 95th percentile among all that have one.
    """

    share: float
    error: float
    broken: dict[str, float]
    spread: dict[str, tuple[float, float]]


def tolerance_yield(
    task: Task, row: Array, tolerance: float = TOLERANCE, *, drawn: int = DRAWN, seed: int = 0
) -> Yield:
    """Return what becomes of built legs of a design (d,).

    All dimensions are off independently, evenly within the tolerance; see `built`.

    Args:
        task: The task.
        row: The design.
        tolerance: How far each distance and each hole may be off [m].
        drawn: Number of legs.
        seed: Seed of the drawing.
    """
    own = built(task, row, tolerance)
    found = evaluate(own, own.sample(drawn, seed))
    share = float(found.feasible.mean())

    broken = {
        limit.name: float((found.violations[:, k] > 0.0).mean())
        for k, limit in enumerate(limits(own))
    }
    often = sorted((name for name in broken if broken[name] > 0.0), key=lambda n: -broken[n])

    spread: dict[str, tuple[float, float]] = {}
    nominal = evaluate(task, np.asarray(row, dtype=float)[None]).objectives[0]
    for k, name in enumerate(own.objectives):
        values = found.objectives[:, k]
        values = values[np.isfinite(values)]
        if len(values) and nominal[k]:
            low, high = np.percentile(values, [5.0, 95.0]) / nominal[k] - 1.0
            spread[name] = (float(low), float(high))
    return Yield(
        share=share,
        error=float(np.sqrt(share * (1.0 - share) / drawn)),
        broken={name: broken[name] for name in often},
        spread=spread,
    )
