"""The workspace as a picture: distance to its boundary, singular curves, a foot path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim import kinematics, whole_file, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.geometry import FiveBar

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CELLS = 241
"""Grid points along the longer side of the map."""

FORMATS = (".png", ".svg", ".pdf")


class Map(NamedTuple):
    """What is drawn, on a grid of foot positions; matrices are indexed [z, x].

    Attributes:
        x: [m], hip frame, (m,).
        z: [m], (n,).
        distance: Signed distance to the edge of what the leg's working mode reaches [m], (n, m).
    """

    x: Array
    z: Array
    distance: Array

    @property
    def area(self) -> float:
        """Area of the reachable region [m^2], to a grid cell along its boundary."""
        cell = float((self.x[1] - self.x[0]) * (self.z[1] - self.z[0]))
        return cell * float((self.distance >= 0.0).sum())


def survey(leg: FiveBar, cells: int = CELLS) -> Map:
    """Return the map of a leg's whole workspace.

    Args:
        leg: The leg.
        cells: Grid points along x and along z.
    """
    A, _ = kinematics.bases(leg)
    reach = 1.05 * (leg.L1 + leg.L2 + leg.L6 + float(np.hypot(*A)))
    line = np.linspace(-reach, reach, cells)
    foot = np.stack(np.meshgrid(line, line), axis=-1)
    distance = workspace.distance(leg, foot, mode=leg.mode)
    within = distance > 0.0
    rows, columns = _span(np.any(within, axis=1)), _span(np.any(within, axis=0))
    return Map(line[columns], line[rows], distance[rows, columns])


def _span(found: ArrayLike) -> slice:
    """Return the part from a margin before the first found to one behind the last."""
    where = np.flatnonzero(found)
    if not len(where):
        return slice(None)
    margin = np.size(found) // 20
    return slice(max(int(where[0]) - margin, 0), int(where[-1]) + margin + 1)


def write(leg: FiveBar, out: Path, path: Array | None = None) -> Map:
    """Draw the map of a leg into a picture, written beside and renamed; return the map.

    Args:
        leg: The leg.
        out: The file; .png, .svg or .pdf.
        path: A foot path to draw on it [m], hip frame, (n, 2).

    Raises:
        ConfigError: An unknown kind of picture, or a file that cannot be written.
    """
    if out.suffix.lower() not in FORMATS:
        raise ConfigError(f"cannot draw {out}: the picture must end in {', '.join(FORMATS)}")
    from matplotlib.figure import Figure

    surveyed = survey(leg)
    figure = Figure(figsize=(7.0, 6.4), layout="constrained")
    _draw(figure.add_subplot(), leg, surveyed, path)
    with whole_file.beside(out) as stage:
        figure.savefig(stage, dpi=150)
    return surveyed


def _draw(ax: Axes, leg: FiveBar, surveyed: Map, path: Array | None) -> None:
    """Draw a map in mm."""
    x, z, distance = 1e3 * surveyed.x, 1e3 * surveyed.z, 1e3 * surveyed.distance
    inside = np.where(distance >= 0.0, distance, np.nan)
    colours = ax.pcolormesh(x, z, inside, cmap="viridis", shading="nearest", rasterized=True)
    ax.figure.colorbar(colours, ax=ax, label="distance to the boundary [mm]", shrink=0.8)
    for curves, colour, label in (
        (workspace.boundary(leg, mode=leg.mode), "black", "boundary: a side chain in line"),
        (workspace.singular_curves(leg), "crimson", "singular: B, C, D in line"),
    ):
        for k, curve in enumerate(curves):
            ax.plot(*(1e3 * curve).T, color=colour, lw=1.3, label=label if k == 0 else None)
    rest = kinematics.chain_points(leg, kinematics.home(leg))
    A, E = kinematics.bases(leg)
    for chain in ((A, rest.B, rest.C_left, rest.F), (E, rest.D, rest.C_right)):
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
