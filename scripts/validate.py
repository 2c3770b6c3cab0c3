"""./.venv/bin/python scripts/validate.py: classic-ellipse in MuJoCo against the independent model.

For each integrator, timestep and feedforward: foot tracking, torque RMS of A, and loop gap, beside
the closed-form model of tests/oracle.py at 1e-11 rad; and what MuJoCo's actuator sensor would say.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from mujoco.batch import Batch
from rich.console import Console
from rich.table import Table

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.rollout import Plan
from fivebar_sim.scenario import Scenario

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import oracle
import oracle_simulation

COLUMNS = (
    "integrator",
    "h [ms]",
    "feedforward",
    "tracking [um]",
    "oracle",
    "foot off [um]",
    "torque A [mN m]",
    "oracle",
    "torque off",
    "sensor off",
    "gap [um]",
)


def sensor(planned: Plan) -> Array:
    """Return what the actuator force sensors show at every step [N m], (N, 2)."""
    batch = Batch(planned.model, 1, 1)
    batch.qpos = planned.motion.q[:1]
    name = "actuator_force"
    return batch.rollout(len(planned.ctrl), planned.ctrl[None], record=(name,))[name][0]


def rms(values: Array) -> float:
    """Return the root mean square over time of vectors (N, 2), or of numbers (N,)."""
    return float(np.sqrt(np.mean(values**2) * (values.ndim)))


def compare(integrator: str, timestep: float, feedforward: str) -> list[str]:
    """Return one row of the table."""
    scenario = Scenario.load(
        "classic-ellipse",
        [
            f"sim.integrator={integrator}",
            f"sim.timestep={timestep}",
            f"controller.feedforward={feedforward}",
        ],
    )
    planned = rollout.plan(scenario)
    result, window = rollout.execute(planned), scenario.window
    servo = scenario.servo
    law = oracle_simulation.Servo(kp=servo.kp, kd=servo.kd, feedforward=feedforward)
    path = oracle_simulation.eased_ellipse((0.0, -0.072), (0.020, 0.008), 2.0, 0.25)
    leg = oracle.Leg.of(scenario.leg)
    true = oracle_simulation.simulate(leg, law, path, scenario.duration, result.record["time"])

    foot, target, torque = (
        np.stack([result.record[f"{name}{end}"] for end in ends], axis=-1)[window]
        for name, ends in (("foot_", "xz"), ("target_", "xz"), ("torque_", "AE"))
    )
    tau = true.tau[window]
    return [
        integrator,
        f"{1e3 * timestep:g}",
        feedforward,
        f"{1e6 * rms(foot - target):.2f}",
        f"{1e6 * rms(true.foot[window] - target):.2f}",
        f"{1e6 * rms(foot - true.foot[window]):.2f}",
        f"{1e3 * rms(torque[:, 0]):.4f}",
        f"{1e3 * rms(tau[:, 0]):.4f}",
        f"{100 * rms(torque[:, 0] - tau[:, 0]) / rms(tau[:, 0]):.2f} %",
        f"{100 * rms(sensor(planned)[window][:, 0] - tau[:, 0]) / rms(tau[:, 0]):.0f} %",
        f"{1e6 * result.metrics['closure']['max']:.3f}",
    ]


if __name__ == "__main__":
    table = Table(title="classic-ellipse: MuJoCo against the independent model")
    for column in COLUMNS:
        table.add_column(column, justify="right")
    for integrator in ("discrete", "implicitfast"):
        for feedforward in ("none", "velocity"):
            for timestep in (1e-3, 5e-4, 2.5e-4):
                table.add_row(*compare(integrator, timestep, feedforward))
    Console(width=140).print(table)
