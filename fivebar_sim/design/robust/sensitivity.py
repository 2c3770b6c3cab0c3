"""Sobol sensitivities: how much of each objective's scatter each dimension is to blame for."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.evaluate import evaluate
from fivebar_sim.design.robust.built import TOLERANCE, built, unbound
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import ConfigError, ExtraError

DRAWN = 512
"""Base samples: each takes one evaluation, and one more for each dimension."""


class Sensitivity(NamedTuple):
    """How an objective of a built leg depends on its dimensions.

    Attributes:
        objective: Its name.
        spread: Standard deviation among built legs, as a part of the nominal value.
        first: By dimension, the part of the variance that it causes alone.
        total: By dimension, the part that would go if it were exact; 0 if there is no scatter.
    """

    objective: str
    spread: float
    first: dict[str, float]
    total: dict[str, float]

    @property
    def worst(self) -> str:
        """The dimension that has to be right."""
        return max(self.total, key=self.total.__getitem__)


def sensitivities(
    task: Task, row: Array, tolerance: float = TOLERANCE, *, drawn: int = DRAWN, seed: int = 0
) -> list[Sensitivity]:
    """Return the Sobol sensitivities of each objective of a design (d,) to its dimensions.

    Args:
        task: The task.
        row: The design.
        tolerance: How far each distance and each hole may be off [m].
        drawn: Base samples, a power of two.
        seed: Seed of the sample.

    Raises:
        ConfigError: SALib is not installed, or a built leg may have no objectives: its foot does
            not reach its path.
    """
    try:
        from SALib.analyze import sobol as analysis
        from SALib.sample import sobol as sampling
    except ImportError:
        raise ExtraError("sensitivities need SALib: pip install 'fivebar-sim[design]'") from None

    own = unbound(built(task, row, tolerance))
    low, high = own.bounds
    names = [name.removeprefix("leg.") for name in own.names]
    problem = {"num_vars": len(names), "names": names, "bounds": np.stack([low, high], 1).tolist()}
    values = sampling.sample(problem, drawn, calc_second_order=False, seed=seed)
    found = evaluate(own, np.asarray(values)).objectives
    if not np.isfinite(found).all():
        raise ConfigError(
            f"{1e3 * tolerance:g} mm is too much for sensitivities: some of the built legs do not "
            "reach their path"
        )

    nominal = evaluate(own, 0.5 * (low + high)[None]).objectives[0]
    return [
        _sensitivity(name, nominal[k], found[:, k], analysis, problem, seed)
        for k, name in enumerate(own.objectives)
    ]


def _sensitivity(
    name: str, nominal: float, values: Array, analysis: Any, problem: dict[str, Any], seed: int
) -> Sensitivity:
    names = problem["names"]
    spread = float(values.std() / abs(nominal)) if nominal else 0.0
    # Rounding alone is no scatter: its shares would be noise.
    if not values.std() > 1e-9 * abs(nominal):
        zero = dict.fromkeys(names, 0.0)
        return Sensitivity(name, 0.0, zero, dict(zero))
    # Resampled for confidence intervals only, which nobody reads.
    shares = analysis.analyze(problem, values, calc_second_order=False, num_resamples=2, seed=seed)
    first = {key: max(float(s), 0.0) for key, s in zip(names, shares["S1"], strict=True)}
    total = {key: max(float(s), 0.0) for key, s in zip(names, shares["ST"], strict=True)}
    return Sensitivity(name, spread, first, total)
