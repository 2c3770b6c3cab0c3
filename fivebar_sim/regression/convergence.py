"""How the metrics of a run converge as its timestep is halved, and to what.

With v(h) = limit + c h^p, three runs at h, h / 2 and h / 4 give order and limit:

    2^p = (v(h) - v(h/2)) / (v(h/2) - v(h/4)),   limit = v(h/4) + (v(h/4) - v(h/2)) / (2^p - 1)

With more halvings the three finest runs decide. The extrapolation is Richardson's; it says nothing
about an error that all timesteps share, such as that of a contact that is too soft.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from fivebar_sim import rollout
from fivebar_sim.errors import ConfigError, DivergedError
from fivebar_sim.integrator import Integrator
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.catalogue import ABSOLUTE
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.runs.coarse import NUMERICAL
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.refined import refined

FEWEST = 2
MOST = 6
"""Halvings of the timestep: two give the three runs that an order needs."""

SLOWEST = 0.5
"""Lowest order that is extrapolated: below it the limit would be far beyond all runs."""

ROUNDING = 1e-9
"""Differences below this part of a value are rounding."""

OTHER: dict[str, Integrator] = {"discrete": "implicitfast", "implicitfast": "discrete"}


class Convergence(NamedTuple):
    """How one metric converges.

    Attributes:
        value: At the timestep h of the scenario.
        limit: Extrapolated to h = 0; None where the values do not converge.
        order: p; None where the values do not converge, or no longer change.
        error: |value - limit| / |limit|; where the values do not converge, their range as a part of
            the finest one. None where that is undefined, as of a limit that is 0.
    """

    value: float | None
    limit: float | None
    order: float | None
    error: float | None


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


def converge(values: Sequence[float | None], tolerance: float = 0.0) -> Convergence:
    """Return how a value converges.

    Args:
        values: At h, h / 2, h / 4, ...: at least three.
        tolerance: Values that differ by no more are settled.
    """
    numbers = [each for each in values if each is not None]
    if len(numbers) < len(values):
        # Undefined everywhere is as settled as it gets; defined here and there is not.
        return Convergence(values[0], None, None, None if numbers else 0.0)

    first = numbers[0]
    coarse, middle, finest = numbers[-3:]
    spread = max(numbers) - min(numbers)
    rounding = ROUNDING * abs(finest)
    if spread <= tolerance or abs(middle - finest) <= rounding:
        return Convergence(first, finest, None, _relative(first - finest, finest))

    ratio = (coarse - middle) / (middle - finest)
    if not ratio >= 2.0**SLOWEST:
        return Convergence(first, None, None, _relative(spread, finest))

    limit = finest + (finest - middle) / (ratio - 1.0)
    return Convergence(first, limit, math.log2(ratio), _relative(first - limit, limit))


def _relative(difference: float, of: float) -> float | None:
    """Return |difference / of|; 0 / 0 is 0, and None stands for infinity."""
    if difference == 0.0:
        return 0.0
    return abs(difference / of) if of != 0.0 else None


def holds(found: Convergence, bar: float, tolerance: float) -> bool:
    """Return whether a value is as good as its limit.

    Args:
        found: How it converges.
        bar: Largest relative error.
        tolerance: Largest absolute error, for values that are next to nothing.
    """
    if found.error is not None and found.error <= bar:
        return True
    if found.value is None or found.limit is None:
        return False
    return abs(found.value - found.limit) <= tolerance


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
    keys = [key for key in ABSOLUTE if key.split(".")[0] in tables[0] and key not in NUMERICAL]
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
