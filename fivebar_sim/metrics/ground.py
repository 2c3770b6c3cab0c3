"""What the foot does on the ground: force, slip, height, stance and flight, from the record."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.json_types import Amount, Number, Part, Table


class GroundForce(Table, frozen=True):
    """Largest forces of the ground on the foot [N]."""

    x: Number
    z: Number


class GroundMetrics(Table, frozen=True):
    """The table "ground" of metrics.json; see `measure`."""

    force_max: GroundForce
    stance_share: Part
    slip: Amount
    foot_height_max: Number
    flight_max: Amount


def stands(record: Mapping[str, Array]) -> Bools:
    """Return in which steps the ground carried the foot, (N,)."""
    return record["ground_z"] > 0.0


def height(leg: FiveBar, record: Mapping[str, Array]) -> Array:
    """Return the height of the foot's ball above the floor [m], (N,); below 0 it sinks in."""
    return record["hip_z"] + record["foot_z"] - leg.foot_radius


def contact_radius(leg: FiveBar, height: Array) -> Array:
    """Return how far below the ball's centre MuJoCo has the point of contact [m].

    The ball's radius less half of what it sinks in.

    Args:
        leg: The leg.
        height: Of the ball above the floor, as `height` returns it [m].
    """
    return leg.foot_radius + 0.5 * np.minimum(height, 0.0)


def slid(leg: FiveBar, record: Mapping[str, Array]) -> Array:
    """Return how far the foot slid over the floor in each step but the first [m], (N - 1,).

    The ball rolls with L2, whose direction is psi_2 = theta_A + theta_B, and a belt that moves by
    belt_x takes its point of contact along. Over a step, with r of `contact_radius`:

        d foot_x + r d psi_2 - d belt_x
    """
    psi_2 = record["theta_A"] + record["theta_B"]
    belt = record.get("belt_x", np.zeros_like(psi_2))
    r = contact_radius(leg, height(leg, record))
    return np.diff(record["foot_x"] - belt) + 0.5 * (r[1:] + r[:-1]) * np.diff(psi_2)


def measure(leg: FiveBar, record: Mapping[str, Array], window: slice) -> GroundMetrics:
    """Return the metrics of the ground.

    force_max, foot_height_max and flight_max (the longest time without force, that of a drop
    included) are of the whole run, whose landing may be before the window; stance_share (of the
    time) and slip (the way that the foot slid while it stood) are of the window.

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        window: The rows that load is measured over.
    """
    down = stands(record)
    h = float(record["time"][0])
    slip = np.concatenate([[0.0], np.abs(slid(leg, record)) * down[1:]])[window]

    return GroundMetrics(
        force_max=GroundForce(
            x=float(np.abs(record["ground_x"]).max()),
            z=float(record["ground_z"].max()),
        ),
        stance_share=float(down[window].mean()),
        slip=float(slip.sum()),
        foot_height_max=float(height(leg, record).max()),
        flight_max=h * _longest(~down),
    )


def _longest(chosen: Bools) -> int:
    """Return the length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
