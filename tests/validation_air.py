"""MuJoCo against the oracle in the air: every preset on an ellipse of its own, step by step finer.

Both are compared at the same times, every 2 ms of the period after the ramp; the torque of a step
also with the oracle's at the start of that step. All runs of one `measure` are of one preset: a
batch of MuJoCo steps legs of one structure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import oracle
import oracle_simulation
from fivebar_controllers.servo import Servo as Law
from mujoco.batch import Batch

from fivebar_sim import dynamics, kinematics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import Integrator
from fivebar_sim.paths import Ellipse, Line
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.forces import Constant
from fivebar_sim.scenario.scenario import Sim
from fivebar_sim.scenario.scenes import Air, Scene

PRESETS = tuple(resources.shipped("models/legs"))
INTEGRATORS: tuple[Integrator, ...] = ("discrete", "implicitfast")
FEEDFORWARDS = ("none", "velocity", "torque")
TIMESTEPS = (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
# [s]
RAMP = 0.25
PERIOD = 0.5
TICK = TIMESTEPS[-1]  # [s]; all steps start and end at multiples of it
GRID = round(TIMESTEPS[0] / TICK)  # ticks between two rows that are compared
RTOL = 1e-8
"""Of the oracle's motions: it leaves 0.1 nm of foot and two millionths of the torques,
and takes a third of what their own tests ask for."""
ROWS = slice(round(RAMP / TIMESTEPS[0]), None)


class Key(NamedTuple):
    """One run: which preset, driven and simulated how; the timestep in [s]."""

    preset: str
    integrator: Integrator
    feedforward: str
    timestep: float


class Truth(NamedTuple):
    """The oracle's motion: at the rows foot [m] and tau [N m], (n, 2); tau also h before."""

    foot: Array
    tau: Array
    before: Mapping[float, Array]


class Error(NamedTuple):
    """How far a run is from the oracle; of A and E the worse.

    Attributes:
        foot: RMS distance of the feet at the same time [m].
        late: RMS difference of the torques at the same time, in parts of the oracle's RMS.
        start: The same, with the oracle's torque at the start of the step.
        rms: Difference of the RMS torques, in parts of the oracle's.
        sensor: `late` of MuJoCo's actuator force sensor.
        share: Difference of A's share in the torque, of 1.
        gap: Largest loop gap of the run [m].
    """

    foot: float
    late: float
    start: float
    rms: float
    sensor: float
    share: float
    gap: float


@cache
def gains(preset: str) -> Servo:
    """Return classic's 8 N m/rad and 0.05 N m s/rad, scaled with the leg's inertia.

    The factor is tr M of the leg over tr M of `classic`, both in their rest poses; so all legs have
    classic's time constants: kd / kp = 6 ms, and M / kd = 0.4 ms.
    """
    inertia, unit = (
        np.trace(dynamics.mass_matrix(leg, kinematics.home(leg)[::2]))
        for leg in (FiveBar.load(preset), FiveBar.load("classic"))
    )
    factor = float(inertia / unit)
    return Servo(kp=8.0 * factor, kd=0.05 * factor)


def rest(leg: FiveBar) -> tuple[float, float]:
    """Return the foot of the rest pose [m]."""
    x, z = kinematics.forward(leg, kinematics.home(leg)[::2]).tolist()
    return x, z


def around_rest(leg: FiveBar) -> Ellipse:
    """Return an ellipse from the rest pose on, a quarter of the leg's size long."""
    x, z = rest(leg)
    size = leg.size
    radii = (0.12 * size, 0.06 * size)
    return Ellipse(centre=(x, z + radii[1]), radii=radii, frequency=1.0 / PERIOD, ramp=RAMP)


def path_of(ellipse: Ellipse) -> oracle_simulation.Path:
    """Return the oracle's own formula of an ellipse."""
    return oracle_simulation.eased_ellipse(
        ellipse.centre, ellipse.radii, ellipse.frequency, ellipse.ramp
    )


def servo_of(servo: Servo, feedforward: str) -> oracle_simulation.Servo:
    """Return the oracle's continuous servo; what is "torque" here is "dynamics" there."""
    name = "dynamics" if feedforward == "torque" else feedforward
    return oracle_simulation.Servo(servo.kp, servo.kd, name)


def scenario(
    leg: FiveBar,
    path: Ellipse | Line,
    servo: Servo,
    key: Key,
    scene: Scene | None = None,
    duration: float = RAMP + PERIOD,
    force: Constant | None = None,
) -> Scenario:
    """Return the scenario of a leg on a path."""
    return Scenario(
        name=key.preset,
        leg=leg,
        path=path,
        controller=Law(feedforward=key.feedforward),  # pyright: ignore[reportArgumentType]
        controller_name="servo",
        scene=Air() if scene is None else scene,
        duration=duration,
        force=force,
        servo=servo,
        sim=Sim(timestep=key.timestep, integrator=key.integrator),
    )


