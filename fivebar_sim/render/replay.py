"""A run to draw: the model, its qpos in every row, and the rows that make a film."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim import kinematics, model
from fivebar_sim.arrays import Array
from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.metrics.columns import JOINT_COLUMNS, Record
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Ground, Treadmill

FITTED = 600
"""Most poses that the camera is fitted to; of a longer run every n-th row is used."""


class Span(NamedTuple):
    """A part of a run: start and length [s]."""

    start: float
    length: float


class Replay(NamedTuple):
    """A run to draw; row k of every array is the state at t = (k + 1) h.

    Attributes:
        scenario: The scenario that was run.
        model: MuJoCo's model of leg and scene.
        qpos: MuJoCo's coordinates, (N, nq).
        hip: Height of the hip frame's origin above the floor [m], (N,).
        foot: F in the hip frame [m], (N, 2).
        target: Target of F [m], (N, 2).
        ground: Force of the ground on the foot [N], (N, 2); zero in the air.
        belt: Travel of a treadmill's belt [m], (N,); None without a belt.
    """

    scenario: Scenario
    model: mujoco.MjModel
    qpos: Array
    hip: Array
    foot: Array
    target: Array
    ground: Array
    belt: Array | None

    @property
    def rows(self) -> int:
        """Number of rows N."""
        return len(self.qpos)

    @property
    def duration(self) -> float:
        """Duration N h [s]."""
        return self.rows * self.scenario.sim.timestep

    def row(self, time: float) -> int:
        """Return the row whose state is nearest to a time of the run [s]."""
        k = round(time / self.scenario.sim.timestep) - 1
        return min(max(k, 0), self.rows - 1)

    @property
    def whole(self) -> Span:
        """The whole run."""
        return Span(0.0, self.duration)

    @property
    def cycle(self) -> Span:
        """The last whole period of a periodic path, which repeats; otherwise the whole run."""
        period = self.scenario.path.period
        window = self.scenario.window
        if period is None:
            return self.whole
        return Span(window.stop * self.scenario.sim.timestep - period, period)

    def points_to_fit(self) -> Array:
        """Return (x, z) of the joints, feet and targets that the camera must see [m], (n, 2)."""
        # Rounded up, so that there are at most FITTED poses.
        some = slice(None, None, -(-self.rows // FITTED))
        hip = np.stack([np.zeros_like(self.hip[some]), self.hip[some]], axis=-1)
        # On a rail qpos begins with the hip's height; the joints are always the last four.
        points = kinematics.chain_points(self.scenario.leg, self.qpos[some, -4:])
        bases = (np.broadcast_to(base, hip.shape) for base in kinematics.bases(self.scenario.leg))
        seen = np.stack([*bases, *points, self.target[some]])
        return (seen + hip).reshape(-1, 2)


def replay(scenario: Scenario, record: Record) -> Replay:
    """Return a run, ready to draw.

    Raises:
        RunDirectoryError: The record lacks a column that its scene needs.
    """
    grounded = isinstance(scenario.scene, Ground)
    belted = isinstance(scenario.scene, Treadmill)
    wanted = ("hip_z", "ground_x", "ground_z") * grounded + ("belt_x",) * belted
    for name in wanted:
        if name not in record:
            raise RunDirectoryError(
                f"not a record of the scene {scenario.scene.kind!r}: it lacks the column {name}"
            )

    q = np.stack([record[name] for name in JOINT_COLUMNS], axis=-1)
    still = np.full(len(q), model.HIP_HEIGHT * scenario.leg.size)
    hip = record["hip_z"] if grounded else still
    nothing = np.zeros(len(q))

    return Replay(
        scenario,
        model.build(scenario.leg, scene=scenario.scene),
        np.column_stack([hip, q]) if grounded else q,
        hip,
        _pairs(record["foot_x"], record["foot_z"]),
        _pairs(record["target_x"], record["target_z"]),
        _pairs(record.get("ground_x", nothing), record.get("ground_z", nothing)),
        record.get("belt_x"),
    )


def _pairs(x: Array, z: Array) -> Array:
    return np.stack([x, z], axis=-1)
