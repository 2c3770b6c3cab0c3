"""MuJoCo simulation of the closed-chain five-bar leg, with torque and load numbers that are proven.

Names load on first use, so that the pure NumPy rooms never wait for MuJoCo.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fivebar_sim import dynamics, kinematics, model, workspace
    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.rollout import run
    from fivebar_sim.scenario import Scenario

__version__ = "0.1.0"
__all__ = ["FiveBar", "Scenario", "dynamics", "kinematics", "model", "run", "workspace"]

_HOMES = {"FiveBar": "geometry", "Scenario": "scenario", "run": "rollout"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'fivebar_sim' has no attribute {name!r}")
    module = importlib.import_module(f"fivebar_sim.{_HOMES.get(name, name)}")
    return getattr(module, name) if name in _HOMES else module
