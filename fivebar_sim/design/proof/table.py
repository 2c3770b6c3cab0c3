"""Predicted against simulated: a row a design, and how well their order agrees."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.evaluate import evaluate
from fivebar_sim.design.proof.simulate import Simulated, simulated
from fivebar_sim.design.task.task import Task
from fivebar_sim.workers.here import Workers

MEASURED = ("torque_peak", "torque_rms", "heat", "energy", "balance")
"""Objectives that a simulation measures; the others are numbers of the leg itself."""


SAMPLES = 1024
"""Samples of each motion here: among designs whose peaks differ by less than what a peak may hide
between the samples of a search, those would tell nothing of the order."""


class Proof(NamedTuple):
    """Designs with what the closed form predicted and what MuJoCo measured.

    Attributes:
        values: The designs, (n, d).
        predicted: By objective, (n,).
        measured: By objective, (n,); NaN where a simulation broke down.
        runs: What came of each design.
    """

    values: Array
    predicted: dict[str, Array]
    measured: dict[str, Array]
    runs: list[Simulated]

    @property
    def rank(self) -> dict[str, float]:
        """Spearman's rank correlation by objective; NaN of fewer than two designs."""
        return {key: spearman(self.predicted[key], self.measured[key]) for key in self.measured}

    @property
    def worst(self) -> dict[str, float]:
        """Largest difference by objective, as a part of the prediction."""
        return {
            key: float(np.nanmax(np.abs(found / self.predicted[key] - 1.0)))
            for key, found in self.measured.items()
            if np.isfinite(found).any()
        }

    def rows(self, task: Task) -> list[dict[str, Any]]:
        """Return a row a design: its values, each objective predicted and simulated, and guards."""
        table = []
        for k, run in enumerate(self.runs):
            row: dict[str, Any] = {"design": k, **task.settings(self.values[k])}
            for key in self.measured:
                row[f"{key}.predicted"] = float(self.predicted[key][k])
                row[f"{key}.simulated"] = run.measured.get(key)
            row |= {"guards": list(run.guards), "error": run.error or None}
            table.append(row)
        return table


def prove(task: Task, values: Array, workers: Workers | None = None, watch: Any = None) -> Proof:
    """Return designs of a task, predicted and simulated.

    Args:
        task: The task.
        values: The designs, (n, d).
        workers: Who simulates; None is this process.
        watch: Is told how many designs are done, and how many there are.
    """
    runs = simulated(task, values, workers, watch)
    names = [key for key in MEASURED if any(key in run.measured for run in runs)]
    predicted = predictions(task, values, names)
    measured = {
        key: np.array([run.measured.get(key, np.nan) for run in runs], dtype=float) for key in names
    }
    return Proof(values, predicted, measured, runs)


def predictions(task: Task, values: Array, names: Sequence[str]) -> dict[str, Array]:
    """Return objectives of designs by name, also those that the task does not seek."""
    asked = dataclasses.replace(task, objectives=tuple(names), samples=SAMPLES, _fixed={})
    found = evaluate(asked, values).objectives
    return {name: found[:, k] for k, name in enumerate(names)}


def spearman(one: Array, other: Array) -> float:
    """Return Spearman's rank correlation; equal values share their mean rank, NaN is left out."""
    there = np.isfinite(one) & np.isfinite(other)
    ranks = [_ranks(values[there]) for values in (one, other)]
    spread = [float(r.std()) for r in ranks]
    if there.sum() < 2 or not all(spread):
        return float("nan")
    a, b = ((r - r.mean()) / s for r, s in zip(ranks, spread, strict=True))
    return float((a * b).mean())


def _ranks(values: Array) -> Array:
    """Return the rank of each value, equal ones their mean."""
    _, which, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return (last - 0.5 * (counts - 1))[which]
