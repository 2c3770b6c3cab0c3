"""A run to draw: the model, its qpos in every row, and the rows that make a film."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from fivebar_sim import kinematics, model
from fivebar_sim.arrays import Array
from fivebar_sim.errors import RunDirectoryError
from fivebar_sim.metrics.columns import JOINT_COLUMNS, Record, side_by_side
from fivebar_sim.robots import LEGS, places
from fivebar_sim.robots.columns import FORCE_COLUMNS, of_leg, trunk
from fivebar_sim.robots.hips.motors import column
from fivebar_sim.robots.measure import Trunk
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Ground, Treadmill

FITTED = 600
"""Most poses that the camera is fitted to; of a longer run every n-th row is used."""


class Span(NamedTuple):
    """A part of a run: start and length [s]."""

    start: float
    length: float


class Walked(NamedTuple):
    """What a robot's run has besides, in the world.

    Attributes:
        trunk: The trunk's origin [m], (N, 3).
        feet: The middle of each foot [m], (4, N, 3).
        forces: The floor's force on each foot [N], (4, N, 3); zero in the air.
    """

    trunk: Array
    feet: Array
    forces: Array


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
        walked: What a robot's run has besides: its hip is the trunk, its foot, target and ground
            are those of its first leg. None of a leg alone.
    """

    scenario: Scenario
    model: mujoco.MjModel
    qpos: Array
    hip: Array
    foot: Array
    target: Array
    ground: Array
    belt: Array | None
    walked: Walked | None = None

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
        if self.walked is not None:
            return self._around_trunk(some)
        hip = np.stack([np.zeros_like(self.hip[some]), self.hip[some]], axis=-1)
        # On a rail qpos begins with the hip's height; the joints are always the last four.
        points = kinematics.chain_points(self.scenario.leg, self.qpos[some, -4:])
        bases = (np.broadcast_to(base, hip.shape) for base in kinematics.bases(self.scenario.leg))
        seen = np.stack([*bases, *points, self.target[some]])
        return (seen + hip).reshape(-1, 2)

    def _around_trunk(self, some: slice) -> Array:
        """Return (x, z) of a robot's feet and trunk, x from the trunk's on: the camera follows."""
        assert self.walked is not None
        assert isinstance(self.scenario, RobotScenario)
        trunk = self.walked.trunk[some]
        half = 0.5 * np.array(self.scenario.robot.trunk.size)
        feet = (self.walked.feet[:, some] - trunk * (1.0, 1.0, 0.0))[..., [0, 2]].reshape(-1, 2)
        corners = [
            np.stack([np.full(len(trunk), x), trunk[:, 2] + z], axis=-1)
            for x in (-half[0], half[0])
            for z in (-half[2], 2.0 * half[2])
        ]
        return np.concatenate([feet, *corners])

    def place(self, row: int) -> Array:
        """Return where the camera's point has moved to in a row [m], (3,)."""
        if self.walked is None:
            return np.zeros(3)
        return self.walked.trunk[row] * (1.0, 1.0, 0.0)


def replay(scenario: Scenario, record: Record) -> Replay:
    """Return a run, ready to draw.

    Raises:
        RunDirectoryError: The record lacks a column that its scene needs.
    """
    if isinstance(scenario, RobotScenario):
        return _of_robot(scenario, record)
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


def _of_robot(scenario: RobotScenario, record: Record) -> Replay:
    """Return a robot's run, ready to draw."""
    robot = scenario.robot
    built = model.build_robot(robot, scenario.scene)
    legs = [of_leg(record, name) for name in LEGS]
    own = [*(column("theta", motor) for motor in robot.hip_motors), *JOINT_COLUMNS]
    joints = [side_by_side(leg, own) for leg in legs]
    rows = len(record["time"])
    body = trunk(record)
    if body is None:
        # Held where the model has it.
        at = np.tile(built.body("trunk").pos, (rows, 1))
        level = np.tile((1.0, 0.0, 0.0, 0.0), (rows, 1))
        held = Trunk(record["time"], at, level, np.zeros((rows, 3)))
        forces = np.zeros((len(LEGS), rows, 3))
        qpos = np.concatenate(joints, axis=1)
    else:
        held = body
        forces = np.stack([side_by_side(leg, FORCE_COLUMNS) for leg in legs])
        qpos = np.concatenate([body.position, body.quaternion, *joints], axis=1)

    feet = [places.feet(held, robot.hips[name], leg) for name, leg in zip(LEGS, legs, strict=True)]
    first = legs[0]
    return Replay(
        scenario,
        built,
        qpos,
        held.position[:, 2],
        _pairs(first["foot_x"], first["foot_z"]),
        _pairs(first["target_x"], first["target_z"]),
        forces[:, :, [0, 2]].sum(axis=0),
        None,
        Walked(held.position, np.stack(feet), forces),
    )


def _pairs(x: Array, z: Array) -> Array:
    return np.stack([x, z], axis=-1)
