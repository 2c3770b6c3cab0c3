"""./.venv/bin/python scripts/servo_rounding.py: foot error of whole-degree servos, classic leg.

Rounds the servo angles of every foot position on a fine grid of the workspace, prints the foot
error beside its bound, and draws both to docs/servo-rounding.svg.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.analysis.singularity import points_at
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.control import hobby
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.kinematics.planar import angle_between, wrap

OUT = Path(__file__).resolve().parent.parent / "docs" / "servo-rounding.svg"
GRID = 0.25e-3  # [m] between the foot positions that are measured
DRAWN = 1e-3  # [m] between those that are drawn
MARGINS_DEG = (5.0, 10.0, 30.0)  # least angle at C from straight and from folded
SCALE_MM = 0.8  # upper end of the colour scale


class Rounding(NamedTuple):
    """Foot positions and what rounding does there, all of shape (n,) but foot (n, 2), in m."""

    foot: Array
    error: Array
    first: Array
    total: Array
    margin_deg: Array


def in_range(leg: FiveBar, theta: Array, table: hobby.ServoTable) -> Bools:
    """Return which poses both servos can be sent."""
    inside = np.ones(theta.shape[:-1], dtype=bool)
    for side, servo in enumerate((table.A, table.E)):
        low, high = servo.range
        angle = servo.offset + servo.direction * (theta[..., side] - leg.tilt)
        inside &= np.abs(wrap(angle - 0.5 * (low + high))) <= 0.5 * (high - low)
    return inside


def measure(leg: FiveBar, step: float) -> Rounding:
    """Return the rounding of all poses on a grid of foot positions.

    Poses are in the leg's working and assembly mode, in the servos' range, and not so near to
    B, C, D in line that rounding may bring them there.
    """
    line = np.arange(-leg.size - leg.L5, leg.size + leg.L5, step) + 0.5 * step
    foot = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    theta = kinematics.inverse_all(leg, foot)[:, MODES.index(leg.mode)]
    found = np.isfinite(theta[:, 0])
    foot = foot[found]
    theta = theta[found]
    points = points_at(leg, foot, theta)
    good = kinematics.branch(leg, points).assembly == leg.assembly
    good &= in_range(leg, theta, hobby.HANGING)
    foot = foot[good]
    theta = theta[good]

    bound = hobby.rounding_bound(leg, theta)
    finite = np.isfinite(bound.remainder)
    foot = foot[finite]
    theta = theta[finite]
    error = hobby.rounding_error(leg, theta)
    p = points_at(leg, foot, theta)
    gamma = np.abs(angle_between(p.C_left - p.B, p.C_left - p.D))
    margin_deg = np.degrees(np.minimum(gamma, np.pi - gamma))
    length = np.hypot(error[:, 0], error[:, 1])

    return Rounding(foot, length, bound.first[finite], bound.total[finite], margin_deg)


def report(poses: Rounding) -> str:
    """Return the table of errors, one line for each least margin at C."""
    lines = ["margin at C   positions   worst       at (x, z)            bound there   RMS"]
    r = poses
    for margin in MARGINS_DEG:
        r = Rounding(*(values[poses.margin_deg >= margin] for values in poses))
        k = int(np.argmax(r.error))
        x, z = 1e3 * r.foot[k]
        rms = 1e3 * float(np.sqrt(np.mean(r.error**2)))
        lines.append(
            f"{margin:6.0f} deg  {r.error.size:10d}   {1e3 * r.error[k]:6.3f} mm   "
            f"({x:6.1f}, {z:6.1f}) mm   {1e3 * r.total[k]:8.3f} mm   {rms:.3f} mm"
        )

    lines.append(
        f"from {MARGINS_DEG[-1]:g} deg on: bound {1e3 * r.total.max():.3f} mm at most, of it to "
        f"first order {1e3 * r.first.max():.3f} mm; error / bound {(r.error / r.total).max():.3f} "
        f"at most, error / first order {(r.error / r.first).max():.3f} at most"
    )
    lines.append(f"everywhere: error / bound {(poses.error / poses.total).max():.3f} at most")
    return "\n".join(lines)


def draw(leg: FiveBar, poses: Rounding, out: Path) -> None:
    """Draw the error and its bound over the workspace, with the leg at rest."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams.update({"svg.hashsalt": "fivebar", "svg.fonttype": "none", "font.size": 9})
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    rest = kinematics.home(leg)
    A, E = kinematics.bases(leg)
    p = kinematics.closed_points(leg, rest[[0, 2]])
    sides = 1e3 * np.array([A, p.B, p.F, p.D, E])

    corner = poses.foot.min(axis=0)
    column, row = np.rint((poses.foot - corner) / DRAWN).astype(int).T
    left, low = 1e3 * (corner - 0.5 * DRAWN)
    image = None
    colours = mpl.colormaps["viridis"]

    for ax, values, title in (
        (axes[0], poses.error, "foot error of whole degrees"),
        (axes[1], poses.total, "its bound"),
    ):
        cells = np.full((row.max() + 1, column.max() + 1), np.nan)
        cells[row, column] = 1e3 * values
        height, width = cells.shape
        extent = (left, left + 1e3 * DRAWN * width, low, low + 1e3 * DRAWN * height)
        image = ax.imshow(
            cells,
            colours,
            origin="lower",
            extent=extent,
            vmin=0.0,
            vmax=SCALE_MM,
            interpolation="nearest",
        )
        ax.plot(sides[:, 0], sides[:, 1], "o-", color="#2b2d31", linewidth=2.0, markersize=4.0)
        ax.set(title=title, xlabel="x [mm]", aspect="equal")

    axes[0].set_ylabel("z [mm]")
    if image is not None:
        figure.colorbar(image, ax=axes, label="[mm]", extend="max")

    figure.savefig(out, metadata={"Date": None})


def main() -> None:
    """Measure, print and draw."""
    leg = FiveBar()
    print(report(measure(leg, GRID)))
    draw(leg, measure(leg, DRAWN), OUT)


if __name__ == "__main__":
    main()