@cache
def truth(preset: str, feedforward: str, timesteps: Sequence[float]) -> Truth:
    """Return the oracle's motion of a preset; also one of some timesteps before every row."""
    last = round((RAMP + PERIOD) / TICK)
    rows = np.arange(GRID, last + 1, GRID)[ROWS]
    early = {h: rows - round(h / TICK) for h in timesteps}
    ticks = np.unique(np.concatenate([rows, *early.values()]))
    foot, tau = _moved(preset, feedforward, ticks.astype(np.float64) * TICK)
    at = {h: tau[np.searchsorted(ticks, wanted)] for h, wanted in early.items()}
    every = np.searchsorted(ticks, rows)
    return Truth(foot[every], tau[every], at)


def _moved(preset: str, feedforward: str, times: Array) -> tuple[Array, Array]:
    """Return the foot [m] and the torques [N m] of the oracle at some times, (n, 2)."""
    spec = FiveBar.load(preset)
    leg = oracle.Leg.of(spec)
    path = path_of(around_rest(spec))
    if feedforward == "torque":
        # It is on its path, as tests/test_oracle_simulation.py proves: nothing to integrate.
        foot, foot_dot, foot_ddot = (np.array(x) for x in zip(*map(path, times), strict=True))
        return foot, oracle.inverse_dynamics(leg, foot, foot_dot, foot_ddot)

    law = servo_of(gains(preset), feedforward)
    end = RAMP + PERIOD
    motion = oracle_simulation.simulate(leg, law, path, end, times, rtol=RTOL, atol=0.1 * RTOL)
    return motion.foot, motion.tau


def measure(keys: Sequence[Key], nthread: int = 2, device: str | None = None) -> dict[Key, Error]:
    """Return the errors of runs, all of one call simulated together, on a device if named."""
    plans = []
    for key in keys:
        leg = FiveBar.load(key.preset)
        plans.append(rollout.plan(scenario(leg, around_rest(leg), gains(key.preset), key)))
    results = rollout.run_all(plans, nthread, device=device)
    sensed = sensors(plans, nthread)
    timesteps = tuple(sorted({key.timestep for key in keys}))
    return {
        key: _compared(key, result, sensor, timesteps)
        for key, result, sensor in zip(keys, results, sensed, strict=True)
    }


def sensors(plans: Sequence[Plan], nthread: int = 2) -> list[Array]:
    """Return what the actuator force sensors of A and E show in every step [N m], (N, 2) each."""
    found: dict[int, Array] = {}
    for steps in {len(plan.ctrl) for plan in plans}:
        which = [i for i, plan in enumerate(plans) if len(plan.ctrl) == steps]
        chosen = [plans[i] for i in which]
        batch = Batch(chosen[0].model, len(chosen), nthread)
        batch.set_models([plan.model for plan in chosen])
        batch.qpos = np.stack([plan.start for plan in chosen])
        out = batch.rollout(
            steps, np.stack([plan.ctrl for plan in chosen]), record=("actuator_force",)
        )
        found |= dict(zip(which, out["actuator_force"][..., -2:], strict=True))
    return [found[i] for i in range(len(plans))]


def _compared(key: Key, result: Result, sensor: Array, timesteps: Sequence[float]) -> Error:
    known = truth(key.preset, key.feedforward, timesteps)
    record = sampled(result, ROWS.start)
    foot = pair(record, "foot_x", "foot_z")
    tau = pair(record, "torque_A", "torque_E")
    every = round(TIMESTEPS[0] / key.timestep)
    sensor = sensor[every - 1 :: every][ROWS]
    scale = rms(known.tau)
    return Error(
        foot=float(np.sqrt(np.sum(rms(foot - known.foot) ** 2))),
        late=worst(rms(tau - known.tau) / scale),
        start=worst(rms(tau - known.before[key.timestep]) / scale),
        rms=worst(rms(tau) / scale - 1.0),
        sensor=worst(rms(sensor - known.tau) / scale),
        share=abs(share(tau) - share(known.tau)),
        gap=result.metrics["closure"]["max"],
    )


def sampled(result: Result, first: int) -> dict[str, Array]:
    """Return the columns of a record every 2 ms, from row `first` of those on."""
    every = round(TIMESTEPS[0] / result.scenario.sim.timestep)
    return {name: column[every - 1 :: every][first:] for name, column in result.record.items()}


def pair(record: Mapping[str, Array], first: str, second: str) -> Array:
    """Return two columns as pairs, (N, 2)."""
    return np.stack([record[first], record[second]], axis=-1)


def rms(values: Array) -> Array:
    """Return the root of the mean square over the rows."""
    return np.sqrt(np.mean(values**2, axis=0))


def worst(values: Array) -> float:
    """Return the largest size."""
    return float(np.abs(values).max())


def share(tau: Array) -> float:
    """Return A's part of the sum of absolute torques."""
    amount = np.abs(tau).sum(axis=0)
    return float(amount[0] / amount.sum())


def order(errors: Mapping[float, float]) -> float:
    """Return p of error = c h^p, by least squares on the logarithms."""
    slope, _ = np.polyfit(np.log(list(errors)), np.log(list(errors.values())), 1)
    return float(slope)
