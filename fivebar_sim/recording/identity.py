"""Which run a recording is of: a property of the recording that no other run's has."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

from fivebar_sim.metrics.columns import Record, digest
from fivebar_sim.metrics.measured import Judged

if TYPE_CHECKING:
    from fivebar_sim.scenario import Scenario


def identity(scenario: Scenario, record: Record, measured: Judged) -> str:
    """Return what identifies a run: a checksum of all that a recording shows of it."""
    said = json.dumps([scenario.table(), measured.table, digest(record)])
    return hashlib.sha256(said.encode()).hexdigest()
