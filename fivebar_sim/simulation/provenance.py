"""Where a result comes from: versions, platform, solver settings, the state of the checkout."""

from __future__ import annotations

import platform
import subprocess
from functools import cache
from importlib.metadata import version
from typing import Any

from fivebar_sim.files import resources
from fivebar_sim.scenario import Scenario


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
