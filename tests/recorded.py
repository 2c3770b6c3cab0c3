"""A run to draw, and recordings read back without a viewer."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from judged import judged
from rerun.chunk import RrdReader

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.measured import Judged
from fivebar_sim.recording import rrd
from fivebar_sim.scenario import Scenario

# all lengths different, so that a swap of two links is seen
LEG = FiveBar(L1=0.04, L2=0.06, L3=0.055, L4=0.045, L5=0.03, L6=0.012, bend=0.3, tilt=0.2)
COAXIAL = FiveBar(L1=0.04, L2=0.06, L3=0.06, L4=0.04, L5=0)
METRICS: dict[str, float | None] = {
    "tracking.rms": 1.23456789e-4,
    "tracking.max": 3e-4,
    "closure.rms": 1e-7,
    "closure.max": 3e-6,
    "load.share_A": None,
    "branch.flips": 0,
    "warnings": 0,
}
MEASURED = judged(METRICS, verdict="fail", provenance={"mujoco": "3.17", "seed": 0})

Record = dict[str, Array]
Columns = dict[str, list[Any]]


def ellipse(leg: FiveBar, steps: int, timestep: float = 0.001) -> Record:
    """Return the record of a foot that goes round an ellipse twice a second, all consistent."""
    t = (np.arange(steps) + 1) * timestep
    w = 4.0 * np.pi
    c = np.cos(w * t)
    s = np.sin(w * t)
    foot = np.stack([0.004 + 0.012 * s, -0.08 - 0.006 * c], axis=-1)
    foot_dot = w * np.stack([0.012 * c, 0.006 * s], axis=-1)
    foot_ddot = w**2 * np.stack([-0.012 * s, 0.006 * c], axis=-1)
    motion = kinematics.joint_motion(leg, foot, foot_dot, foot_ddot)
    q = np.unwrap(motion.q, axis=0)
    record = {"time": t, "target_x": foot[:, 0] + 1e-4 * c, "target_z": foot[:, 1] - 2e-4 * s}
    record |= {"foot_x": foot[:, 0], "foot_z": foot[:, 1]}
    record |= {f"theta_{joint}": q[:, i] for i, joint in enumerate("ABED")}
    record |= {f"theta_dot_{joint}": motion.q_dot[:, i] for i, joint in enumerate("ABED")}
    record |= {"ctrl_A": q[:, 0] + 0.01, "ctrl_E": q[:, 2] - 0.02}
    return record | {"torque_A": 0.02 * s, "torque_E": 0.01 * c - 0.003, "gap": 1e-7 * (1.0 + s)}


class Drawn(NamedTuple):
    """A run that nobody simulated."""

    scenario: Scenario
    record: Record
    measured: Judged


def drawn(leg: FiveBar, record: Record, source: str = "classic-ellipse", **changes: Any) -> Drawn:
    """Return a run of a leg: a shipped scenario with changes, and the record that it had."""
    changes = {"name": "round and round", "leg": leg, **changes}
    return Drawn(msgspec.structs.replace(Scenario.load(source), **changes), record, MEASURED)


def written(path: Path, leg: FiveBar, record: Record) -> Path:
    rrd.write(path, [drawn(leg, record)])
    return path


def standing(record: Record) -> Record:
    """Return the record on a belt: the hip goes up and down, the foot is up, then down."""
    t = record["time"]
    force = np.maximum(-np.sin(10.0 * t), 0.0)
    record = record | {"hip_z": 0.1 + 0.01 * np.cos(10.0 * t), "hip_dot_z": -0.1 * np.sin(10.0 * t)}
    record = record | {"ground_x": -2.0 * force, "ground_z": 5.0 * force, "rail_end": 0.0 * t}
    return record | {"belt_x": -0.3 * t}


def read(path: Path) -> tuple[dict[str, Columns], dict[str, Columns]]:
    """Return what moves and what does not: by entity, the rows of every column."""
    moving: dict[str, Columns] = {}
    static: dict[str, Columns] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        kind = static if chunk.is_static else moving
        entity = kind.setdefault(chunk.entity_path, {})
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            rows = column.cast("int64") if name == "sim_time" else column
            entity.setdefault(name, []).extend(rows.to_pylist())
    for kind in (moving, static):
        for columns in kind.values():
            columns.pop("rerun.controls.RowId")
    return moving, static


def digest(path: Path) -> str:
    """Return a digest of what a recording says, whatever it calls its chunks and rows."""
    return hashlib.sha256(json.dumps(read(path), sort_keys=True).encode()).hexdigest()
