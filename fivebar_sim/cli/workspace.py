"""`fivebar workspace`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Maybe
from fivebar_sim.cli.terminal import say

if TYPE_CHECKING:
    from fivebar_sim.arrays import Array
    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.scenario import Scenario


def workspace(
    leg: Positional[Annotated[str, arg(metavar="LEG")]],
    /,
    *,
    out: Annotated[Maybe[str], arg(metavar="PNG")] = None,
    path: Annotated[Maybe[str], arg(metavar="SCENARIO")] = None,
) -> int:
    """Draw what a leg's foot can reach, and how deep inside it is.

    Args:
        leg: A preset's name or a leg's TOML file.
        out: The picture, .png, .svg or .pdf (default workspace-LEG.png).
        path: A scenario whose foot path is drawn over it, and how near it comes to the edge is
            printed; a path that leaves the workspace gets a warning.
    """
    from fivebar_sim import units
    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.report import workspace_map
    from fivebar_sim.scenario import Scenario

    drawn = FiveBar.load(leg)
    followed = None if path is None else Scenario.load(path)
    place = Path(f"workspace-{drawn.name}.png" if out is None else out)
    way = None if followed is None else followed.foot_path
    surveyed = workspace_map.write(drawn, place, way)
    area = units.text(1e4 * surveyed.area, "cm2")
    deepest = units.text(1e3 * float(surveyed.distance.max()), "mm", 3)
    print(  # noqa: T201
        f"{drawn.name}: the foot reaches {area} and gets up to {deepest} inside; drawn in {place}"
    )
    if followed is not None and way is not None:
        _say_margin(drawn, followed, way)

    return 0


def _say_margin(leg: FiveBar, scenario: Scenario, way: Array) -> None:
    """Print how near the path of a scenario comes to the edge; warn if it leaves the workspace."""
    from fivebar_sim.workspace.margin import margin

    # A path that repeats has been everywhere after its ramp and one period.
    period = scenario.path.period
    once = len(way)
    if period is not None:
        once = int((scenario.times <= scenario.path.ramp + period).sum())
    found = margin(leg, way[:once])

    if found.left is None:
        print(  # noqa: T201
            f"{scenario.name}: the path stays inside, {1e3 * found.least:.3g} mm from the edge "
            f"{_where(scenario, way, found.row)}"
        )
        return
    say(
        f"warning: the path of {scenario.name} leaves the workspace of {leg.name}, first "
        f"{_where(scenario, way, found.left)}; it is outside for {100.0 * found.outside:.3g} % of "
        f"the time, farthest {_where(scenario, way, found.row)}, {-1e3 * found.least:.3g} mm from "
        "the nearest point in reach"
    )


def _where(scenario: Scenario, way: Array, row: int) -> str:
    x, z = 1e3 * way[row]
    return f"at ({x:.1f}, {z:.1f}) mm, t = {scenario.times[row]:.3f} s"
