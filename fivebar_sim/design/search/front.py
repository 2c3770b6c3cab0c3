"""The front: the feasible designs that no other one beats in all objectives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.evaluate import Evaluated
from fivebar_sim.design.evaluation.objectives import CATALOGUE
from fivebar_sim.design.task.task import Task

Rows = NDArray[np.int64]


class Front(NamedTuple):
    """The front of the designs seen so far.

    Attributes:
        rows: Which designs they are: their numbers in the order of evaluation, rising, (n,).
        designs: The designs.
    """

    rows: Rows
    designs: Evaluated

    def joined(self, task: Task, first: int, block: Evaluated) -> Front:
        """Return the front of these and of a block of further designs, numbered from `first`."""
        good = np.flatnonzero(block.feasible)
        # Alone first: what its own block beats need not be compared with the rest.
        own = good[beaten_by_none(costs(task, block.take(good)))]
        rows = np.concatenate([self.rows, first + own])
        both = Evaluated.joined([self.designs, block.take(own)])
        kept = beaten_by_none(costs(task, both))
        return Front(rows[kept], both.take(kept))


def empty(task: Task, block: Evaluated) -> Front:
    """Return the front of no designs, with the columns of a block."""
    return Front(np.empty(0, dtype=np.int64), block.take(slice(0, 0)))


def costs(task: Task, designs: Evaluated) -> Array:
    """Return objectives of which less is better, (n, m)."""
    senses = np.array([CATALOGUE[name].sense for name in task.objectives])
    return designs.objectives * senses


def beaten_by_none(cost: Array) -> Rows:
    """Return the rows that no other row is at least as good as in all columns, rising.

    Of equal rows the first is kept, so that the result does not depend on what was compared when.

    Args:
        cost: Of which less is better, (n, m).
    """
    # In this order a row can be beaten only by one before it: one pass is enough.
    order = np.lexsort((np.arange(len(cost)), *cost.T[::-1]))
    left = cost[order]
    if cost.shape[1] <= 2:
        best = np.minimum.accumulate(left[:, -1])
        before = np.concatenate([[np.inf], best[:-1]])
        return np.sort(order[left[:, -1] < before])

    rows = order
    kept = []
    while len(left):
        kept.append(rows[0])
        better_somewhere = (left < left[0]).any(axis=1)
        left = left[better_somewhere]
        rows = rows[better_somewhere]
    return np.sort(np.array(kept, dtype=np.int64))
