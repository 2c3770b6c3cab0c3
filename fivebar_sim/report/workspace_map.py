"""A picture of the workspace: distance to its boundary, singular curves, a foot path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim import kinematics, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.geometry import FiveBar
from fivebar_sim.workspace.survey import Map, survey

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMATS = (".png", ".svg", ".pdf")


def write(leg: FiveBar, out: Path, path: Array | None = None) -> Map:
    """Draw the workspace of a leg into a picture; return its map.

    Args:
        leg: The leg.
        out: The file; .png, .svg or .pdf.
        path: A foot path to draw over it [m], hip frame, (n, 2).

    Raises:
        ConfigError: An unknown kind of picture, or a file that cannot be written.
    """
    if out.suffix.lower() not in FORMATS:
        raise ConfigError(f"cannot draw {out}: the picture must end in {', '.join(FORMATS)}")
    from matplotlib.figure import Figure

    surveyed = survey(leg)
    figure = Figure(figsize=(7.0, 6.4), layout="constrained")
    _draw(figure.add_subplot(), leg, surveyed, path)
    with whole_file.stage(out) as place:
        figure.savefig(place, dpi=150)
    return surveyed


def _draw(ax: Axes, leg: FiveBar, surveyed: Map, path: Array | None) -> None:
    """Draw a workspace's map in mm."""
    x = 1e3 * surveyed.x
    z = 1e3 * surveyed.z
    distance = 1e3 * surveyed.distance
    inside = np.where(distance >= 0.0, distance, np.nan)
    colours = ax.pcolormesh(x, z, inside, cmap="viridis", shading="nearest", rasterized=True)
    ax.figure.colorbar(colours, ax=ax, label="distance to the boundary [mm]", shrink=0.8)

    for curves, colour, label in (
        (workspace.boundary(leg, mode=leg.mode), "black", "boundary: a side chain in line"),
        (workspace.singular_curves(leg), "crimson", "singular: B, C, D in line"),
    ):
        for k, curve in enumerate(curves):
            # One entry in the legend for all curves of a kind.
            ax.plot(*(1e3 * curve).T, color=colour, lw=1.3, label=label if k == 0 else None)

    rest = kinematics.chain_points(leg, kinematics.home(leg))
    A, E = kinematics.bases(leg)
    for chain in ((A, rest.B, rest.C_left, rest.F), (E, rest.D, rest.C_right)):
        # A wide white line under a thin grey one stands out from light and dark cells alike.
        ax.plot(*(1e3 * np.array(chain)).T, "o-", color="white", mec="black", lw=3, ms=5)
        ax.plot(*(1e3 * np.array(chain)).T, "-", color="0.25", lw=1.2)

    if path is not None:
        ax.plot(*(1e3 * path).T, color="orange", lw=2, label="foot path")

    signs = "".join("+" if s > 0 else "-" for s in leg.mode)
    ax.set(
        aspect="equal",
        xlabel="x [mm]",
        ylabel="z [mm]",
        title=f"workspace of {leg.name}, working mode ({signs[0]}, {signs[1]})",
    )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, fontsize=8, frameon=False)
