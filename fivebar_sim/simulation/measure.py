"""The metrics of a run: foot tracking, loop closure, load of the motors, energy, branch, guards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import catalogue, energy, ground, guards, load
from fivebar_sim.metrics.columns import JOINT_COLUMNS, MOTORS, motors
from fivebar_sim.paths import Gait

if TYPE_CHECKING:
    from fivebar_sim.scenario import Scenario


class Unrecorded(NamedTuple):
    """Per-step data that the metrics need and rollout.parquet leaves out.

    Attributes:
        steps: The forces that acted, and the pose at the start.
        saturated: Whether the torque limit clipped A and E in each step, (N, 2).
        unsolved: Whether MuJoCo's solver ran out of iterations in each step, (N,).
        warnings: Number of MuJoCo's warnings.
    """

    steps: energy.Steps
    saturated: Bools
    unsolved: Bools
    warnings: int


def measure(scenario: Scenario, record: Mapping[str, Array], besides: Unrecorded) -> dict[str, Any]:
    """Return the metrics of a run, in SI units.

    Tracking, closure and everything else with a function of its own come from `catalogue`; load
    from `load.measure`, where saturated is the fraction of steps in which the torque limit clipped;
    energy from `energy.measure`. Branch and guards look at every step, the others at the window.

    Args:
        scenario: The scenario that was run.
        record: The columns of rollout.parquet.
        besides: What the record leaves out.
    """
    leg = scenario.leg
    # qpos may begin with the hip's height; its last four are A, B, E, D.
    start = besides.steps.start[-4::2]
    saturated = besides.saturated
    body = energy.Body(leg, scenario.payload, scenario.trunk)
    balance = energy.balance(body, record, besides.steps)
    branch = _branch(leg, record)
    checked = guards.Checked(
        bounds=scenario.guards,
        leg=leg,
        record=record,
        branch=branch,
        saturated=saturated,
        balance=balance,
        unsolved=besides.unsolved,
        command=scenario.command,
    )
    window = scenario.window
    tables: dict[str, Any] = {
        "load": _load(scenario, record, start, saturated),
        "energy": energy.measure(balance),
        "branch": branch,
        "guards": [{**guard._asdict(), "ok": guard.ok} for guard in guards.judge(checked)],
        "warnings": int(besides.warnings),
    }

    if "ground_z" in record:
        tables["ground"] = ground.measure(leg, record, window)

    # Merged, not replaced: a row of the catalogue may add a number to one of these tables.
    measured = catalogue.measure(leg, record, window)
    for name, table in tables.items():
        measured[name] = {**table, **measured[name]} if name in measured else table
    return measured


def _load(
    scenario: Scenario, record: Mapping[str, Array], start: Array, saturated: Bools
) -> dict[str, Any]:
    """Return how the motors share the load over the window, and how often they are clipped."""
    window = scenario.window
    path = scenario.path
    h = scenario.sim.timestep
    torque = motors(record, "torque")
    theta = motors(record, "theta")
    # The work of a step needs the angles before it too: one row more than the torques.
    turned = np.concatenate([start[None], theta])[window.start : window.stop + 1]
    # A step belongs to the phase it starts in; rounding may put the first start below 0.
    begun = np.maximum(record["time"][window] - h, 0.0)
    phase = stance = None

    if path.period is not None:
        phase = path.cycle(begun)

    # With a ground the real stance counts, not the planned one.
    if "ground_z" in record:
        stance = ground.stands(record)[window]
    elif isinstance(path, Gait):
        stance = path.in_stance(begun)

    measured = load.measure(torque[window], turned, h, stance=stance, phase=phase)
    clipped = saturated[window].mean(axis=0).tolist()
    return {**measured, "saturated": dict(zip(MOTORS, clipped, strict=True))}


def _branch(leg: FiveBar, record: Mapping[str, Array]) -> dict[str, Any]:
    """Return the branch after the last step, how often it flipped, and when first.

    Every step is compared with the one before, the first step with the leg's own branch.
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
