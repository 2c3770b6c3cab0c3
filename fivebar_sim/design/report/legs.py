"""The legs of designs, each over its workspace and its foot paths, all in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.report.charts import svg
from fivebar_sim.design.task.task import Task
from fivebar_sim.render import leg_lines

WIDTH = 540.0
"""Width of the picture."""


class Drawn:
    """The lines of one design's leg [m], and where they end.

    Args:
        task: The task.
        row: The design, (d,).
    """

    def __init__(self, task: Task, row: Array) -> None:
        self.leg = task.leg_of(row)
        self.edges = leg_lines.edges(self.leg)
        self.paths = [m.path.at(m.times(160)).position for m in task.motions_of(row)]
        self.regions = [c.region.points(400) for c in task.covers_of(row)]
        self.chains = leg_lines.chains(self.leg, self._foot())

    def _foot(self) -> Array | None:
        """Return where the foot is drawn: at the lowest point of the first path."""
        if self.paths:
            return self.paths[0][int(np.argmin(self.paths[0][:, 1]))]
        return self.regions[0].mean(axis=0) if self.regions else None

    @property
    def points(self) -> Array:
        """Every point that must be in the picture, (n, 2)."""
        return np.concatenate([*self.edges, *self.paths, *self.regions, *self.chains.values()])


def picture(task: Task, rows: Sequence[tuple[int, Array]], first: int, alt: str) -> str:
    """Return the picture of all designs' legs, of which the page shows one.

    Args:
        task: The task.
        rows: Number and values of each design.
        first: The one that is shown at first.
        alt: What the picture shows.
    """
    drawn = {k: Drawn(task, row) for k, row in rows}
    points = np.concatenate([each.points for each in drawn.values()])
    low = points.min(axis=0)
    high = points.max(axis=0)
    scale = (WIDTH - 20.0) / (high[0] - low[0])
    height = scale * (high[1] - low[1]) + 20.0

    def place(curve: Array) -> str:
        x = 10.0 + scale * (curve[:, 0] - low[0])
        z = 10.0 + scale * (high[1] - curve[:, 1])
        return "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x.tolist(), z.tolist(), strict=True))

    groups = []
    for k, each in drawn.items():
        parts = [f'<path class="edge" d="M{place(curve)}"/>' for curve in each.edges]
        parts += [f'<path class="cover" d="M{place(_hull(r))}Z"/>' for r in each.regions]
        parts += [f'<path class="way" d="M{place(path)}Z"/>' for path in each.paths]
        for motor, chain in each.chains.items():
            parts.append(f'<path class="chain {motor}" d="M{place(chain)}"/>')
            for joint in place(chain).split("L"):
                x, z = joint.split()
                parts.append(f'<circle class="joint {motor}" cx="{x}" cy="{z}" r="4"/>')
        shown = " on" if k == first else ""
        groups.append(f'<g class="one{shown}" data-k="{k}">{"".join(parts)}</g>')
    groups.append(_bar(scale, height))
    return svg(WIDTH, height, alt, groups)


def _bar(scale: float, height: float) -> str:
    """Return a line of a round length, with it."""
    length = 10.0 ** np.floor(np.log10(0.3 * WIDTH / scale))
    text = f"{1e3 * length:g} mm"
    end = 12.0 + scale * length
    return (
        f'<path class="axis" d="M12 {height - 12:.1f}H{end:.1f}"/>'
        f'<text class="tick left" style="text-anchor: start" x="{end + 6:.1f}" '
        f'y="{height - 8:.1f}">{escape(text)}</text>'
    )


def _hull(points: Array) -> Array:
    """Return the convex hull of points, by the monotone chain."""
    order = points[np.lexsort((points[:, 1], points[:, 0]))]

    def half(rows: Array) -> list[Array]:
        chain: list[Array] = []
        for point in rows:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        return chain[:-1]

    return np.array([*half(order), *half(order[::-1])])


def _turn(a: Array, b: Array, c: Array) -> float:
    u = b - a
    v = c - a
    return float(u[0] * v[1] - u[1] * v[0])
