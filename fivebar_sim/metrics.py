"""What a run is judged by: foot tracking, loop closure, load of the two motors, branch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.geometry import FiveBar

Record = dict[str, Array]

JOINT_COLUMNS = ("theta_A", "theta_B", "theta_E", "theta_D")

LIMIT_KEYS = (
    "tracking.rms",
    "tracking.max",
    "closure.rms",
    "closure.max",
    "load.torque_rms.A",
    "load.torque_rms.E",
    "load.torque_peak.A",
    "load.torque_peak.E",
    "load.share_A",
    "load.thermal_share_A",
    "branch.flips",
    "warnings",
)
"""The metrics that a scenario may set limits on."""


class Limit(NamedTuple):
    """One limit and what came of it; `ok` where low <= value <= high."""

    key: str
    low: float
    high: float
    value: float | None
    ok: bool


def measure(
    leg: FiveBar, record: Mapping[str, Array], window: slice, warnings: int
) -> dict[str, Any]:
    """Return the metrics of a run, in SI units.

    With e = |foot - target|, and tau the torque of motor A or E, over the window:

        tracking.rms = sqrt(mean e^2)
        load.share_A = sum |tau_A| / (sum |tau_A| + sum |tau_E|), thermal_share_A the same of tau^2

    closure is the loop gap over the whole run, and branch looks at every step of it.

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        window: The rows that tracking and load are measured over.
        warnings: MuJoCo's warnings.
    """
    error = np.hypot(record["foot_x"] - record["target_x"], record["foot_z"] - record["target_z"])[
        window
    ]
    gap = record["gap"]
    return {
        "tracking": {"rms": _rms(error), "max": float(error.max())},
        "closure": {"rms": _rms(gap), "max": float(gap.max())},
        "load": _load(record["torque_A"][window], record["torque_E"][window]),
        "branch": _branch(leg, record),
        "warnings": warnings,
    }


def _load(tau_A: Array, tau_E: Array) -> dict[str, Any]:
    return {
        "torque_rms": {"A": _rms(tau_A), "E": _rms(tau_E)},
        "torque_peak": {"A": float(np.abs(tau_A).max()), "E": float(np.abs(tau_E).max())},
        "share_A": _share(np.abs(tau_A), np.abs(tau_E)),
        "thermal_share_A": _share(tau_A**2, tau_E**2),
    }


def _share(part: Array, other: Array) -> float | None:
    """Return part's share of the sum of both, or None where there is nothing to share."""
    whole = float(part.sum() + other.sum())
    return float(part.sum()) / whole if whole > 0.0 else None


def _branch(leg: FiveBar, record: Mapping[str, Array]) -> dict[str, Any]:
    """Return the branch of the last step, how often it flipped, and when first.

    Every step is compared with the one before, the first with the leg's own branch.
    """
    q = np.stack([record[name] for name in JOINT_COLUMNS], axis=-1)
    signs = np.stack(kinematics.branch(leg, kinematics.chain_points(leg, q)), axis=-1)
    own = np.array([*leg.mode, leg.assembly])
    flipped = np.any(np.diff(signs, axis=0, prepend=own[None]) != 0, axis=-1)
    s_A, s_E, assembly = signs[-1].tolist()
    return {
        "working_mode": [s_A, s_E],
        "assembly": assembly,
        "flips": int(flipped.sum()),
        "first_flip": float(record["time"][np.argmax(flipped)]) if flipped.any() else None,
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def look_up(metrics: Mapping[str, Any], key: str) -> float | None:
    """Return the metric of a dotted key ("load.torque_rms.A")."""
    value: Any = metrics
    for part in key.split("."):
        value = value[part]
    return value


def judge(metrics: Mapping[str, Any], limits: Mapping[str, tuple[float, float]]) -> list[Limit]:
    """Return every limit with its value. A metric that is undefined fails its limit."""
    judged = []
    for key, (low, high) in limits.items():
        value = look_up(metrics, key)
        judged.append(Limit(key, low, high, value, value is not None and low <= value <= high))
    return judged
