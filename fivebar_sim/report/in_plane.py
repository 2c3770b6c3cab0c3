"""Figures in the leg plane: the foot's path over its target, the leg over its workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fivebar_sim import kinematics, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.metrics.catalogue import shown
from fivebar_sim.metrics.columns import JOINT_COLUMNS, MOTORS
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.recording.plots import points
from fivebar_sim.report import draw
from fivebar_sim.report.draw import Drawn
from fivebar_sim.report.look import colour
from fivebar_sim.runs.stored import StoredRun
from fivebar_sim.scenario.leg_words import leg_words
from fivebar_sim.workspace.survey import survey

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PIECES = 24
"""Number of colours along a path."""

MOMENTS = 12
"""Number of poses of the leg."""

CELLS = 81
"""Cells of the workspace's survey per side: half a second for a leg with L6 > 0, not 5 s."""

HARDLY = 0.05
"""A foot that travels less than this part of the leg's size in a period hardly moves."""

BESIDE = 9.0
"""Distance of a joint's letter from it [pt]."""

BANDS = 4
"""Shades of the workspace, from its edge to its deepest point."""


def foot_path(run: StoredRun) -> Drawn:
    """Draw the foot's path, coloured by time, over its target."""
    foot, target = (1e3 * points(run.record, name) for name in ("foot", "target"))
    figure, ax = draw.plane(4.4)
    ax.plot(*target.T, color=colour("target"), lw=6.0, alpha=0.4, label="target")
    ends = np.linspace(0, len(foot) - 1, PIECES + 1).astype(int)

    for k, tint in enumerate(draw.time_colours(PIECES)):
        # Thinner with time, so that a later round does not hide an earlier one.
        width = 3.4 - 2.4 * k / PIECES
        ax.plot(*foot[ends[k] : ends[k + 1] + 1].T, color=tint, lw=width)

    ax.plot(*foot[0], "o", color=colour("ink"), ms=5, label="start")
    ax.legend(loc="best")
    _time_bar(figure, ax, run.record["time"])
    rms = shown("tracking.rms", look_up(run.metrics, "tracking.rms"))

    return Drawn(
        "foot-path",
        "Foot path",
        f"The foot's path over its target in the hip frame, {rms} RMS apart; from teal and wide "
        "(early) to pink and thin (late).",
        f"The foot's path in the leg plane, coloured by time, over its target; {rms} RMS apart.",
        figure,
    )


