"""`fivebar check`."""

from __future__ import annotations

from fivebar_sim.commands.common import FAILED, Scenarios, Settings, plans_of, say, screen, working
from fivebar_sim.errors import DivergedError


def check(scenarios: Scenarios = (), /, *, settings: Settings = (), quiet: bool = False) -> int:
    """Run scenarios against their limits; exit status 1 if any limit is broken.

    Args:
        scenarios: Names of shipped scenarios or paths of TOML files; none: all that ship.
        settings: Change one key of every scenario, as sim.timestep=0.0005; repeats.
        quiet: Print nothing but errors.
    """
    from fivebar_sim import console, rollout

    status, results = 0, []
    for planned in plans_of(scenarios, settings):
        try:
            with working(f"checking {planned.scenario.name}", quiet=quiet):
                results.append(rollout.execute(planned))
        except DivergedError as error:
            say(error)
            status = FAILED
    if not quiet:
        console.print_check(results, screen())
    return max([status, *(0 if r.verdict == "pass" else FAILED for r in results)])
