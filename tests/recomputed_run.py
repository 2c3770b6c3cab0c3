"""The files of a run directory, read without fivebar_sim: for `recomputed`.

The record begins after the first step. Before it the leg was at rest, and a step moves an angle by
h times the rate after it, so the pose at t = 0 is that of the first row less h times its rates.
"""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow.parquet
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Bools = NDArray[np.bool_]


class Run(NamedTuple):
    """The files of a run: the record, the resolved scenario, and what was measured."""

    record: dict[str, Array]
    scenario: dict[str, Any]
    metrics: dict[str, Any]
    folder: Path

    @property
    def h(self) -> float:
        """The timestep [s]."""
        return float(self.scenario["sim"]["timestep"])

    @property
    def rows(self) -> slice:
        """The rows of the measured window: the steps that begin and end within it."""
        window = self.metrics["window"]
        return slice(round(window["begin"] / self.h), round(window["end"] / self.h))

    def pair(self, name: str) -> Array:
        """Return a column of A and of E side by side, (N, 2)."""
        return np.column_stack([self.record[f"{name}_{motor}"] for motor in "AE"])

    def before(self, name: str) -> Array:
        """Return a column as it was before each step, (N,)."""
        column = self.record[name]
        if "_dot_" in name:
            first = 0.0
        else:
            first = column[0] - self.h * self.record[name.replace("_", "_dot_")][0]
        return np.concatenate([[first], column[:-1]])


def read(folder: Path) -> Run:
    """Return the run of a directory."""
    table = pyarrow.parquet.read_table(folder / "rollout.parquet")
    record = {name: np.asarray(table[name]) for name in table.column_names}
    scenario = tomllib.loads((folder / "scenario.toml").read_text("utf-8"))
    metrics = json.loads((folder / "metrics.json").read_text("utf-8"))
    return Run(record, scenario, metrics, folder)


def period(run: Run) -> float | None:
    """Return the time after which the path repeats [s]."""
    path = run.scenario["path"]
    if "frequency" in path:
        return 1.0 / path["frequency"]
    if path.get("periodic"):
        with (run.folder / path["file"]).open(encoding="utf-8") as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
        lasts = float(rows[-1]["time_s"]) - float(rows[0]["time_s"])
        # one step more leads from the last row to the first
        return lasts * len(rows) / (len(rows) - 1)
    return None


def cycle_at(run: Run, time: Array) -> Array:
    """Return where the path is in its cycle, 0 to 1; of a gait since touch-down."""
    path = run.scenario["path"]
    ramp = path["ramp"]
    tau = np.clip(time / ramp, 0.0, 1.0) if ramp else np.ones_like(time)
    # the integral of 10 tau^3 - 15 tau^4 + 6 tau^5, and full speed after the ramp
    own = ramp * (2.5 * tau**4 - 3.0 * tau**5 + tau**6) + np.maximum(time - ramp, 0.0)
    lasts = period(run)
    assert lasts is not None
    # a gait begins in the middle of its stance
    return (own / lasts + (0.5 * path["duty"] if path["kind"] == "gait" else 0.0)) % 1.0
