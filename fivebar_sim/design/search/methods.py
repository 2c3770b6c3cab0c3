"""The methods of search: each asks for blocks of designs, and is told what became of them.

A method is a generator of blocks that depends on the task, its seed and what it was told alone. So
a search that was ended goes on by asking again from the start, with the answers that were kept.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Generator, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.evaluate import Evaluated
from fivebar_sim.design.evaluation.measures import limits
from fivebar_sim.design.search.front import costs
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import ConfigError, unknown

BLOCK = 16384
"""Designs in a block of a grid or a sample."""

BEATEN = 1e12
"""Cost of a design that breaks a constraint, times one and its violation: above that of any other,
but finite, as the methods need it."""

Asking = Generator[Array, Evaluated, None]
"""Yields values (n, d), and is sent what became of them."""


def method(task: Task) -> tuple[Asking, int]:
    """Return a task's search and how many designs it will ask for at most.

    Raises:
        ConfigError: A method that the task cannot have, or a package that is missing.
    """
    return METHODS[task.search.method](task)


def grid(task: Task) -> tuple[Asking, int]:
    """Return all combinations of evenly spaced values of each variable."""
    points = task.search.points
    if isinstance(points, dict):
        for key in points:
            if key not in task.names:
                raise ConfigError(
                    f"{task.where}: search.points: {unknown('variable', key, task.names)}"
                )
        missing = [name for name in task.names if name not in points]
        if missing:
            raise ConfigError(f"{task.where}: search.points has no {missing[0]}")

    of = {name: points[name] if isinstance(points, dict) else points for name in task.names}
    lines = [each.grid(of[each.key]) for each in task.variation.variables]
    total = math.prod(len(line) for line in lines)

    def ask() -> Asking:
        for rows in _blocks(total):
            index = np.unravel_index(rows, [len(line) for line in lines])
            values = [line[k] for line, k in zip(lines, index, strict=True)]
            yield np.stack(values, axis=-1).astype(float)

    return ask(), total


def sobol(task: Task) -> tuple[Asking, int]:
    """Return a sample that fills the space evenly."""
    # Slow to import, and only this method needs it.
    from scipy.stats import qmc

    total = task.search.designs

    def ask() -> Asking:
        sampler = qmc.Sobol(len(task.names), scramble=False)
        # Shifted by one random vector, so that each seed has a sample of its own.
        shift = np.random.default_rng(task.search.seed).random(len(task.names))
        for rows in _blocks(total):
            yield task.from_unit((_drawn(sampler, len(rows)) + shift) % 1.0)

    return ask(), total


def _drawn(sampler: Any, count: int) -> Array:
    """Return the next points of a Sobol sequence, which warns of numbers that are no power of 2."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return sampler.random(count)


def _blocks(total: int) -> Iterator[NDArray[np.int_]]:
    for start in range(0, total, BLOCK):
        yield np.arange(start, min(start + BLOCK, total))


def nsga(task: Task) -> tuple[Asking, int]:
    """Return the generations of NSGA-II or NSGA-III of pymoo."""
    algorithm, problem = _needs(_pymoo, "pymoo")(task)
    options = task.search

    def ask() -> Asking:
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        algorithm.setup(
            problem, termination=("n_gen", options.generations), seed=options.seed, verbose=False
        )
        while algorithm.has_next():
            infills = algorithm.ask()
            found = yield task.from_unit(np.clip(infills.get("X"), 0.0, 1.0))
            known = StaticProblem(problem, F=_finite(task, found), G=broken(task, found)[:, None])
            Evaluator().eval(known, infills)
            algorithm.tell(infills=infills)

    return ask(), options.population * options.generations


