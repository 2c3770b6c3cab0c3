"""`fivebar view`."""

from __future__ import annotations

from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import spinner


def view(
    source: Positional[Annotated[str, arg(metavar="[LEG|SCENARIO]")]] = "classic-ellipse", /
) -> int:
    """Open MuJoCo's viewer: a scenario's run, or a leg moved by sliders.

    A scenario is simulated first, then shown in real time, over and over. A leg starts in its rest
    pose, and the sliders command its servos.

    Args:
        source: A scenario or a leg, by its shipped name or as a TOML file.
    """
    from fivebar_sim import rollout
    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.render import screen, view
    from fivebar_sim.render.replay import replay

    what = view.load(source)
    # Before the simulation, which would be for nothing without a screen.
    screen.check(view.INSTEAD)
    if isinstance(what, FiveBar):
        view.hold(what)
        return 0

    with spinner(f"simulating {what.name}", quiet=False):
        result = rollout.run(what)

    view.play(replay(result.scenario, result.record))
    return 0
