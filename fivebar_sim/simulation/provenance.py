"""Where a result comes from, and what tells it from every other result."""

from __future__ import annotations

import hashlib
import json
import platform
import subprocess
from functools import cache
from importlib.metadata import version
from typing import Any

from fivebar_sim.files import resources
from fivebar_sim.metrics.columns import digest
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.run import Run


def provenance(scenario: Scenario) -> dict[str, Any]:
    """Return what a run's numbers depend on besides the scenario's physics."""
    return {
        **_versions(),
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "integrator": scenario.sim.integrator,
        "timestep": scenario.sim.timestep,
        "seed": scenario.sim.seed,
        "git": git_state(),
    }


def identity(run: Run, checksum: str = "") -> str:
    """Return what identifies a run: a checksum of all that a recording shows of it.

    Args:
        run: The run.
        checksum: That of its record, see `digest`; by default it is computed.
    """
    parts = [run.scenario.table(), run.measured.table, checksum or digest(run.record)]
    said = json.dumps(parts)
    return hashlib.sha256(said.encode()).hexdigest()


@cache
def _versions() -> dict[str, str]:
    """Return the versions of the packages that the numbers come from."""
    return {"fivebar_sim": version("fivebar-sim")} | {p: version(p) for p in ("mujoco", "numpy")}


@cache
def git_state() -> str | None:
    """Return the commit of the checkout that the package runs from, "-dirty" if changed.

    None where it is no git checkout, or git is not installed.
    """
    if not (resources.PACKAGE.parent / ".git").exists():
        return None
    command = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        said = subprocess.run(
            command, cwd=resources.PACKAGE, capture_output=True, text=True, timeout=5, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return said.stdout.strip() or None
