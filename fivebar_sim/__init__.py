"""MuJoCo simulation of the closed-chain five-bar leg, with validated torque and load numbers.

Names load on first use, so that the pure NumPy packages never wait for MuJoCo.
"""

from __future__ import annotations

# Not from typing, whose import would be the slowest part of the program's first moments, in which
# nobody hears Ctrl-C yet; type checkers take it for the same.
TYPE_CHECKING = False

if TYPE_CHECKING:
    from typing import Any

    from fivebar_sim import dynamics, errors, kinematics, model, workspace
    from fivebar_sim.control import Feedback, Setpoints
    from fivebar_sim.control.servo import Servo
    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.kinematics import hip, two_link
    from fivebar_sim.rollout import Result, run, run_all
    from fivebar_sim.scenario import Scenario

__version__ = "0.1.0"
__all__ = [
    "Feedback",
    "FiveBar",
    "Result",
    "Scenario",
    "Servo",
    "Setpoints",
    "dynamics",
    "errors",
    "hip",
    "kinematics",
    "model",
    "run",
    "run_all",
    "two_link",
    "workspace",
]

_MODULES = {
    **{name: name for name in ("dynamics", "errors", "kinematics", "model", "workspace")},
    "hip": "kinematics.hip",
    "two_link": "kinematics.two_link",
}
"""The exported modules, and the path of each within the package."""

_HOMES = {
    "Feedback": "control",
    "FiveBar": "geometry",
    "Result": "rollout",
    "Scenario": "scenario",
    "Servo": "control.servo",
    "Setpoints": "control",
    "run": "rollout",
    "run_all": "rollout",
}
"""The module that defines each other export."""


def __getattr__(name: str) -> Any:
    import importlib

    if name in _MODULES:
        return importlib.import_module(f"fivebar_sim.{_MODULES[name]}")
    if name in _HOMES:
        return getattr(importlib.import_module(f"fivebar_sim.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'fivebar_sim' has no attribute {name!r}")


def __dir__() -> list[str]:
    # Without this, names that are not loaded yet would be missing from dir() and completion.
    return sorted({*globals(), *__all__})
