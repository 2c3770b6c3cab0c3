"""The step itself: what the integrator applied, batches, and what a broken run says."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from fivebar_sim import rollout
from fivebar_sim.errors import ArgumentError, DivergedError
from fivebar_sim.rollout import Plan
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import steps
from fivebar_sim.simulation.steps import States

INTEGRATORS = ("discrete", "implicitfast")


def planned(*settings: str) -> Plan:
    return rollout.plan(Scenario.load("classic-ellipse", settings))


def balance(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Return the generalised force that each step's momentum asks for, and the recorded torque.

    M (v+ - v) / h + bias - constraint force, with M and bias at the start of the step, and the
    constraint force that the solver found in it.
    """
    h = plan.motion.timestep
    mj = plan.model
    states = simulated(plan)
    q, v, force = (field[0] for field in (states.qpos, states.qvel, states.constraint))
    before_q, before_v = (
        np.concatenate([first[None], rows[:-1]])
        for first, rows in ((plan.motion.q[0], q), (np.zeros(4), v))
    )
    data = mujoco.MjData(mj)
    M = np.zeros((4, 4))
    needed = np.empty_like(v)
    for k in range(len(v)):
        data.qpos[:] = before_q[k]
        data.qvel[:] = before_v[k]
        mujoco.mj_forward(mj, data)
        mujoco.mj_fullM(mj, data, M)
        needed[k] = M @ (v[k] - before_v[k]) / h + data.qfrc_bias - force[k]
    record = rollout.execute(plan).record
    torque = np.zeros_like(needed)
    torque[:, 0] = record["torque_A"]
    torque[:, 2] = record["torque_E"]
    return needed, torque


@pytest.mark.parametrize("limit", [None, 0.05, 0.00283])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_torque_balances_momentum_at_every_step(integrator: str, limit: float | None) -> None:
    settings = [f"sim.integrator={integrator}", "duration=0.35", "path.ramp=0.1"]
    settings += ["path.frequency=4.0"]
    settings += [f"servo.limit={limit}"] if limit else []
    plan = planned(*settings)
    needed, torque = balance(plan)
    # rounding: M v / h and the constraint force, tens of times the torque, cancel in the balance
    np.testing.assert_allclose(needed, torque, rtol=0, atol=1e-9 * np.abs(torque).max())
    clips = np.abs(torque[:, [0, 2]]) == limit
    assert clips.any() == (limit == 0.00283)


def simulated(plan: Plan) -> States:
    return steps.simulate(plan.model, plan.motion.q[:1], plan.ctrl[None])


def test_raw_sensor_is_not_the_torque() -> None:
    """The actuator sensor misses what the integrator adds: the reason for `applied_torque`."""
    plan = planned("duration=0.75")
    batch = Batch(plan.model, 1, 1)
    batch.qpos = plan.motion.q[:1]
    raw = batch.rollout(750, plan.ctrl[None], record=("actuator_force",))["actuator_force"][0]
    torque = rollout.execute(plan).record["torque_A"]
    assert np.sqrt(np.mean((raw[:, 0] - torque) ** 2)) > 10 * np.sqrt(np.mean(torque**2))


def test_batch_is_bit_identical_to_one_by_one() -> None:
    legs = [
        planned("duration=0.35", "path.ramp=0.1",
                f"leg.L2={0.055 + 0.001 * i}", f"path.frequency={4 + 0.05 * i}",
                f"servo.kp={6.0 + 0.1 * i}", f"sim.integrator={INTEGRATORS[i % 2]}")
        for i in range(10)
    ]  # fmt: skip
    every = [rollout.execute(plan) for plan in legs]
    for nthread in (1, 2):
        for alone, result in zip(every, rollout.run_all(legs, nthread), strict=True):
            assert result.scenario is alone.scenario
            for name, column in result.record.items():
                np.testing.assert_array_equal(column, alone.record[name], err_msg=name)


def test_batch_is_bit_identical_to_a_plain_loop() -> None:
    plan = planned("duration=1.0")
    states = simulated(plan)
    data = mujoco.MjData(plan.model)
    data.qpos[:] = plan.motion.q[0]
    for k, u in enumerate(plan.ctrl):
        data.ctrl[:] = u
        mujoco.mj_step(plan.model, data)
        np.testing.assert_array_equal(states.qpos[0, k], data.qpos)
        np.testing.assert_array_equal(states.qvel[0, k], data.qvel)


def test_chunks_give_the_bits_of_one_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = planned("duration=1.0")
    whole = simulated(plan)
    monkeypatch.setattr(steps, "CHUNK", 77)
    for one, other in zip(whole, simulated(plan), strict=True):
        np.testing.assert_array_equal(one, other)


def test_refusal_of_setpoints_that_are_not_finite() -> None:
    plan = planned()
    ctrl = plan.ctrl.copy()
    ctrl[7, 1] = np.nan
    with pytest.raises(ArgumentError, match="ctrl must be finite"):
        steps.simulate(plan.model, plan.motion.q[:1], ctrl[None])
    with pytest.raises(ArgumentError, match=r"qpos must have shape \(nsim, 4\), got \(1, 3\)"):
        steps.simulate(plan.model, plan.motion.q[:1, :3], plan.ctrl[None])
    with pytest.raises(ArgumentError, match=r"ctrl must have shape \(1, N, 2\)"):
        steps.simulate(plan.model, plan.motion.q[:1], ctrl)


def states(**changes: np.ndarray) -> States:
    """Return ten good steps of 1 ms, with changes."""
    good = States(
        time=np.arange(1.0, 11.0)[None] * 1e-3,
        qpos=np.zeros((1, 10, 4)),
        qvel=np.zeros((1, 10, 4)),
        ctrl=np.zeros((1, 10, 2)),
        ground=np.zeros((1, 10, 0)),
        constraint=np.zeros((1, 10, 4)),
        iterations=np.ones((1, 10)),
        warnings=np.zeros(1, dtype=int),
    )
    steps.check_states(good, 1e-3)
    return good._replace(**changes)


def test_refusal_of_each_breakdown() -> None:
    spoilt = np.zeros((1, 10, 4))
    spoilt[0, 4, 2] = np.nan
    fast = np.zeros((1, 10, 4))
    fast[0, 6, 0] = 2e4
    stuck = np.minimum(np.arange(1, 11), 3)[None] * 1e-3
    for bad, time in (
        (states(qpos=spoilt), 0.005),
        (states(qvel=spoilt), 0.005),
        (states(qvel=fast), 0.007),
        (states(time=stuck), 0.004),
        (states(warnings=np.array([2])), 0.010),
    ):
        with pytest.raises(DivergedError) as caught:
            steps.check_states(bad, 1e-3)
        assert caught.value.time == pytest.approx(time)
