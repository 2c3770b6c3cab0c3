"""A leg and a scenario in a notebook: the leg over its workspace, and what it is in numbers."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable

import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.catalogue import SHOWN
from fivebar_sim.metrics.limits import Limit, bounds
from fivebar_sim.render import leg_lines
from fivebar_sim.report import look
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.leg_words import leg_words

WIDTH = 260.0
EDGE = 10.0
"""Width of a picture and of its margin [px]."""

MOST = 400
"""Points of a path that are drawn."""


def leg(shown: FiveBar) -> str:
    """Return HTML of a leg: its picture, and its lengths and masses."""
    rows = [(name, units.text(1e3 * getattr(shown, name), "mm")) for name in _lengths(shown)]
    rows.append(("mass", units.text(1e3 * math.fsum(link.mass for link in shown.links), "g")))
    if shown.tilt:
        rows.append(("tilt", units.text(math.degrees(shown.tilt), "deg")))
    return _beside(leg_words(shown), picture(shown), rows)


def scenario(shown: Scenario) -> str:
    """Return HTML of a scenario: its leg over the foot's path, what is run, and its limits."""
    rows = [
        ("path", shown.path.__struct_config__.tag),
        ("scene", shown.scene.kind),
        ("controller", shown.controller_name),
        ("duration", f"{shown.duration:g} s in {shown.steps} steps"),
    ]
    for key, (low, high) in shown.limits.items():
        limit = bounds(Limit(key, low, high, None, ok=True))
        rows.append((f"limit: {SHOWN[key][0]}", limit))

    times = np.linspace(0.0, shown.steps * shown.sim.timestep, MOST)
    path = shown.path.at(times).position
    return _beside(f"{shown.name}: {shown.words}", picture(shown.leg, path), rows)


def picture(shown: FiveBar, path: Array | None = None) -> str:
    """Return an SVG of a leg over its workspace; its lines are legible on light and dark.

    Args:
        shown: The leg.
        path: The foot's path [m], hip frame, (n, 2); the foot is drawn at its lowest point.
    """
    foot = None if path is None else path[int(np.argmin(path[:, 1]))]
    chains = leg_lines.chains(shown, foot)
    edges = leg_lines.edges(shown)
    drawn = [*edges, *chains.values(), *([] if path is None else [path])]
    low = np.concatenate(drawn).min(axis=0)
    high = np.concatenate(drawn).max(axis=0)
    scale = (WIDTH - 2.0 * EDGE) / max(high[0] - low[0], 1e-9)
    height = scale * (high[1] - low[1]) + 2.0 * EDGE

    def line(curve: Array, style: str) -> str:
        x = EDGE + scale * (curve[:, 0] - low[0])
        z = EDGE + scale * (high[1] - curve[:, 1])
        places = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, z, strict=True))
        return f'<path fill="none" {style} d="M{places}"/>'

    parts = [line(each, 'stroke="currentColor" stroke-opacity=".4"') for each in edges]
    if path is not None:
        parts.append(line(path, f'stroke="{look.colour("target")}" stroke-width="2"'))
    for motor, chain in chains.items():
        round_ = 'stroke-width="4" stroke-linejoin="round" stroke-linecap="round"'
        parts.append(line(chain, f'stroke="{look.colour(motor)}" {round_}'))
    return (
        f'<svg role="img" aria-label="the leg" width="{WIDTH:g}" height="{height:.0f}" '
        f'viewBox="0 0 {WIDTH:g} {height:.1f}">{"".join(parts)}</svg>'
    )


def _lengths(shown: FiveBar) -> list[str]:
    names = ["L1", "L2", "L3", "L4", "L5"]
    return [*names, "L6"] if shown.L6 > 0.0 else names


def _beside(head: str, drawn: str, rows: Iterable[tuple[str, str]]) -> str:
    """Return a heading over a picture and a table side by side."""
    lines = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>"
        for name, value in rows
    )
    table = f"<table><tbody>{lines}</tbody></table>"
    both = f'<div style="display:flex;flex-wrap:wrap;gap:1em">{drawn}<div>{table}</div></div>'
    return f"<div><p>{html.escape(head)}</p>{both}</div>"
