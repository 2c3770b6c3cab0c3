"""A run as those need it who draw, write or judge it."""

from __future__ import annotations

from typing import Any, Protocol

from fivebar_sim.metrics.columns import Record
from fivebar_sim.metrics.limits import Limit
from fivebar_sim.metrics.measured import Judged
from fivebar_sim.scenario.scenario import Scenario


class Run(Protocol):
    """A run and what came of it: a result, or one that was read back."""

    @property
    def scenario(self) -> Scenario:
        """The scenario that was run."""
        ...

    @property
    def record(self) -> Record:
        """The columns of rollout.parquet, each (N,), SI."""
        ...

    @property
    def measured(self) -> Judged:
        """All of metrics.json, with types."""
        ...


class JudgedRun(Run, Protocol):
    """A run with its metrics as a table, and its limits: `rollout.Result`."""

    @property
    def metrics(self) -> dict[str, Any]:
        """All of metrics.json as nested dictionaries."""
        ...

    @property
    def limits(self) -> list[Limit]:
        """Every limit with its value."""
        ...
