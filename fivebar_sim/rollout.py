"""Runs: a scenario is planned, simulated, measured and judged; all legs of one call at once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from fivebar_sim import kinematics, metrics, model, motion
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, DivergedError, FiveBarError
from fivebar_sim.metrics import JOINT_COLUMNS, Limit, Record
from fivebar_sim.motion import Motion
from fivebar_sim.provenance import provenance
from fivebar_sim.scenario import Scenario
from fivebar_sim.servo import applied_torque
from fivebar_sim.simulate import States, check, simulate


class Plan(NamedTuple):
    """A scenario that was found possible: what the foot shall do, and what the servos are sent.

    Attributes:
        scenario: What was asked for.
        motion: The foot and the joints at every step.
        ctrl: Setpoints of every step [rad], (N, 2).
        model: The leg's model.
    """

    scenario: Scenario
    motion: Motion
    ctrl: Array
    model: mujoco.MjModel


class Result(NamedTuple):
    """What came of a run.

    Attributes:
        scenario: What was run.
        record: The columns of rollout.parquet, each (N,), SI.
        metrics: What metrics.json says.
        limits: Every limit with its value.
    """

    scenario: Scenario
    record: Record
    metrics: dict[str, Any]
    limits: list[Limit]

    @property
    def verdict(self) -> str:
        """Either "pass" or "fail"."""
        return self.metrics["verdict"]

    def write(self, path: str | Path) -> Path:
        """Write the run directory; see `run_directory.write`."""
        from fivebar_sim import run_directory

        return run_directory.write(self, Path(path))


def plan(scenario: Scenario) -> Plan:
    """Return the plan of a scenario, without simulating anything.

    Raises:
        UnreachableError: The path leaves what the leg can reach; says when and where.
        ConfigError: A controller that plans setpoints of the wrong shape or not finite.
    """
    h, steps, integrator = scenario.sim.timestep, scenario.steps, scenario.sim.integrator
    wanted = motion.plan(scenario.leg, scenario.path, steps, h)
    ctrl = _setpoints(scenario, wanted)
    built = model.build(
        scenario.leg,
        servo=scenario.servo,
        scene="air",
        timestep=h,
        integrator=integrator,
    )
    return Plan(scenario, wanted, ctrl, built)


def _setpoints(scenario: Scenario, wanted: Motion) -> Array:
    """Return the setpoints that the scenario's controller plans, checked."""
    name, shape = f"controller {scenario.controller_name!r}", (scenario.steps, 2)
    try:
        planned = scenario.controller.setpoints(
            scenario.leg, scenario.servo, wanted, scenario.sim.integrator
        )
    except FiveBarError:
        raise
    except Exception as error:  # a user's code may raise anything
        raise ConfigError(f"{name} failed: {type(error).__name__}: {error}") from error
    ctrl = np.asarray(planned)
    if ctrl.dtype.kind not in "fiu" or ctrl.shape != shape or not np.isfinite(ctrl).all():
        raise ConfigError(
            f"{name} must plan finite setpoints [rad] of shape {shape}, "
            f"got {ctrl.dtype} of shape {ctrl.shape}"
        )
    return ctrl.astype(np.float64)


def run(scenario: Scenario) -> Result:
    """Return the result of one scenario.

    Raises:
        UnreachableError: The path leaves what the leg can reach.
        DivergedError: The simulation broke down; says when.
    """
    return execute(plan(scenario))


def execute(planned: Plan) -> Result:
    """Return the result of one plan; see `run`."""
    return run_all([planned])[0]


def run_all(plans: Sequence[Plan], nthread: int = 1) -> list[Result]:
    """Return the results of plans, those of one timestep and length simulated together.

    The bits are the same as one by one.

    Args:
        plans: What to simulate.
        nthread: Threads; 0 is one for every processor.

    Raises:
        DivergedError: A simulation broke down; says which, and when.
    """
    results: dict[int, Result] = {}

    def alike(index: int) -> tuple[float, int]:
        return plans[index].motion.timestep, len(plans[index].ctrl)

    for _, group in groupby(sorted(range(len(plans)), key=alike), key=alike):
        members = list(group)
        chosen = [plans[i] for i in members]
        states = simulate(
            [p.model for p in chosen],
            np.stack([p.motion.q[0] for p in chosen]),
            np.stack([p.ctrl for p in chosen]),
            nthread,
        )
        for row, i in enumerate(members):
            results[i] = _result(plans[i], States(*(field[row : row + 1] for field in states)))
    return [results[i] for i in range(len(plans))]


def _result(planned: Plan, states: States) -> Result:
    scenario = planned.scenario
    try:
        check(states, scenario.sim.timestep)
        _check_resolution(scenario)
    except DivergedError as error:
        raise DivergedError(f"{scenario.name}: {error}", error.time) from None
    record = _record(planned, states.qpos[0], states.qvel[0])
    measured = metrics.measure(
        scenario.leg, record, scenario.window, warnings=int(states.warnings[0])
    )
    limits = metrics.judge(measured, scenario.limits)
    good = all(limit.ok for limit in limits) and measured["branch"]["flips"] == 0
    measured["verdict"] = "pass" if good else "fail"
    measured["limits"] = [
        {**limit._asdict(), "low": None if limit.low == -np.inf else limit.low} for limit in limits
    ]
    measured["provenance"] = provenance(scenario)
    return Result(scenario, record, measured, limits)


def _check_resolution(scenario: Scenario) -> None:
    """Raise if a run has too few steps a period to tell how the foot followed."""
    h, period = scenario.sim.timestep, scenario.path.period
    if period is not None and not h < period / 4:
        raise DivergedError(
            f"the simulation cannot follow the path: the timestep must be below a quarter of its "
            f"period of {period:g} s, got {h:g} s",
            h,
        )


def _record(planned: Plan, qpos: Array, qvel: Array) -> Record:
    """Return the columns of rollout.parquet: row k is the state at t = (k + 1) h.

    Foot and gap are those of qpos itself, not MuJoCo's kinematics of the step before.
    """
    scenario, wanted = planned.scenario, planned.motion
    before = np.concatenate([wanted.q[:1], qpos[:-1]])
    motors = [JOINT_COLUMNS.index("theta_A"), JOINT_COLUMNS.index("theta_E")]
    torque = applied_torque(
        scenario.servo,
        scenario.sim.integrator,
        planned.ctrl,
        before[:, motors],
        qpos[:, motors],
        qvel[:, motors],
    )
    points = kinematics.chain_points(scenario.leg, qpos)
    target, gap = wanted.foot[1:], points.C_right - points.C_left
    record = {
        "time": wanted.time[1:],
        "target_x": target[:, 0],
        "target_z": target[:, 1],
        "foot_x": points.F[:, 0],
        "foot_z": points.F[:, 1],
    }
    record |= {name: qpos[:, i] for i, name in enumerate(JOINT_COLUMNS)}
    record |= {
        name.replace("theta", "theta_dot"): qvel[:, i] for i, name in enumerate(JOINT_COLUMNS)
    }
    record |= {"ctrl_A": planned.ctrl[:, 0], "ctrl_E": planned.ctrl[:, 1]}
    record |= {"torque_A": torque[:, 0], "torque_E": torque[:, 1]}
    record["gap"] = np.hypot(gap[:, 0], gap[:, 1])
    return {name: np.ascontiguousarray(column) for name, column in record.items()}
