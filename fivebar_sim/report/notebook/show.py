"""A run in a notebook: its figures one by one, and HTML with its verdict, metrics and leg."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from fivebar_sim.errors import ArgumentError, unknown
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.limits import judge
from fivebar_sim.report import in_plane, look, motors, over_time
from fivebar_sim.report.draw import Drawn
from fivebar_sim.runs import recorded
from fivebar_sim.runs.side_by_side import side_by_side
from fivebar_sim.runs.stored import StoredRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLOTS: dict[str, Callable[[StoredRun], Drawn | None]] = {
    "angles": motors.angles,
    "error": over_time.tracking_error,
    "error-parts": over_time.error_parts,
    "foot-path": in_plane.foot_path,
    "gap": over_time.loop_gap,
    "ground": over_time.ground_contact,
    "leg": in_plane.leg_moments,
    "load-share": over_time.load_share,
    "power": motors.power,
    "speeds": motors.speeds,
    "torque": over_time.torque,
    "torque-speed": motors.torque_speed,
}
"""The figures of a leg's run, as in its report."""

SHADES = {"pass": "#2e7d32", "fail": "#c62828"}
"""Colours of verdicts that are legible on light and dark."""

WORDS = {True: "pass", False: "FAIL"}

ASIDE = "#8a6d00"

DPI = 90
"""Pixels per inch of a plot in a notebook."""


def plot(run: StoredRun, name: str) -> Figure:
    """Return a figure of a leg's run.

    Args:
        run: The run.
        name: One of `PLOTS`.

    Raises:
        ArgumentError: Another name; or there is nothing to draw, as of a ground in the air.
    """
    if name not in PLOTS:
        raise ArgumentError(unknown("plot", str(name), PLOTS))
    if recorded.all_of_robots([run]):
        raise ArgumentError(f"{name!r} is a plot of legs, and {run.scenario.name} is a robot's run")

    with look.project_style():
        drawn = PLOTS[name](run)
    if drawn is None:
        raise ArgumentError(f"{name!r} has nothing to draw in {run.scenario.name}")
    # Of other figures IPython shows but the name, unless it was told %matplotlib inline.
    vars(drawn.figure)["_repr_png_"] = partial(_png, drawn.figure)
    return drawn.figure


def _png(figure: Figure) -> bytes:
    """Return a figure as a PNG."""
    out = io.BytesIO()
    with look.project_style():
        figure.savefig(out, format="png", dpi=DPI)
    return out.getvalue()


def fragment(run: StoredRun) -> str:
    """Return HTML of a run: what was run, its verdict, its metrics, and the leg over its path."""
    scenario = run.scenario
    verdict = run.measured.verdict
    head = html.escape(f"{scenario.name}: {scenario.words}")
    shade = SHADES.get(verdict, ASIDE)
    parts = [f'<p>{head} <b style="color:{shade}">{html.escape(verdict)}</b></p>']
    parts += [f"<p>{html.escape(said)}</p>" for said in guards.tripped(run.measured.guards)]
    limits = {limit.key: limit for limit in judge(run.metrics, scenario.limits)}
    rows = [
        (
            row.label,
            row.window,
            row.run,
            row.limit,
            ("pass" if row.ok else "FAIL") * bool(row.limit),
        )
        for row in side_by_side(run.metrics, limits)
    ]
    parts.append(table(("metric", "window", "whole run", "limit", "verdict"), rows))
    if not recorded.all_of_robots([run]):
        with look.project_style():
            picture = look.png(in_plane.leg_moments(run).figure)
        data = base64.b64encode(picture).decode("ascii")
        parts.append(f'<img alt="the leg" width="420" src="data:image/png;base64,{data}">')

    return f"<div>{''.join(parts)}</div>"


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Return a table of texts as HTML."""
    heads = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
    lines = ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"
