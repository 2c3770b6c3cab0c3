"""What a recording says in numbers: the plots of a record, and its metrics as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.recording_scene import (
    BLUE,
    GREEN,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    ORANGE,
    RED,
    Colour,
)

SHARE_WINDOW = 0.05
"""Width of the window over which the load share is taken [s]."""
SHARE_FLOOR = 1e-6
"""Mean |torque| in the window that at least one motor must reach for a share to be drawn [N m]."""


class Series(NamedTuple):
    """One plot.

    Attributes:
        path: Entity.
        title: What is plotted, with its unit.
        lines: Name and colour of each line.
        values: In the title's unit, (n, len(lines)).
        shown: Whether a row of the record has values, (N,); n is the count of those that have.
        bounds: The plot's fixed range, or None to fit the values.
    """

    path: str
    title: str
    lines: dict[str, Colour]
    values: Array
    shown: Bools
    bounds: tuple[float, float] | None = None


def timestep(time: Array) -> float:
    """Return h [s] of the times h, 2 h, ... N h."""
    return float(time[-1]) / len(time)


def points(record: Mapping[str, Array], name: str) -> Array:
    """Return the points (x, z) [m] of two columns, (N, 2)."""
    return np.stack([record[f"{name}_x"], record[f"{name}_z"]], axis=-1)


def series(record: Mapping[str, Array]) -> Iterator[Series]:
    """Yield the plots of a record, in the order in which they are shown."""
    every = np.ones(len(record["time"]), dtype=bool)
    error = np.hypot(*(points(record, "foot") - points(record, "target")).T)
    torque = np.stack([record["torque_A"], record["torque_E"]], axis=-1)
    share, loaded = load_share(torque, round(0.5 * SHARE_WINDOW / timestep(record["time"])))
    angles = {
        "theta_A": ORANGE,
        "theta_B": LIGHT_ORANGE,
        "theta_E": BLUE,
        "theta_D": LIGHT_BLUE,
        "ctrl_A": RED,
        "ctrl_E": GREEN,
    }
    degrees = np.degrees(np.stack([record[column] for column in angles], axis=-1))
    motors = {"A": ORANGE, "E": BLUE}

    yield Series(
        "tracking_error", "Tracking error [mm]", {"error": RED}, 1e3 * error[:, None], every
    )
    yield Series("torque", "Motor torques [mN m]", motors, 1e3 * torque, every)
    yield Series("load_share", "Load share of A", {"A": ORANGE}, share[:, None], loaded, (0.0, 1.0))
    yield Series("gap", "Loop gap [um]", {"gap": GREEN}, 1e6 * record["gap"][:, None], every)
    yield Series("angles", "Joint angles, setpoints [deg]", angles, degrees, every)


def load_share(torque: Array, half: int) -> tuple[Array, Bools]:
    """Return A's part of the absolute torque impulse in a moving window, where there is load.

        share_A = sum |tau_A| / (sum |tau_A| + sum |tau_E|),   over rows k - half ... k + half

    The window is cut off at both ends of the record.

    Args:
        torque: (tau_A, tau_E) [N m], (N, 2).
        half: Rows on each side of the window's centre.

    Returns:
        share_A in [0, 1] of the rows under load, (n,), and which rows those are, (N,): those in
        whose window the mean |tau| of one motor at least reaches `SHARE_FLOOR`.
    """
    k = np.arange(len(torque))
    low, high = np.maximum(k - half, 0), np.minimum(k + half + 1, len(torque))
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(np.abs(torque), axis=0)])
    impulse = total[high] - total[low]
    loaded = impulse.max(axis=1) >= SHARE_FLOOR * (high - low)
    return impulse[loaded, 0] / impulse[loaded].sum(axis=1), loaded


def summary(metrics: Mapping[str, Any], name: str) -> str:
    """Return the metrics as Markdown: name, verdict, a table by dotted keys, the provenance."""
    rest = {k: v for k, v in metrics.items() if k not in ("verdict", "provenance")}
    lines = [f"# {name}", ""]
    if "verdict" in metrics:
        lines += [f"**{str(metrics['verdict']).upper()}**", ""]
    lines += ["| metric (SI) | value |", "|:--|--:|"]
    lines += [f"| {key} | {_plain(value)} |" for key, value in _flat(rest)]
    if "provenance" in metrics:
        facts = (f"{key} {_plain(value)}" for key, value in _flat(metrics["provenance"]))
        lines += ["", f"*{', '.join(facts)}*"]
    return "\n".join(lines) + "\n"


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of nested tables by dotted keys."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _plain(value: Any) -> str:
    """Return a value for a Markdown table: numbers to five digits, lists by commas."""
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(_plain(item) for item in value) or "none"
    return " ".join(str(value).replace("|", "\\|").split())
