"""A result to write into run directories, and what is in a folder."""

from __future__ import annotations

from pathlib import Path

from fivebar_sim import rollout
from fivebar_sim.rollout import Result
from fivebar_sim.scenario import Scenario


def a_result() -> Result:
    """Return the result of a short run that breaks its limit."""
    settings = ["duration=0.751", "path.frequency=4", "limits={tracking={rms=1e-9}}"]
    return rollout.run(Scenario.load("classic-ellipse", settings))


def names(folder: Path) -> set[str]:
    """Return the names in a folder."""
    return {path.name for path in folder.iterdir()}
