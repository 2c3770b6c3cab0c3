"""A run directory against itself: everything that can be computed again, computed again plainly."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pyarrow.parquet

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.metrics import look_up
from fivebar_sim.recording.check import read_through
from fivebar_sim.runs import directory
from fivebar_sim.scenario import Scenario

Record = dict[str, Array]


def check(place: Path) -> str:
    """Return the verdict of a run directory; fail unless it is whole and true."""
    assert {p.name for p in place.iterdir() if p.suffix != ".csv"} == set(directory.FILES)
    scenario = Scenario.load(place / "scenario.toml")
    table = pyarrow.parquet.read_table(place / "rollout.parquet")
    record: Record = {name: table[name].to_numpy() for name in table.column_names}
    text = (place / "metrics.json").read_text(encoding="utf-8")
    metrics = json.loads(text, parse_constant=_no_constant)
    _check_record(scenario, record)
    _check_closure(scenario, record)
    _check_reach(scenario, record)
    _check_metrics(scenario, record, metrics)
    _check_verdict(scenario, metrics)
    read_through(place / "recording.rrd")
    again = rollout.run(scenario)
    for name, column in record.items():
        np.testing.assert_array_equal(again.record[name], column)
    return metrics["verdict"]


def _no_constant(name: str) -> NoReturn:
    raise AssertionError(f"metrics.json says {name}")


def _check_record(scenario: Scenario, record: Record) -> None:
    """Every step is there, at its time, finite, and the angles are those that the rates make."""
    h = scenario.sim.timestep
    steps = round(scenario.duration / scenario.sim.timestep)
    for name, column in record.items():
        assert column.dtype == np.float64, name
        assert len(column) == steps, name
        assert np.isfinite(column).all(), name
    np.testing.assert_array_equal(record["time"], (np.arange(steps) + 1) * h)
    for joint in "ABED":
        q = record[f"theta_{joint}"]
        v = record[f"theta_dot_{joint}"]
        # semi-implicit: q+ = q + h v+; of the roundings, those of q are the largest
        room = 1e-12 * max(1.0, float(np.abs(q).max()))
        np.testing.assert_allclose(np.diff(q), h * v[1:], rtol=1e-9, atol=room)


def _points(scenario: Scenario, record: Record) -> dict[str, Array]:
    """Return A, B, D, E, both ends of C, and F as complex numbers x + i z."""
    leg = scenario.leg
    angle = {joint: record[f"theta_{joint}"] for joint in "ABED"}
    E = 0.5 * leg.L5 * np.exp(1j * leg.tilt)
    A = -E
    psi_2 = angle["A"] + angle["B"]
    B = A + leg.L1 * np.exp(1j * angle["A"])
    D = E + leg.L4 * np.exp(1j * angle["E"])
    left = B + leg.L2 * np.exp(1j * psi_2)
    right = D + leg.L3 * np.exp(1j * (angle["E"] + angle["D"]))
    F = left + leg.L6 * np.exp(1j * (psi_2 + leg.bend))
    return {"A": A, "B": B, "D": D, "E": E, "left": left, "right": right, "F": F}


def _check_closure(scenario: Scenario, record: Record) -> None:
    """Foot and gap are those of the angles."""
    p = _points(scenario, record)
    leg = scenario.leg
    room = (
        1e-12
        * (leg.size + leg.L5)
        * max(1.0, *(np.abs(record[f"theta_{j}"]).max() for j in "ABED"))
    )
    np.testing.assert_allclose(record["foot_x"], p["F"].real, rtol=0, atol=room)
    np.testing.assert_allclose(record["foot_z"], p["F"].imag, rtol=0, atol=room)
    np.testing.assert_allclose(record["gap"], np.abs(p["right"] - p["left"]), rtol=0, atol=room)


def _check_reach(scenario: Scenario, record: Record) -> None:
    """No target is farther from A or E than their chains are long, or nearer than they fold."""
    leg = scenario.leg
    F = record["target_x"] + 1j * record["target_z"]
    E = 0.5 * leg.L5 * np.exp(1j * leg.tilt)
    long_L2 = abs(leg.L2 + leg.L6 * np.exp(1j * leg.bend))
    room = 1e-9 * (leg.size + leg.L5)
    assert (np.abs(F + E) <= leg.L1 + long_L2 + room).all()
    assert (np.abs(F + E) >= abs(leg.L1 - long_L2) - room).all()
    if leg.L6 == 0.0:
        assert (np.abs(F - E) <= leg.L4 + leg.L3 + room).all()
        assert (np.abs(F - E) >= abs(leg.L4 - leg.L3) - room).all()


def _check_metrics(scenario: Scenario, record: Record, metrics: dict[str, Any]) -> None:
    """The metrics are those of the record."""
    rows = scenario.window
    error = np.hypot(*(record[f"foot_{x}"] - record[f"target_{x}"] for x in "xz"))
    torque = {motor: record[f"torque_{motor}"][rows] for motor in "AE"}
    plain = {
        "tracking.rms": _rms(error[rows]),
        "tracking.max": error[rows].max(),
        "closure.rms": _rms(record["gap"]),
        "closure.max": record["gap"].max(),
        **{f"load.torque_rms.{motor}": _rms(tau) for motor, tau in torque.items()},
        **{f"load.torque_peak.{motor}": np.abs(tau).max() for motor, tau in torque.items()},
    }
    for motor in "AE":
        power = record[f"torque_{motor}"] * record[f"theta_dot_{motor}"]
        plain[f"whole.torque_peak.{motor}"] = np.abs(record[f"torque_{motor}"]).max()
        plain[f"whole.power_peak.{motor}"] = np.abs(power).max()
        plain[f"power_peak.{motor}"] = np.abs(power[rows]).max()
    A, E = (float(np.abs(tau).sum()) for tau in torque.values())
    if look_up(metrics, "load.share_A") is not None:
        plain["load.share_A"] = A / (A + E)
    if "ground_z" in record:
        plain["ground.force_max.z"] = record["ground_z"].max()
        plain["ground.stance_share"] = np.mean(record["ground_z"][rows] > 0.0)
    for key, value in plain.items():
        assert math.isclose(look_up(metrics, key) or 0.0, value, rel_tol=1e-9), key
    assert metrics["branch"]["flips"] == _flips(scenario, record)
    assert metrics["warnings"] == 0


def _rms(values: Array) -> float:
    scale = float(np.abs(values).max()) or 1.0
    return scale * math.sqrt(np.mean((values / scale) ** 2))


def _flips(scenario: Scenario, record: Record) -> int:
    """Return in how many steps a side of the leg, or its loop, folded over."""
    p = _points(scenario, record)

    def side(first: Array, second: Array) -> Array:
        return np.sign((first.conjugate() * second).imag)

    now = [
        side(p["F"] - p["A"], p["B"] - p["A"]),
        side(p["right"] - p["E"], p["D"] - p["E"]),
        side(p["D"] - p["B"], p["left"] - p["B"]),
    ]
    begun = (*scenario.leg.mode, scenario.leg.assembly)
    changed = [np.diff(s, prepend=b) != 0 for s, b in zip(now, begun, strict=True)]
    return int(np.any(changed, axis=0).sum())


def _check_verdict(scenario: Scenario, metrics: dict[str, Any]) -> None:
    """The verdict is what limits and guards say, and no leg that folded over passes."""
    kept = []
    for key, (low, high) in scenario.limits.items():
        value = look_up(metrics, key)
        kept.append(value is not None and low <= value <= high)
    assert [limit["ok"] for limit in metrics["limits"]] == kept
    assert [limit["key"] for limit in metrics["limits"]] == list(scenario.limits)
    good = all(kept) and all(guard["ok"] for guard in metrics["guards"])
    passed = "pass" if scenario.limits else "not judged"
    assert metrics["verdict"] == (passed if good else "fail")
    assert not (good and metrics["branch"]["flips"])
