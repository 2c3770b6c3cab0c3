"""The largest torque, speed, power, loop gap and ground force, and when they occur.

Once over the measured window, and once over the whole run: a motor has to survive the landing too,
which may lie before the window.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.metrics.columns import MOTORS, motors
from fivebar_sim.metrics.ground import GroundForce
from fivebar_sim.metrics.json_types import Amount, Motors, Table


class Window(Table, frozen=True):
    """The measured window [s]: its first step begins at `begin`, its last one ends at `end`."""

    begin: Amount
    end: Amount


class Peaks(Table, frozen=True):
    """The peaks of some steps; see `measure`."""

    torque_peak: Motors
    speed_peak: Motors
    power_peak: Motors
    gap_peak: Amount
    ground_peak: GroundForce | msgspec.UnsetType = msgspec.UNSET


class Whole(Peaks, frozen=True, kw_only=True):
    """The peaks of the whole run.

    Attributes:
        at: When each of them occurs for the first time [s].
    """

    at: Peaks


def measure(record: Mapping[str, Array], window: slice) -> Peaks:
    """Return the peaks of a window.

        torque_peak = max |tau|,   speed_peak = max |theta'|,   power_peak = max |tau theta'|,
        of A and of E; gap_peak = max gap; ground_peak.x = max |F_x|, ground_peak.z = max F_z

    A step moves the leg by its timestep times the rate after it, so tau theta' is the work of the
    step over its duration.

    Args:
        record: The columns of rollout.parquet.
        window: The rows to look at.
    """
    rows = {name: column[window] for name, column in record.items()}
    return _named({name: float(size.max()) for name, size in _sizes(rows).items()})


def measure_whole(record: Mapping[str, Array]) -> Whole:
    """Return the peaks of the whole run, with the end of the step in which each occurs."""
    time = record["time"]
    sizes = _sizes(record)
    rows = {name: int(np.argmax(size)) for name, size in sizes.items()}
    peaks = _named({name: float(size[rows[name]]) for name, size in sizes.items()})
    at = _named({name: float(time[k]) for name, k in rows.items()})
    return Whole(**msgspec.structs.asdict(peaks), at=at)


def _sizes(record: Mapping[str, Array]) -> dict[str, Array]:
    """Return what the peaks are taken of, by name, each (N,)."""
    torque = motors(record, "torque")
    speed = motors(record, "theta_dot")
    pairs = {"torque_peak": torque, "speed_peak": speed, "power_peak": torque * speed}
    sizes = {
        f"{name}.{motor}": np.abs(pair[:, k])
        for name, pair in pairs.items()
        for k, motor in enumerate(MOTORS)
    }
    sizes["gap_peak"] = record["gap"]
    # No floor, no force of it: a 0 would look measured.
    if "ground_z" in record:
        sizes["ground_peak.x"] = np.abs(record["ground_x"])
        sizes["ground_peak.z"] = record["ground_z"]
    return sizes


def _named(values: Mapping[str, float]) -> Peaks:
    """Return numbers by name ("torque_peak.A") with types."""
    tables: dict[str, dict[str, float]] = {}
    for key, value in values.items():
        table, _, name = key.partition(".")
        tables.setdefault(table, {})[name] = value

    ground = tables.get("ground_peak")
    return Peaks(
        torque_peak=Motors(**tables["torque_peak"]),
        speed_peak=Motors(**tables["speed_peak"]),
        power_peak=Motors(**tables["power_peak"]),
        gap_peak=values["gap_peak"],
        ground_peak=msgspec.UNSET if ground is None else GroundForce(**ground),
    )
