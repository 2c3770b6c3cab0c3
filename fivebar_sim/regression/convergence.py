"""How the metrics of a run converge as its timestep is halved; see `runs.extrapolation`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from fivebar_sim import rollout
from fivebar_sim.errors import ConfigError, DivergedError
from fivebar_sim.integrator import Integrator
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import ABSOLUTE
from fivebar_sim.metrics.limits import has, look_up
from fivebar_sim.runs.coarse import NUMERICAL
from fivebar_sim.runs.extrapolation import Convergence, converge, holds
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.refined import refined

FEWEST = 2
MOST = 6
"""Halvings of the timestep: two give the three runs that an order needs."""

OTHER: dict[str, Integrator] = {"discrete": "implicitfast", "implicitfast": "discrete"}


class Study(NamedTuple):
    """The runs of one scenario under one integrator, from the coarsest to the finest.

    Attributes:
        integrator: MuJoCo's integrator.
        timesteps: [s].
        metrics: How each metric of a baseline converges, by dotted key.
        tripped: The messages of the guards that tripped at each timestep.
    """

    integrator: Integrator
    timesteps: list[float]
    metrics: dict[str, Convergence]
    tripped: list[list[str]]


def plans(scenario: Scenario, halvings: int, integrator: Integrator) -> list[rollout.AnyPlan]:
    """Return the plans at h, h / 2, ...; see `refined`.

    Raises:
        ConfigError: Too few or too many halvings, or a run that has too many steps.
    """
    if not FEWEST <= halvings <= MOST:
        raise ConfigError(f"halvings must be {FEWEST} to {MOST}, got {halvings}")
    return [rollout.plan(refined(scenario, 2**n, integrator)) for n in range(halvings + 1)]


def study(planned: Sequence[rollout.AnyPlan]) -> Study:
    """Return how the metrics of plans at h, h / 2, ... converge.

    Raises:
        DivergedError: A simulation broke down; says which, and when.
    """
    results = [_executed(each) for each in planned]
    tables = [result.metrics for result in results]
    keys = [key for key in ABSOLUTE if has(tables[0], key) and key not in NUMERICAL]
    return Study(
        integrator=planned[0].scenario.sim.integrator,
        timesteps=[each.scenario.sim.timestep for each in planned],
        metrics={
            key: converge([look_up(table, key) for table in tables], ABSOLUTE[key]) for key in keys
        },
        tripped=[guards.tripped(result.measured.guards) for result in results],
    )


def _executed(planned: rollout.AnyPlan) -> rollout.Result:
    try:
        return rollout.execute(planned)
    except DivergedError as error:
        sim = planned.scenario.sim
        which = f"{sim.integrator} at a timestep of {sim.timestep:g} s"
        raise DivergedError(f"{which}: {error}", error.time) from None


def written(found: Study) -> dict[str, Any]:
    """Return a study as JSON has it."""
    return {
        "integrator": found.integrator,
        "timesteps": found.timesteps,
        "metrics": {key: each._asdict() for key, each in found.metrics.items()},
        "tripped": found.tripped,
    }


def failures(found: Study, bar: float, allowed: Mapping[str, float]) -> list[str]:
    """Return the keys of the metrics whose error at h is above the bar.

    Args:
        found: The study.
        bar: Largest relative error.
        allowed: Metrics with a bar of their own, as the scenario's table [converge] has them.
    """
    return [
        key
        for key, each in found.metrics.items()
        if not holds(each, max(bar, allowed.get(key, 0.0)), ABSOLUTE[key])
    ]
