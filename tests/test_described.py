"""What Parquet says of a record's columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from fivebar_sim.metrics.columns import (
    BELT_COLUMN,
    COLUMNS,
    FRICTION_COLUMNS,
    GROUND_COLUMNS,
    HIP_COLUMNS,
    RAIL_COLUMN,
)
from fivebar_sim.robots import columns as robots
from fivebar_sim.robots.hips.motors import MOTORS, QUANTITIES, column
from fivebar_sim.robots.robot import LEGS
from fivebar_sim.runs import directory
from fivebar_sim.runs.described import Described, described

OF_LEGS = (*COLUMNS, *FRICTION_COLUMNS, *HIP_COLUMNS, *GROUND_COLUMNS, RAIL_COLUMN, BELT_COLUMN)


def test_every_column_is_described() -> None:
    hips = [column(quantity, motor) for motor in MOTORS for quantity in QUANTITIES]
    own = (*COLUMNS[1:], *hips, *GROUND_COLUMNS)
    of_robots = [f"{leg}_{name}" for leg in LEGS for name in own]
    every = [*OF_LEGS, *robots.TRUNK_COLUMNS, *of_robots]
    assert [name for name in every if described(name) is None] == []
    said = [described(name) for name in every]
    assert len({each.description for each in said if each}) == len(every)
    assert described("theta_C") is None


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("torque_A", Described("N m", "torque that motor A gave in the step")),
        ("RL_foot_x", Described("m", "rear left leg: where the foot is, hip frame, x, forward")),
        ("trunk_wz", Described("rad/s", "turning rate of the trunk, about its own z")),
        ("trunk_qw", Described("", "orientation of the trunk, component w of a unit quaternion")),
        ("ground_z", Described("N", "force of the ground on the foot, z, up")),
    ],
)
def test_units_and_words(name: str, expected: Described) -> None:
    assert described(name) == expected


def test_parquet_has_them_beside_the_checksums(tmp_path: Path) -> None:
    record = {"time": np.arange(3.0), "torque_A": np.ones(3), "own": np.zeros(3)}
    directory.write_record(tmp_path, record, [])
    schema = pyarrow.parquet.read_schema(tmp_path / "rollout.parquet")
    assert schema.field("torque_A").metadata[b"unit"] == b"N m"
    assert schema.field("time").metadata[b"description"] == b"time at the end of the step"
    assert b"unit" not in (schema.field("own").metadata or {})
    assert schema.metadata
    table = pyarrow.parquet.read_table(tmp_path / "rollout.parquet")
    assert table["torque_A"].to_pylist() == [1.0, 1.0, 1.0]
