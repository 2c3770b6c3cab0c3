"""The columns of a run's record."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim.arrays import Array

Record = dict[str, Array]

JOINTS = ("A", "B", "E", "D")
"""In the order of qpos."""

MOTORS = ("A", "E")
"""The joints that motors drive."""

MOTOR_JOINTS = [JOINTS.index(motor) for motor in MOTORS]
"""Where the motors stand among the joints."""

JOINT_COLUMNS = tuple(f"theta_{joint}" for joint in JOINTS)
"""The angles of the four joints."""


def motors(record: Mapping[str, Array], name: str) -> Array:
    """Return a column of A and of E side by side, "torque" or "theta" as in torque_A, (N, 2)."""
    return np.stack([record[f"{name}_{motor}"] for motor in MOTORS], axis=-1)
