"""./.venv/bin/python scripts/picture.py: draws docs/leg.svg, the README's picture, from a real run.

The classic leg at moments of classic-ellipse, its foot path as simulated and as asked for, and the
mechanism's letters.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fivebar_sim import kinematics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario

OUT = Path(__file__).resolve().parent.parent / "docs" / "leg.svg"
LEFT, RIGHT, DARK, PATH = "#1f77b4", "#e67e22", "#2b2d31", "#c0392b"
SCALE = 5.0  # drawing units per mm
GHOSTS = 8


def xy(point: Array) -> tuple[float, float]:
    """Return the drawing's coordinates of a point in the hip frame [m]."""
    return 325.0 + 1e3 * SCALE * point[0], 75.0 - 1e3 * SCALE * point[1]


def line(points: list[Array], colour: str, width: float, opacity: float = 1.0) -> str:
    """Return a polyline with round joints through points in the hip frame."""
    text = " ".join("{:.1f},{:.1f}".format(*xy(point)) for point in points)
    return (
        f'<polyline points="{text}" fill="none" stroke="{colour}" stroke-width="{width}" '
        f'stroke-opacity="{opacity}" stroke-linecap="round" stroke-linejoin="round"/>'
    )


def dot(point: Array, radius: float, fill: str) -> str:
    """Return a ringed dot."""
    x, y = xy(point)
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{fill}" stroke="#fff"/>'


def ring(point: Array, stroke: str) -> str:
    """Return a circle around a point."""
    x, y = xy(point)
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="#fff" stroke="{stroke}" stroke-width="2"/>'
    )


def word(point: Array, text: str, dx: float, dy: float, colour: str = DARK) -> str:
    """Return a word beside a point."""
    x, y = xy(point)
    return f'<text x="{x + dx:.1f}" y="{y + dy:.1f}" fill="{colour}">{text}</text>'


def leg(result: Result, row: int, opacity: float) -> list[str]:
    """Return the two chains of one moment."""
    A, E = kinematics.bases(result.scenario.leg)
    q = np.array([result.record[f"theta_{joint}"][row] for joint in "ABED"])
    p = kinematics.chain_points(result.scenario.leg, q)
    return [
        line([E, p.D, p.C_right], RIGHT, 12, opacity),
        line([A, p.B, p.C_left], LEFT, 12, opacity),
    ]


def letters(result: Result, row: int) -> list[str]:
    """Return joints, their letters and the links' names of one moment."""
    A, E = kinematics.bases(result.scenario.leg)
    q = np.array([result.record[f"theta_{joint}"][row] for joint in "ABED"])
    p = kinematics.chain_points(result.scenario.leg, q)
    parts = [dot(point, 5, DARK) for point in (A, E)] + [dot(p.B, 4, DARK), dot(p.D, 4, DARK)]
    parts += [word(A, "A", -8, -16), word(E, "E", 0, -16), word(p.B, "B", -30, 6)]
    parts += [word(p.D, "D", 18, 6), word(p.C_left, "C, foot", 24, 22)]
    for start, end, name, dx in ((A, p.B, "L1", -34), (p.B, p.C_left, "L2", -36)):
        parts.append(word(0.5 * (start + end), name, dx, 0, LEFT))
    for start, end, name, dx in ((E, p.D, "L4", 16), (p.D, p.C_right, "L3", 20)):
        parts.append(word(0.5 * (start + end), name, dx, 0, RIGHT))
    return [*parts, word(0.5 * (A + E), "L5", -10, -14)]


def draw(result: Result) -> str:
    """Return the picture of a run as SVG."""
    window, record, path = result.scenario.window, result.record, result.scenario.path
    period = round((path.period or 0.0) / result.scenario.sim.timestep)
    rows = window.start + np.arange(GHOSTS) * period // GHOSTS
    cycle = slice(window.start, window.start + period + 1)
    foot = list(np.stack([record["foot_x"], record["foot_z"]], axis=-1)[cycle])
    target = list(np.stack([record["target_x"], record["target_z"]], axis=-1)[cycle])
    A, E = kinematics.bases(result.scenario.leg)
    parts = [part for row in rows[1:] for part in leg(result, int(row), 0.12)]
    parts += [*leg(result, int(rows[0]), 0.9), line([A, E], DARK, 16)]
    parts += [line(target, "#999999", 3), line(foot, PATH, 2)]
    parts += letters(result, int(rows[0]))
    here = int(rows[0] - window.start)
    parts += [ring(target[here], "#777777"), dot(foot[here], 5, PATH)]
    rms = 1e3 * result.metrics["tracking"]["rms"]
    style = 'font-family="sans-serif" font-size="19"'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 650 560" {style}>',
            '<rect width="650" height="560" fill="#ffffff"/>',
            *parts,
            f'<text x="20" y="520" fill="#777777">foot path asked for, and '
            f'<tspan fill="{PATH}">as simulated</tspan>: {rms:.2f} mm RMS apart</text>',
            f'<text x="20" y="545" fill="#777777">{result.scenario.name}: plain position servos '
            f"at A and E, {1 / (path.period or 1.0):g} Hz</text>",
            "</svg>\n",
        ]
    )


if __name__ == "__main__":
    OUT.write_text(draw(rollout.run(Scenario.load("classic-ellipse"))), encoding="utf-8")
    print(f"wrote {OUT.name}")
