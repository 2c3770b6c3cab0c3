"""A run read back from its directory, for whoever shows it: replay, report, render."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fivebar_sim.errors import FiveBarError, RunDirectoryError
from fivebar_sim.files import parquet_file
from fivebar_sim.kinematics.stops import SPEED_LIMIT
from fivebar_sim.metrics import load
from fivebar_sim.metrics.columns import (
    BELT_COLUMN,
    COLUMNS,
    FRICTION_COLUMNS,
    GROUND_COLUMNS,
    HIP_COLUMNS,
    RAIL_COLUMN,
    Record,
)
from fivebar_sim.metrics.limits import has
from fivebar_sim.metrics.measured import Judged
from fivebar_sim.robots import LEGS, Floor
from fivebar_sim.robots.columns import columns as robots_columns
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.runs import checksums, directory, stored_metrics
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Ground, Treadmill

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

FARTHEST = 1e30
"""Largest place in a record [m]: recordings draw in single precision, which ends at 3.4e38."""

PLACES = ("target", "foot", "hip_z", "belt_x", "trunk")
"""How the names of columns begin that are places."""

MOST = {
    "theta_dot": SPEED_LIMIT,
    "torque": load.LARGEST,
    **dict.fromkeys(PLACES, FARTHEST),
}
"""Largest number in columns whose names begin so [rad/s, N m, m].

`simulate` and `load` ensure the first two, and no leg comes near the last.
"""

LARGEST = 1e100
"""Largest number in any other column: neither its square nor a plot of it can overflow."""

SOURCES = ("scenario.toml", "rollout.parquet")
"""The files that a run is read from; metrics and recording can be made anew and may be missing."""


class StoredRun(NamedTuple):
    """What a run directory holds.

    Attributes:
        path: The directory.
        scenario: What was run.
        record: The columns of rollout.parquet, each (N,), SI.
        measured: All of metrics.json, with types.
        anew: Whether that file is missing, and `measured` was computed from the record.
    """

    path: Path
    scenario: Scenario
    record: Record
    measured: Judged
    anew: bool = False

    @property
    def metrics(self) -> dict[str, Any]:
        """What metrics.json says: `measured` as nested dictionaries."""
        return self.measured.table


def read(path: Path) -> StoredRun:
    """Return the run of a directory.

    Raises:
        RunDirectoryError: It lacks one of `SOURCES`, or a file of it is damaged, was changed after
            the run, or is another run's; names the file. Without metrics.json: the record cannot
            be measured.
    """
    metrics = path / "metrics.json"
    # A link to nowhere is no deleted file.
    gone = not os.path.lexists(metrics)
    sources = SOURCES if gone else (*SOURCES, metrics.name)
    if not all((path / name).is_file() for name in sources):
        directory.check_run(path)

    file = path / checksums.RECORD
    with parquet_file.opened(file, "a record", RunDirectoryError) as parquet:
        metadata = parquet.schema_arrow.metadata
        sums = checksums.read(metadata)
        if gone:
            sums.pop(metrics.name, None)
        # First: of a file of another run, any other message would be about the wrong one.
        checksums.check_files(path, sums)
        scenario = _scenario(path)
        record = _record(file, parquet, scenario)

    _check_plausible(file, record, scenario.sim.timestep)
    checksums.check_record(file, record, sums)
    if gone:
        # Only this needs MuJoCo.
        from fivebar_sim.runs.anew import beside, measure

        found = measure.measured(file, record, scenario, beside.read(metadata))
        return StoredRun(path, scenario, record, found, anew=True)
    return StoredRun(path, scenario, record, _metrics(metrics, scenario))


def _metrics(file: Path, scenario: Scenario) -> Judged:
    """Return what the metrics.json of a scenario's run says."""
    robot = isinstance(scenario, RobotScenario)
    grounded = isinstance(scenario.scene, Ground | Floor)
    measured = stored_metrics.read(file, grounded=grounded, robot=robot)
    for key in scenario.limits:
        # What only some servos have is no field that every run must have.
        if not has(measured.table, key):
            raise RunDirectoryError(f"{file}: {key} is missing: run its scenario.toml again")
    return measured


