"""`fivebar view`."""

from __future__ import annotations

from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import working


def view(
    source: Positional[Annotated[str, arg(metavar="[LEG|SCENARIO]")]] = "classic-ellipse", /
) -> int:
    """Open MuJoCo's viewer: a scenario's run in real time, or a leg to move by its sliders.

    A scenario is simulated first, then its states are shown, over and over. A leg stands in its
    rest pose, and the sliders turn its servos.

    Args:
        source: A scenario or a leg: a shipped name or a TOML file.
    """
    from fivebar_sim import rollout
    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.render import screen, view
    from fivebar_sim.render.replay import replay

    what = view.chosen(source)
    screen.check(view.INSTEAD)
    if isinstance(what, FiveBar):
        view.hold(what)
        return 0

    with working(f"simulating {what.name}", quiet=False):
        result = rollout.run(what)

    view.play(replay(result.scenario, result.record))
    return 0
