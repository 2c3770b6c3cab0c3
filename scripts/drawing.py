"""./.venv/bin/python scripts/drawing.py: draws docs/mechanism.svg, the letters and angles.

The `extended` preset, which has every option: unequal links, an extension beyond C, a tilted base.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc

from fivebar_sim import FiveBar, kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.render.palette import COLOURS

OUT = Path(__file__).resolve().parent.parent / "docs" / "mechanism.svg"
LEFT = COLOURS["A"].light
RIGHT = COLOURS["E"].light
DARK = "#2b2d31"
GREY = "#888888"


def link(
    ax: Axes, start: Array, end: Array, name: str, colour: str, shift: float, part: float = 0.5
) -> None:
    """Draw a link with its name at a part of its length, `shift` [mm] to its left."""
    ax.plot(*np.stack([start, end], axis=-1), color=colour, lw=5, solid_capstyle="round", zorder=2)
    along = (end - start) / np.linalg.norm(end - start)
    beside = start + part * (end - start) + shift * np.array([-along[1], along[0]])
    ax.text(beside[0], beside[1], name, color=colour, ha="center", va="center", fontsize=13)


def joint(ax: Axes, point: Array, name: str, dx: float, dz: float) -> None:
    """Draw a joint with its letter."""
    ax.plot(*point, "o", ms=8, mfc="white", mec=DARK, mew=1.8, zorder=3)
    ax.text(point[0] + dx, point[1] + dz, name, fontsize=14, ha="center", va="center")


def angle(
    ax: Axes,
    centre: Array,
    start: float,
    end: float,
    radius: float,
    name: str,
    place: tuple[float, float] = (0.5, 1.28),
) -> None:
    """Draw an angle from `start` to `end` [rad]; anticlockwise if end > start.

    Its name stands at `place`: the part of the angle, and that of the radius.
    """
    low, high = sorted((np.degrees(start), np.degrees(end)))
    size = 2.0 * radius
    ax.add_patch(
        Arc((centre[0], centre[1]), size, size, theta1=low, theta2=high, color=GREY, lw=1.2)
    )
    tip = centre + radius * np.array([np.cos(end), np.sin(end)])
    sense = np.sign(end - start) * np.array([-np.sin(end), np.cos(end)])
    before = tip - 0.4 * sense
    ax.annotate(
        "",
        (tip[0], tip[1]),
        (before[0], before[1]),
        arrowprops={"arrowstyle": "->", "color": GREY},
        zorder=1,
    )
    part, out = place
    towards = start + part * (end - start)
    at = centre + out * radius * np.array([np.cos(towards), np.sin(towards)])
    ax.text(at[0], at[1], name, color="#555555", fontsize=12, ha="center", va="center")


def draw(ax: Axes, leg: FiveBar) -> None:
    """Draw a leg in its rest pose, in mm, with letters, angles and the hip frame."""
    q = kinematics.home(leg)
    A, E = (1e3 * point for point in kinematics.bases(leg))
    p = kinematics.Points(*(1e3 * point for point in kinematics.chain_points(leg, q)))
    link(ax, A, E, "L5", DARK, 4, 0.28)
    link(ax, A, p.B, "L1", LEFT, -5)
    link(ax, p.B, p.C_left, "L2", LEFT, -5)
    link(ax, p.C_left, p.F, "L6", LEFT, 5)
    link(ax, E, p.D, "L4", RIGHT, 5)
    link(ax, p.D, p.C_right, "L3", RIGHT, 5)

    for start, end in ((A, p.F), (E, p.C_right), (p.B, p.D)):
        ax.plot(*np.stack([start, end], axis=-1), color=GREY, lw=0.9, ls=(0, (5, 4)), zorder=1)

    beyond = p.C_left + 0.3 * (p.C_left - p.B)
    ax.plot(*np.stack([p.C_left, beyond], axis=-1), color=LEFT, lw=0.9, ls=":", zorder=1)
    for name, point, dx, dz in (
        ("A", A, -2, 6), ("E", E, 2, 6), ("B", p.B, -6, 0), ("D", p.D, 6, 0),
        ("C", p.C_left, -6, -3), ("F", p.F, 6, -1),
    ):  # fmt: skip
        joint(ax, point, name, dx, dz)

    AF = p.F - A
    alpha = float(np.arctan2(AF[1], AF[0]))
    for motor in (A, E):
        ax.plot([motor[0], motor[0] + 17], [motor[1]] * 2, color=GREY, lw=0.9, ls=":", zorder=1)

    # Beside the line to F, which crosses the arc.
    angle(ax, A, 0.0, float(q[0]), 9.0, r"$\theta_A$", (0.7, 0.6))
    angle(ax, A, alpha, float(q[0]), 19.0, r"$\beta$", (0.4, 0.78))
    angle(ax, A, 0.0, alpha, 14.0, r"$\alpha$", (0.55, 1.25))
    angle(ax, E, 0.0, float(q[2]), 9.0, r"$\theta_E$")
    bend_from = float(q[0] + q[1])
    angle(ax, p.C_left, bend_from, bend_from + leg.bend, 20.0, "bend", (0.2, 1.35))
    frame(ax)


def frame(ax: Axes) -> None:
    """Draw the hip frame at O."""
    # The arrow along x ends before E, and has its name below.
    for dx, dz, name, at in ((11, 0, "x", (8.5, -4)), (0, 14, "z", (0, 16))):
        ax.annotate("", (dx, dz), (0, 0), arrowprops={"arrowstyle": "-|>", "color": DARK, "lw": 1})
        ax.text(*at, name, fontsize=11, ha="center", va="center")
    ax.text(4.5, 5, "O", fontsize=11, ha="center", va="center")


if __name__ == "__main__":
    mpl.rcParams["svg.hashsalt"] = "fivebar"  # equal runs give equal files
    figure, axes = plt.subplots(figsize=(6.4, 6.4))
    draw(axes, FiveBar.load("extended"))
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set(xlim=(-65, 45), ylim=(-105, 25))
    figure.savefig(OUT, bbox_inches="tight", facecolor="white", metadata={"Date": None})
    print(f"wrote {OUT.name}")