def _scenario(path: Path) -> Scenario:
    """Return the scenario of a run directory."""
    try:
        return Scenario.load(path / "scenario.toml")
    except FiveBarError as error:
        raise RunDirectoryError(f"{path} cannot be read as a run: {error}") from None


def _check_plausible(file: Path, record: Record, timestep: float) -> None:
    """Raise unless a record's numbers could come from a run, so that no arithmetic overflows.

    Raises:
        RunDirectoryError: Names the file, the column, the row, and the legal range.
    """
    # A wrong time column would shift every plot against the scenario without an error.
    due = (np.arange(len(record["time"])) + 1) * timestep
    late = np.abs(record["time"] - due) > 0.5 * timestep
    if late.any():
        k = int(np.argmax(late))
        raise RunDirectoryError(
            f"{file}: column time must be {due[k]:g} s in row {k}, got {record['time'][k]:g}"
        )

    for name, column in record.items():
        # A leg of a robot has its name in front.
        own = name.partition("_")[2] if name.partition("_")[0] in LEGS else name
        most = next((high for part, high in MOST.items() if own.startswith(part)), LARGEST)
        far = np.abs(column) > most
        if far.any():
            k = int(np.argmax(far))
            raise RunDirectoryError(
                f"{file}: column {name} must be in [{-most:g}, {most:g}], got {column[k]:g} in "
                f"row {k}"
            )


def _common_columns(scenario: Scenario) -> list[str]:
    """Return the columns that every record of a leg has, or all of a robot's."""
    if isinstance(scenario, RobotScenario):
        motors = scenario.robot.hip_motors
        rubbed = scenario.servo.records_friction
        return robots_columns(scenario.scene, motors=motors, rubbed=rubbed)
    return list(COLUMNS)


def _own_columns(scenario: Scenario) -> list[str]:
    """Return the columns that a leg's scene adds."""
    columns = []
    if scenario.servo.records_friction:
        columns += FRICTION_COLUMNS
    if isinstance(scenario.scene, Ground):
        columns += [*HIP_COLUMNS, *GROUND_COLUMNS, RAIL_COLUMN]
    if isinstance(scenario.scene, Treadmill):
        columns.append(BELT_COLUMN)
    return columns


def _record(file: Path, parquet: ParquetFile, scenario: Scenario) -> Record:
    """Return the columns of a scenario's record."""
    # Before the rows: some megabytes can hold a thousand times as much.
    _check_layout(file, parquet, scenario)
    table = parquet.read(columns=[*_common_columns(scenario), *_own_columns(scenario)])
    record: Record = {}
    for name in table.column_names:
        column = table[name]
        if column.null_count:
            raise RunDirectoryError(_not_numbers(file, name))
        record[name] = column.to_numpy()
        if not np.isfinite(record[name]).all():
            raise RunDirectoryError(f"{file} is not a record: column {name} is not finite")

    return record


def _check_layout(file: Path, parquet: ParquetFile, scenario: Scenario) -> None:
    """Raise unless a record has the columns and as many rows as its scenario's runs have.

    Raises:
        RunDirectoryError: Names the column, or both numbers of rows.
    """
    import pyarrow

    schema = parquet.schema_arrow
    own = _own_columns(scenario)
    for name in (*_common_columns(scenario), *own):
        if name not in schema.names:
            of = f" of the scene {scenario.scene.kind!r}" if name in own else ""
            raise RunDirectoryError(f"{file} is not a record{of}: it lacks the column {name}")
        if schema.names.count(name) > 1:
            raise RunDirectoryError(f"{file} is not a record: it has the column {name} twice")
        if not pyarrow.types.is_float64(schema.field(name).type):
            raise RunDirectoryError(_not_numbers(file, name))

    rows = parquet.metadata.num_rows
    if rows != scenario.steps:
        raise RunDirectoryError(
            f"{file}: a run of {scenario.duration:g} s at {scenario.sim.timestep:g} s has "
            f"{scenario.steps} rows, got {rows}"
        )


def _not_numbers(file: Path, name: str) -> str:
    return f"{file} is not a record: column {name} must be numbers, all there"
