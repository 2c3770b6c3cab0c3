"""The columns of a run's record."""

from __future__ import annotations

from fivebar_sim.arrays import Array

Record = dict[str, Array]

JOINTS = ("A", "B", "E", "D")
"""In the order of qpos."""

JOINT_COLUMNS = tuple(f"theta_{joint}" for joint in JOINTS)
"""The angles of the four joints."""
