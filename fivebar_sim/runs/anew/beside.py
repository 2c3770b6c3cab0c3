"""What the metadata of a record has besides its columns: enough to measure the run anew."""

from __future__ import annotations

import json
from collections.abc import Mapping

import msgspec
import numpy as np

from fivebar_sim.arrays import Bools
from fivebar_sim.metrics.measured import Judged

KEY = b"fivebar_sim.beside"
"""Where the metadata has it."""

SOLVER = "solver"
"""The guard that counts the steps in which MuJoCo's solver ran out of iterations."""


class Beside(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What no column says.

    Attributes:
        provenance: What the numbers depend on besides the scenario.
        unsolved: Steps in which MuJoCo's solver ran out of iterations.
        first: When the first of them ended [s]; None without any.
    """

    provenance: dict[str, str | int | float | None]
    unsolved: int = 0
    first: float | None = None

    def steps(self, rows: int, timestep: float) -> Bools:
        """Return steps of which as many are unsolved, from the first on, (rows,).

        Which the others are does not matter: the guard counts them, and says when the first was.

        Args:
            rows: Steps of the run.
            timestep: h [s].
        """
        found = np.zeros(rows, dtype=bool)
        if self.first is not None:
            begin = round(self.first / timestep) - 1
            found[begin : begin + self.unsolved] = True
        return found


def written(measured: Judged) -> dict[bytes, bytes]:
    """Return what belongs beside a record as the metadata of Parquet."""
    solver = next(guard for guard in measured.guards if guard.name == SOLVER)
    beside = {
        "provenance": measured.provenance,
        "unsolved": int(solver.value or 0.0),
        "first": solver.time,
    }
    return {KEY: json.dumps(beside).encode()}


def read(metadata: Mapping[bytes, bytes] | None) -> Beside | None:
    """Return what the metadata of Parquet has; None where it has nothing that is legal."""
    try:
        return msgspec.json.decode((metadata or {}).get(KEY, b""), type=Beside)
    except msgspec.DecodeError:
        return None
