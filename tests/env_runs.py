"""The same run as a scenario and as a task: what the environments' tests compare with."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from fivebar_sim import Scenario, rollout, tasks
from fivebar_sim.arrays import Array
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.servo import Drive, Servo
from fivebar_sim.geometry import FiveBar
from fivebar_sim.scenario.scenes import Ground

PERIOD = 0.005
SCENES = {
    "track": "classic-ellipse",
    "hop": "rail-hop",
    "stand": "rail-hop",
    "gait": "treadmill-trot",
}
SHORT = ("duration=0.175", "path.frequency=8.0", "path.ramp=0.05")


class Played(msgspec.Struct, frozen=True, kw_only=True):
    """A controller that sends a table, whatever it sees."""

    table: Any
    drive: Drive = "position"
    period: float = PERIOD

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the row of the table that is due, (1, 2)."""
        return self.table[[round(seen.time / self.period)]]


def scenario(kind: str, *settings: str) -> Scenario:
    """Return the scenario of a task, 0.175 s of it."""
    return Scenario.load(SCENES[kind], [*SHORT, *settings])


def task_of(kind: str, run: Scenario, **options: Any) -> tasks.Task:
    """Return the task that is the scenario's run; its episode is as long."""
    same: dict[str, Any] = {
        "leg": run.leg,
        "servo": run.servo,
        "sensors": run.sensors,
        "path": run.path,
        "duration": run.duration,
        "timestep": run.sim.timestep,
        "integrator": run.sim.integrator,
        "period": PERIOD,
        "spread": 0.0,
    }
    if isinstance(run.scene, Ground):
        same |= {"mass": run.scene.mass, "friction": run.scene.friction, "drop": run.scene.drop}
    return tasks.task(kind, **{**same, **options})


def actions(task: tasks.Task, seed: int = 0) -> Array:
    """Return actions that shake the leg within its branch, a row a control step."""
    low, high = task.bounds
    middle = 0.5 * (low + high)
    half = 0.5 * (high - low)
    shake = np.random.default_rng(seed).uniform(-0.2, 0.2, (task.periods, len(low)))
    return middle + half * shake


def played(run: Scenario, table: Array, drive: Drive = "position") -> tuple[Array, Array]:
    """Return qpos and qvel of every step of the scenario's run with a table of commands."""
    controller = Played(table=table, drive=drive)
    steered = msgspec.structs.replace(run, controller=controller)
    record = rollout.run(steered).record
    names = ["hip_z"] if "hip_z" in record else []
    names += ["theta_A", "theta_B", "theta_E", "theta_D"]
    qpos, qvel = (
        np.stack([record[name.replace("_", under, 1)] for name in names], axis=-1)
        for under in ("_", "_dot_")
    )
    return qpos, qvel
