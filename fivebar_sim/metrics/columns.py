"""The columns of a run's record, and where the joints and motors stand in arrays.

Every other list of columns, joints or motors is taken from here.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

import numpy as np

from fivebar_sim.arrays import Array

Record = dict[str, Array]

JOINTS = ("A", "B", "E", "D")
"""The joints in the order of qpos, and of every (..., 4) array of joint angles.

On a rail hip_z comes before them: they are always the last four.
"""

MOTORS = ("A", "E")
"""The joints that motors drive."""

MOTOR_JOINTS = [JOINTS.index(motor) for motor in MOTORS]
"""Where the motors stand among the joints."""

MOTORS_FROM_END = slice(MOTOR_JOINTS[0] - len(JOINTS), None, MOTOR_JOINTS[1] - MOTOR_JOINTS[0])
"""Where the motors stand in qpos and qvel, whatever comes before the joints."""

JOINT_COLUMNS = tuple(f"theta_{joint}" for joint in JOINTS)
"""The angles of the four joints."""

RATE_COLUMNS = tuple(f"theta_dot_{joint}" for joint in JOINTS)
"""The rates of the four joints."""

COMMAND_COLUMNS = tuple(f"ctrl_{motor}" for motor in MOTORS)
"""What the motors are sent."""

TORQUE_COLUMNS = tuple(f"torque_{motor}" for motor in MOTORS)
"""What the motors give."""

COLUMNS = (
    *("time", "target_x", "target_z", "foot_x", "foot_z"),
    *JOINT_COLUMNS,
    *RATE_COLUMNS,
    *COMMAND_COLUMNS,
    *TORQUE_COLUMNS,
    "gap",
)
"""What every record has, in its order."""

FRICTION_COLUMNS = tuple(f"friction_{motor}" for motor in MOTORS)
"""What the gears take, of a servo whose friction is a table."""

HIP_COLUMNS = ("hip_z", "hip_dot_z")
"""Of a hip that moves."""

GROUND_COLUMNS = ("ground_x", "ground_z")
"""The ground's force on the foot."""

RAIL_COLUMN = "rail_end"
"""The force of the rail's lower end on the trunk, upwards [N]."""

BELT_COLUMN = "belt_x"
"""How far a treadmill's belt has run."""


def digest(record: Mapping[str, Array]) -> str:
    """Return a checksum of a record's columns, in whatever order: SHA-256 in hexadecimal."""
    found = hashlib.sha256()
    for name in sorted(record):
        found.update(name.encode())
        found.update(np.ascontiguousarray(record[name], dtype=np.float64).data)
    return found.hexdigest()


def side_by_side(record: Mapping[str, Array], names: Sequence[str]) -> Array:
    """Return columns side by side, (N, k): `JOINT_COLUMNS` are q.

    Each column still lies in one piece of memory: over rows of two NumPy takes three times as long.
    """
    return np.stack([record[name] for name in names]).T


def motors(record: Mapping[str, Array], name: str) -> Array:
    """Return a column of A and of E side by side, "torque" or "theta" as in torque_A, (N, 2)."""
    return side_by_side(record, [f"{name}_{motor}" for motor in MOTORS])


def by_motor(pair: Array) -> dict[str, float]:
    """Return a value of A and one of E by the motor's name."""
    return dict(zip(MOTORS, pair.tolist(), strict=True))
