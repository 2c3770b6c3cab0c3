"""The foot on the ground: force, slip, height, stance and flight, from the record."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, Bools, blocks
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.columns import JOINT_COLUMNS, side_by_side
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
    """Return the height of the foot's ball above the floor [m], (N,); below 0 in the floor."""
    return record["hip_z"] + record["foot_z"] - leg.foot_radius


def joint_heights(leg: FiveBar, points: kinematics.Points) -> dict[str, Array]:
    """Return the heights of the joints that move and do not collide [m], hip frame, each (N,).

    The foot is left out, and C with it where the foot's ball contains C's.
    """
    heights = {"B": points.B[:, 1], "D": points.D[:, 1]}
    if leg.L6 > max(leg.foot_radius - leg.radius, 0.0):
        heights["C"] = np.minimum(points.C_left[:, 1], points.C_right[:, 1])
    return heights


def heights_of(leg: FiveBar, record: Mapping[str, Array]) -> dict[str, Array]:
    """Return the `joint_heights` of a record's poses."""
    found: dict[str, Array] = {}
    rows = len(record["time"])
    for part in blocks(rows):
        q = side_by_side({name: record[name][part] for name in JOINT_COLUMNS}, JOINT_COLUMNS)
        for name, height in joint_heights(leg, kinematics.chain_points(leg, q)).items():
            found.setdefault(name, np.empty(rows))[part] = height
    return found


def depths(
    leg: FiveBar,
    record: Mapping[str, Array],
    trunk: float,
    known: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """Return how deep what does not collide is in the floor [m], by part, each (N,); 0 above it.

    The lowest point of a link is on the ball that its capsule ends with, so the joints stand for
    the links.

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        trunk: Height of the trunk's lowest point above the hip frame's origin [m].
        known: Its `heights_of`, if somebody has them already.
    """
    A, E = kinematics.bases(leg)
    moving = heights_of(leg, record) if known is None else known
    heights = {"A": A[1], "B": moving["B"], "D": moving["D"], "E": E[1], **moving}
    lowest = {f"joint {joint}": z - leg.radius for joint, z in heights.items()} | {"trunk": trunk}
    return {part: np.maximum(-(record["hip_z"] + z), 0.0) for part, z in lowest.items()}


def contact_radius(leg: FiveBar, height: Array) -> Array:
    """Return the distance from the ball's centre down to MuJoCo's point of contact [m].

    Args:
        leg: The leg.
        height: Height of the ball above the floor, as `height` returns it [m].
    """
    # MuJoCo puts the contact in the middle of the overlap.
    return leg.foot_radius + 0.5 * np.minimum(height, 0.0)


def slid(leg: FiveBar, record: Mapping[str, Array]) -> Array:
    """Return the distance that the foot slid over the floor in each step but the first [m].

    The ball rolls with L2, whose direction is psi_2 = theta_A + theta_B, and a belt carries the
    point of contact along by belt_x. Over a step, with r of `contact_radius`, it is (N - 1,):

        d foot_x + r d psi_2 - d belt_x
    """
    psi_2 = record["theta_A"] + record["theta_B"]
    belt = record.get("belt_x", np.zeros_like(psi_2))
    r = contact_radius(leg, height(leg, record))
    return np.diff(record["foot_x"] - belt) + 0.5 * (r[1:] + r[:-1]) * np.diff(psi_2)


def measure(leg: FiveBar, record: Mapping[str, Array], window: slice) -> GroundMetrics:
    """Return the metrics of the ground.

    force_max, foot_height_max and flight_max (the longest time without force, including the first
    drop) are taken over the whole run, because the landing may be before the window. stance_share
    (a part of the time) and slip (the distance slid in stance) are taken over the window.

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        window: The rows that load is measured over.
    """
    down = stands(record)
    h = float(record["time"][0])
    # A foot in the air may move as it likes.
    slip = np.concatenate([[0.0], np.abs(slid(leg, record)) * down[1:]])[window]

    return GroundMetrics(
        force_max=GroundForce(
            x=float(np.abs(record["ground_x"]).max()),
            z=float(record["ground_z"].max()),
        ),
        stance_share=float(down[window].mean()),
        slip=float(slip.sum()),
        foot_height_max=float(height(leg, record).max()),
        flight_max=h * longest(~down),
    )


def foot_share(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float | None:
    """Return the part of the vertical force over the window that the foot carried, in [0, 1].

    The rail's end carries the rest. None if neither carried anything.
    """
    del leg
    foot = float(record["ground_z"][window].sum())
    rail = float(record["rail_end"][window].sum())
    return foot / (foot + rail) if foot + rail > 0.0 else None


def rail_end_max(leg: FiveBar, record: Mapping[str, Array], window: slice) -> float:
    """Return the largest force of the rail's end on the trunk in the whole run [N]."""
    del leg, window
    return float(record["rail_end"].max())


def longest(chosen: Bools) -> int:
    """Return the length of the longest run of True."""
    # Runs begin and end where False turns into True and back.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