def _time_bar(figure: Figure, ax: Axes, time: Array) -> None:
    """Draw the time scale of the colours below the path."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.ticker import MaxNLocator

    end = float(time[-1])
    edges = np.linspace(0.0, end, PIECES + 1)
    ticks = np.asarray(MaxNLocator(5).tick_values(0.0, end))
    tints = ListedColormap(draw.time_colours(PIECES))
    bar = figure.colorbar(
        ScalarMappable(BoundaryNorm(edges, PIECES), tints),
        ax=ax,
        orientation="horizontal",
        label="time [s]",
        fraction=0.06,
        aspect=40,
        # 1e-9: the last tick is rounded.
        ticks=ticks[ticks <= end * (1.0 + 1e-9)],
        format="%.3g",
    )
    # Vectors stay sharp at any size, unlike a bitmap; edges of the same colour close the hairlines
    # that viewers show between the rectangles.
    assert bar.solids is not None
    bar.solids.set_rasterized(False)
    bar.solids.set_edgecolor("face")
    bar.outline.set_visible(False)


def leg_moments(run: StoredRun) -> Drawn:
    """Draw the leg in a dozen poses over its workspace."""
    leg = run.scenario.leg
    rows = moments(run)
    figure, ax = draw.plane(4.9)
    deepest = _workspace(ax, run)
    q = np.stack([run.record[name][rows] for name in JOINT_COLUMNS], axis=-1)
    p = kinematics.chain_points(leg, q)
    A, E = kinematics.bases(leg)

    for k in range(len(rows)):
        last = k == len(rows) - 1
        look: dict[str, Any] = {"alpha": 1.0 if last else 0.3, "lw": 2.6 if last else 1.3}
        for name, chain in (
            ("A", (A, p.B[k], p.C_left[k], p.F[k])),
            ("E", (E, p.D[k], p.C_right[k])),
        ):
            ax.plot(*(1e3 * np.array(chain)).T, "o-", color=colour(name), ms=3, **look)

    ax.plot(*(1e3 * points(run.record, "foot")).T, color=colour("foot"), lw=1.0)
    _letter(ax, {"A": A, "B": p.B[-1], "C": p.C_left[-1], "D": p.D[-1], "E": E})

    times = run.record["time"][rows]
    return Drawn(
        "leg-moments",
        "The leg over its workspace",
        f"The leg in {len(rows)} poses from {times[0]:.4g} s to {times[-1]:.4g} s, evenly along "
        f"the foot's path, the last one bold. Shaded: what the foot reaches in this working mode, "
        f"a shade deeper every {1e3 * deepest / BANDS:.3g} mm from the edge; teal: B, C and D in "
        "line.",
        f"The {leg_words(leg)} in {len(rows)} poses along its foot path, over the "
        "region that its foot reaches.",
        figure,
    )


def _letter(ax: Axes, joints: dict[str, Array]) -> None:
    """Write the letters of joints beside them, away from the middle of all, where no link is."""
    middle = np.mean(list(joints.values()), axis=0)
    for letter, point in joints.items():
        away = point - middle
        # Coaxial motors are at one place: one letter stands to the left and one to the right.
        if letter in MOTORS and np.array_equal(joints["A"], joints["E"]):
            away = np.array([-1.0 if letter == "A" else 1.0, 1.0])
        offset = BESIDE * away / max(float(np.hypot(*away)), 1e-12)
        ax.annotate(
            letter,
            tuple(1e3 * point),
            tuple(offset),
            textcoords="offset points",
            weight="bold",
            ha="center",
            va="center",
        )


def _workspace(ax: Axes, run: StoredRun) -> float:
    """Draw the workspace and its singular curves; return its greatest depth [m]."""
    leg = run.scenario.leg
    surveyed = survey(leg, CELLS)
    deepest = float(surveyed.distance.max())
    x = 1e3 * surveyed.x
    z = 1e3 * surveyed.z

    # Each level shades all that lies deeper, so the shades add up towards the middle.
    for level in np.arange(BANDS) * deepest / BANDS:
        shade = {"levels": [level, np.inf], "colors": [colour("wash")], "alpha": 0.11}
        ax.contourf(x, z, surveyed.distance, **shade)

    for curves, name, width in (
        (workspace.boundary(leg, mode=leg.mode), "muted", 1.0),
        (workspace.singular_curves(leg, mode=leg.mode), "singular", 1.3),
    ):
        for curve in curves:
            ax.plot(*(1e3 * curve).T, color=colour(name), lw=width)
    return deepest


def moments(run: StoredRun) -> NDArray[np.int64]:
    """Return the rows in which the leg is drawn: evenly along the foot's path, in order.

    The path is that of the first measured period, or of the whole run if there is no period or the
    foot hardly moves in it.
    """
    window = run.scenario.window
    period = run.scenario.path.period
    foot = points(run.record, "foot")
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(foot, axis=0).T))])
    first = 0
    last = len(foot) - 1

    if period is not None:
        stop = min(window.start + round(period / run.scenario.sim.timestep), last)
        if way[stop] - way[window.start] > HARDLY * run.scenario.leg.size:
            first = window.start
            last = stop
    # Fewer rows than MOMENTS remain where the foot jumps past several marks in one step.
    return np.unique(np.searchsorted(way, np.linspace(way[first], way[last], MOMENTS)))