def _pymoo(task: Task) -> tuple[Any, Any]:
    """Return pymoo's algorithm and its problem: variables in [0, 1], one sum of violations."""
    from pymoo.core.problem import Problem

    problem = Problem(
        n_var=len(task.names), n_obj=len(task.objectives), n_ieq_constr=1, xl=0.0, xu=1.0
    )
    population = task.search.population
    if task.search.method == "nsga2":
        from pymoo.algorithms.moo.nsga2 import NSGA2

        return NSGA2(pop_size=population), problem

    if len(task.objectives) < 2:
        raise ConfigError(f'{task.where}: search.method "nsga3" needs two objectives or more')
    from pymoo.algorithms.moo.nsga3 import NSGA3
    from pymoo.util.ref_dirs import get_reference_directions

    parts = _partitions(len(task.objectives), population)
    directions = get_reference_directions("das-dennis", len(task.objectives), n_partitions=parts)
    return NSGA3(ref_dirs=directions, pop_size=population), problem


def _partitions(objectives: int, population: int) -> int:
    """Return into how many parts each axis is cut, so that there are at most as many directions."""
    fit = (n for n in itertools.count(1) if math.comb(n + objectives, objectives - 1) > population)
    return next(fit)


def cma_es(task: Task) -> tuple[Asking, int]:
    """Return the generations of CMA-ES for one objective."""
    if len(task.objectives) != 1:
        raise ConfigError(
            f'{task.where}: search.method "cma-es" follows one objective, this task has '
            f"{len(task.objectives)}"
        )
    start = _needs(_cma, "cma")
    options = task.search

    def ask() -> Asking:
        strategy = start(task)
        for _ in range(options.generations):
            shares = strategy.ask()
            found = yield task.from_unit(np.array(shares)[:, : len(task.names)])
            cost = _finite(task, found)[:, 0]
            strategy.tell(
                shares, np.where(found.feasible, cost, BEATEN * (1.0 + broken(task, found)))
            )
            if strategy.stop():
                return

    start(task)
    return ask(), options.population * options.generations


def _cma(task: Task) -> Any:
    """Return the strategy at its start, with a random generator of its own."""
    import cma

    rng = np.random.default_rng(task.search.seed)
    # It takes at least two dimensions: one that changes nothing does no harm.
    dimensions = max(2, len(task.names))
    options = {
        "bounds": [0.0, 1.0],
        "popsize": task.search.population,
        "seed": math.nan,
        "randn": lambda *shape: rng.standard_normal(shape),
        "verbose": -9,
    }
    return cma.CMAEvolutionStrategy(dimensions * [0.5], 0.25, options)


def _needs(function: Callable[[Task], Any], package: str) -> Callable[[Task], Any]:
    """Return a function that says what to install where its package is missing."""

    def call(task: Task) -> Any:
        try:
            return function(task)
        except ModuleNotFoundError as error:
            if str(error.name).split(".")[0] != package:
                raise
            raise ConfigError(
                f'search.method "{task.search.method}" needs the package {package}: '
                "pip install 'fivebar-sim[design]'"
            ) from None

    return call


def _finite(task: Task, found: Evaluated) -> Array:
    """Return costs (n, m), large where a design was dropped before they were known."""
    return np.nan_to_num(costs(task, found), nan=BEATEN, posinf=BEATEN, neginf=-BEATEN)


def broken(task: Task, found: Evaluated) -> Array:
    """Return by how much designs break their constraints, all together, (n,); 0 is feasible.

    Lengths count in sizes of the leg. A constraint that is not known, since an earlier one had
    dropped the design, counts 1: whoever gets further is better.
    """
    scale = [task.leg.size if each.unit == "m" else 1.0 for each in limits(task)]
    parts = np.nan_to_num(found.violations / np.array(scale), nan=1.0)
    total = parts.sum(axis=1)
    # An objective that is not defined makes a design infeasible, whatever its constraints say.
    return np.where(found.feasible, 0.0, np.maximum(total, 1e-12))


METHODS: dict[str, Callable[[Task], tuple[Asking, int]]] = {
    "grid": grid,
    "sobol": sobol,
    "nsga2": nsga,
    "nsga3": nsga,
    "cma-es": cma_es,
}
