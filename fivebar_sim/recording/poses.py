"""The poses of a run in those rows of its record that are drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics import bases, chain_points
from fivebar_sim.metrics.columns import JOINT_COLUMNS

Rows = NDArray[np.intp]

POSE_PERIOD = 0.01
"""Time between two drawn poses [s]: 100 Hz looks like every step, at a fraction of the size."""


class DrawnMotion(NamedTuple):
    """The rows that are drawn; lengths in m, angles in rad, forces in N.

    Attributes:
        q: (theta_A, theta_B, theta_E, theta_D), (n, 4).
        foot: F in the hip frame, (n, 2).
        target: Where F should be, hip frame, (n, 2).
        hip: Height of the hip above the floor, (n,); None without a floor.
        force: Force of the ground on the foot, (n, 2); None without a ground.
        belt: How far the belt has run, (n,); None where the floor stands still.
    """

    q: Array
    foot: Array
    target: Array
    hip: Array | None = None
    force: Array | None = None
    belt: Array | None = None

    @property
    def world_foot(self) -> Array:
        """F in the frame of the floor, (n, 2); without a floor in the hip frame."""
        return self.foot if self.hip is None else self.foot + in_height(self.hip)


def drawn_motion(record: Mapping[str, Array], rows: Rows) -> DrawnMotion:
    """Return some rows of a record."""
    return DrawnMotion(
        q=np.stack([record[name][rows] for name in JOINT_COLUMNS], axis=-1),
        foot=points(record, "foot")[rows],
        target=points(record, "target")[rows],
        hip=record["hip_z"][rows] if "hip_z" in record else None,
        force=points(record, "ground")[rows] if "ground_z" in record else None,
        belt=record["belt_x"][rows] if "belt_x" in record else None,
    )


def timestep(time: Array) -> float:
    """Return the spacing h [s] of equidistant times; of a single time that time itself."""
    # Record times start at h, so one row alone has time h.
    return float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else float(time[0])


def drawn_rows(time: Array) -> Rows:
    """Return the rows whose poses are drawn: the first, one every `POSE_PERIOD`, and the last."""
    every = max(1, round(POSE_PERIOD / timestep(time)))
    rows = np.arange(0, len(time), every)
    last = len(time) - 1
    # The last row too, so that a replay stops where the run ended.
    return rows if rows[-1] == last else np.append(rows, last)


def points(record: Mapping[str, Array], name: str) -> Array:
    """Return the points (x, z) of two columns, (N, 2)."""
    return np.stack([record[f"{name}_x"], record[f"{name}_z"]], axis=-1)


def in_height(z: ArrayLike) -> Array:
    """Return heights z as points (0, z), (...) to (..., 2)."""
    height = np.asarray(z, dtype=np.float64)
    return np.stack([np.zeros_like(height), height], axis=-1)


class Room(NamedTuple):
    """The room that all runs of a recording need together; the floor is the plane z = 0.

    Attributes:
        low: The lowest (x, z) that any leg reaches, or the floor's height if it is lower [m].
        high: The highest (x, z) [m].
        size: Size of the largest leg [m].
        metre_per_newton: Length of a force's arrow per newton: the largest is half of size long.
        floor: Whether there is a floor.
    """

    low: Array
    high: Array
    size: float
    metre_per_newton: float
    floor: bool


def room_of(legs: Sequence[FiveBar], moved: Sequence[DrawnMotion]) -> Room:
    """Return the room that legs and their motions need."""
    places = np.concatenate([_places(leg, each) for leg, each in zip(legs, moved, strict=True)])
    forces = [np.hypot(*each.force.T).max() for each in moved if each.force is not None]
    floor = any(each.hip is not None for each in moved)
    if floor:
        places = np.concatenate([places, np.zeros((1, 2))])
    size = max(leg.size for leg in legs)
    largest = float(max(forces, default=0.0))
    # Without any force there is no arrow to scale.
    scale = 0.5 * size / largest if largest > 0.0 else 0.0
    return Room(places.min(axis=0), places.max(axis=0), size, scale, floor)


def _places(leg: FiveBar, moved: DrawnMotion) -> Array:
    """Return everywhere that the joints of a leg come to [m], (..., 2)."""
    hip = in_height(np.zeros(len(moved.q)) if moved.hip is None else moved.hip)
    return np.concatenate([hip + p for p in (*bases(leg), *chain_points(leg, moved.q))])
