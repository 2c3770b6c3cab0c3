"""A picture of the workspace: distances inside and outside, singular curves, a foot path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fivebar_sim import kinematics, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.geometry import FiveBar
from fivebar_sim.report.look import colour
from fivebar_sim.scenario.leg_words import leg_words
from fivebar_sim.workspace.survey import Map, survey

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INSIDE = ("#f4f5f7", "#5f6873")
OUTSIDE = ("#fdf3e4", "#b98a4e")
"""Colours at the edge and farthest from it: grey inside, sand outside."""

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
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    surveyed = survey(leg, path=path)
    # A leg's name is no formula: a $ in it stands for itself.
    with rc_context({"text.parse_math": False}), whole_file.stage(out) as place:
        figure = Figure(figsize=(8.0, 6.4), layout="constrained")
        _draw(figure.add_subplot(), leg, surveyed, path)
        figure.savefig(place, dpi=150)
    return surveyed


def _draw(ax: Axes, leg: FiveBar, surveyed: Map, path: Array | None) -> None:
    """Draw a workspace's map in mm."""
    _shade(ax, surveyed)
    for curves, name, label in (
        (workspace.boundary(leg, mode=leg.mode), "ink", "boundary: a side chain in line"),
        (workspace.singular_curves(leg), "singular", "singular: B, C, D in line"),
    ):
        for k, curve in enumerate(curves):
            # One entry in the legend for all curves of a kind.
            ax.plot(*(1e3 * curve).T, color=colour(name), lw=1.5, label=label if k == 0 else None)

    rest = kinematics.chain_points(leg, kinematics.home(leg))
    A, E = kinematics.bases(leg)
    for motor, chain in (("A", (A, rest.B, rest.C_left, rest.F)), ("E", (E, rest.D, rest.C_right))):
        points = 1e3 * np.array(chain)
        # A wide white line under a thin one stands out from light and dark cells alike.
        ax.plot(*points.T, color="white", lw=4.5)
        label = f"motor {motor} and its chain, at rest"
        ax.plot(*points.T, "o-", color=colour(motor), mfc="white", lw=2.0, ms=5, label=label)
        side = -1.0 if motor == "A" else 1.0
        ax.annotate(
            motor,
            tuple(points[0]),
            (9.0 * side, 6.0),
            textcoords="offset points",
            color=colour(motor),
            weight="bold",
            ha="center",
        )

    if path is not None:
        ax.plot(*(1e3 * path).T, color=colour("target"), lw=2.5, label="foot path")

    signs = "".join("+" if s > 0 else "-" for s in leg.mode)
    ax.set(
        aspect="equal",
        xlabel="x [mm]",
        ylabel="z [mm]",
        title=f"workspace of the {leg_words(leg)}\nworking mode ({signs[0]}, {signs[1]})",
    )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, fontsize=8, frameon=False)


def _shade(ax: Axes, surveyed: Map) -> None:
    """Colour the distance to the edge inside, and to the nearest reachable point outside."""
    from matplotlib.colors import LinearSegmentedColormap

    x = 1e3 * surveyed.x
    z = 1e3 * surveyed.z
    for sign, ends, label in (
        (1.0, INSIDE, "inside: distance to the boundary [mm]"),
        (-1.0, OUTSIDE, "outside: to the nearest reachable point [mm]"),
    ):
        distance = 1e3 * sign * surveyed.distance
        # The edge itself is in reach, so it counts as inside.
        shown = np.where(distance >= 0.0 if sign > 0.0 else distance > 0.0, distance, np.nan)
        ramp = LinearSegmentedColormap.from_list(label, ends)
        cells = ax.pcolormesh(x, z, shown, cmap=ramp, vmin=0.0, shading="nearest", rasterized=True)
        ax.figure.colorbar(cells, ax=ax, label=label, shrink=0.8, pad=0.02)
