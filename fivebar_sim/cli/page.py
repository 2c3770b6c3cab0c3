"""`fivebar page`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Maybe


def page(
    leg: Positional[Annotated[str, arg(metavar="LEG")]],
    /,
    *,
    out: Annotated[Maybe[Path], arg(metavar="HTML")] = None,
) -> int:
    """Write a leg to play with on one HTML page, in any browser.

    Drag the foot and the force on it, move the links, draw a path. The page needs no server and no
    network.

    Args:
        leg: A preset's name or a leg's TOML file.
        out: The page (default LEG.html).
    """
    from fivebar_sim import page as pages
    from fivebar_sim.geometry import FiveBar

    name = FiveBar.load(leg).name
    place = Path(f"{name}.html") if out is None else out
    pages.write(leg, place)
    print(f"{name}: a page to open in a browser, {place}")  # noqa: T201
    return 0
