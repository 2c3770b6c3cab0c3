"""`fivebar converge`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import NO_WORDS, Settings, screen, spinner
from fivebar_sim.cli.terminal import FAILED, say
from fivebar_sim.errors import ArgumentError, DivergedError, FiveBarError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fivebar_sim.regression.convergence import Study
    from fivebar_sim.rollout import AnyPlan


def converge(
    scenario: Positional[Annotated[str, arg(metavar="SCENARIO")]],
    /,
    *,
    settings: Settings = NO_WORDS,
    halvings: int = 2,
    bar: float = 2.0,
    alone: bool = False,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Show which metrics a scenario's timestep already gets right.

    It is run with that timestep h, with h/2 and with h/4. For each metric: its value at h, its
    value extrapolated to h = 0, the order, and the error at h; beside it the limit under the other
    integrator. Exit status 1 if an error is above the bar, or above the metric's own in the
    scenario's table [converge].

    Args:
        scenario: Name of a shipped scenario, or path of a TOML file.
        settings: Change one key of the scenario, e.g. sim.timestep=0.0005; may be repeated.
        halvings: How often the timestep is halved, 2 to 6; the three finest runs are extrapolated.
        bar: Largest error of a metric at h [%].
        alone: Leave the other integrator out.
        quiet: Print nothing but errors.
        json: Print JSON instead of a table.
    """
    import json as text

    from fivebar_sim.cli import console
    from fivebar_sim.regression import convergence

    if not 0.0 <= bar < float("inf"):
        raise ArgumentError(f"--bar must be in [0, inf) %, got {bar:g}")
    planned, others = _plans(scenario, settings, halvings, alone=alone)
    with spinner(f"running {planned[0].scenario.name} in finer and finer steps", quiet=quiet):
        found = convergence.study(planned)
        other = _other(others)

    tried = planned[0].scenario
    part = 0.01 * bar
    failed = convergence.failures(found, part, tried.converge)
    if json:
        written = {"scenario": tried.name, "bar": part, **convergence.written(found)}
        written["failed"] = failed
        written["other"] = None if other is None else convergence.written(other)
        print(text.dumps(written, indent=2, allow_nan=False))  # noqa: T201
    elif not quiet:
        console.print_convergence(tried, found, other, failed, screen())
    return FAILED if failed else 0


def _plans(
    source: str, settings: Sequence[str], halvings: int, *, alone: bool
) -> tuple[list[AnyPlan], list[AnyPlan]]:
    """Return the plans under the scenario's integrator, and under the other one."""
    from fivebar_sim.cli import memory
    from fivebar_sim.errors import ConfigError
    from fivebar_sim.regression import convergence
    from fivebar_sim.scenario import Scenario

    loaded = Scenario.load(source, settings)
    integrator = loaded.sim.integrator
    # The finest run is about as long as all others together.
    memory.check(loaded.steps * 2 ** (min(max(halvings, 0), convergence.MOST) + 1))
    try:
        planned = convergence.plans(loaded, halvings, integrator)
        if alone:
            return planned, []
        return planned, convergence.plans(loaded, halvings, convergence.OTHER[integrator])
    except FiveBarError as error:
        raise ConfigError(f"{source}: {error}") from None


def _other(planned: list[AnyPlan]) -> Study | None:
    """Return the study under the other integrator; None without plans, or where it breaks down."""
    from fivebar_sim.regression import convergence

    try:
        return convergence.study(planned) if planned else None
    # The scenario's own integrator decides; the other one need not stand these timesteps.
    except DivergedError as error:
        say(error)
        return None
