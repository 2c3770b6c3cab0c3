"""`fivebar workspace`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def workspace(
    leg: Positional[Annotated[str, arg(metavar="LEG")]],
    /,
    *,
    out: Annotated[str | None, arg(metavar="PNG")] = None,
    path: Annotated[str | None, arg(metavar="SCENARIO")] = None,
) -> int:
    """Draw the workspace of a leg: distance to the boundary, and singular curves.

    Args:
        leg: A preset's name or a leg's TOML file.
        out: The picture, .png, .svg or .pdf (default workspace-LEG.png).
        path: A scenario whose foot path is drawn over it.
    """
    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.report import workspace_map
    from fivebar_sim.scenario import Scenario

    drawn = FiveBar.load(leg)
    followed = None if path is None else Scenario.load(path).foot_path
    place = Path(f"workspace-{drawn.name}.png" if out is None else out)
    surveyed = workspace_map.write(drawn, place, followed)
    area = 1e4 * surveyed.area
    deepest = 1e3 * float(surveyed.distance.max())
    print(  # noqa: T201
        f"{drawn.name}: the foot reaches {area:.1f} cm2 and gets up to {deepest:.1f} mm inside; "
        f"drawn in {place}"
    )

    return 0
