"""The energy balance: against MuJoCo's own energies, as a law of every run, and what it notices."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest
from shipped import shortened

from fivebar_sim import kinematics, model, rollout
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics import energy
from fivebar_sim.metrics.energy import Body, Steps
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenes import Ground, Payload, Rail

PRESETS = tuple(resources.shipped("models/legs"))
INTEGRATORS = ("discrete", "implicitfast")
LANDING = ("rail-landing", "duration=1.2")


def planned(name: str, *settings: str) -> Plan:
    return rollout.plan(Scenario.load(name, ["limits={}", *settings]))


def balance(result: Result) -> dict[str, float]:
    return result.metrics["energy"]


def ran(name: str, *settings: str) -> Result:
    return rollout.execute(planned(name, *settings))


def acted(plan: Plan) -> tuple[Body, Result, Steps]:
    """Return what moved, the run, and what acted besides."""
    (recorder,) = rollout._recorded([plan], 1)
    body = Body(plan.scenario.leg, plan.scenario.payload, plan.scenario.trunk)
    return body, rollout._result(plan, recorder), recorder.unrecorded.steps


# MuJoCo's energies


@pytest.mark.parametrize("preset", PRESETS)
def test_energies_are_mujocos(preset: str, rng: np.random.Generator) -> None:
    """At random states of the open tree: knees anywhere, the loop far from closed."""
    leg = FiveBar.load(preset)
    scenes = [Payload(mass=0.3)]
    if leg.gravity[1] != 0.0:
        scenes.append(Rail(mass=0.7))  # pyright: ignore[reportArgumentType]
    for scene in scenes:
        built = model.build(leg, scene=scene)
        built.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        payload = scene.mass if isinstance(scene, Payload) else 0.0
        trunk = scene.mass if isinstance(scene, Ground) else 0.0
        body = Body(leg, payload, trunk)
        data = mujoco.MjData(built)
        potential = []
        for _ in range(6):
            data.qpos[:] = rng.uniform(-3.0, 3.0, built.nq)
            data.qvel[:] = rng.uniform(-9.0, 9.0, built.nv)
            mujoco.mj_forward(built, data)
            slide = built.nq == 5
            hip, hip_dot = (data.qpos[0], data.qvel[0]) if slide else (0.0, 0.0)
            ours = energy.mechanical(body, (*data.qpos[-4:],), (*data.qvel[-4:],), hip, hip_dot)
            assert ours[0] == pytest.approx(data.energy[1], rel=1e-10)
            potential.append(float(ours[1]) - data.energy[0])
        # MuJoCo's is zero at another height, the same at all poses
        np.testing.assert_allclose(potential, potential[0], atol=1e-12)


def test_foot_rates_are_the_slope_of_the_foot(rng: np.random.Generator) -> None:
    leg = FiveBar.load("extended")
    q = rng.uniform(-3, 3, (50, 4))
    v = rng.uniform(-5, 5, (50, 4))
    step = 1e-6
    ahead, back = (kinematics.chain_points(leg, q + s * step * v).F for s in (1, -1))
    pose = energy.open_pose((*q.T,))
    rates = energy.foot_rates(leg, pose, v[:, 0], v[:, 0] + v[:, 1])
    np.testing.assert_allclose(np.stack(rates, -1), (ahead - back) / (2 * step), atol=1e-8)


# the law


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(
    "name", ["classic-ellipse", "payload-ellipse", "rail-landing", "treadmill-trot"]
)
def test_balance_closes_and_shrinks_with_the_step(name: str, integrator: str) -> None:
    """What is left is of second order of the step."""
    coarse, fine = (
        balance(ran(name, "duration=0.8", f"sim.timestep={h}", f"sim.integrator={integrator}"))
        for h in (5e-4, 1.25e-4)
    )
    assert 0.0 < coarse["imbalance"] < 1e-5
    assert fine["imbalance"] < 0.15 * coarse["imbalance"]


def test_force_on_the_foot_does_its_work() -> None:
    force = ("force={kind='constant', value=[1.0, -2.0]}", "scene.mass=0.1", "duration=1.2")
    result = ran("payload-ellipse", *force)
    found = balance(result)
    foot = np.stack([result.record["foot_x"], result.record["foot_z"]], axis=-1)
    # a constant force: its work is what it pushes the foot from start to end
    pushed = foot[-1] - result.scenario.foot_path[0]
    assert found["force"] == pytest.approx(pushed @ [1.0, -2.0], rel=5e-3)
    assert found["force"] > 5e-3
    assert found["imbalance"] < 1e-3


def test_a_landing_loses_its_energy_in_motors_and_ground() -> None:
    """5 cm and the squat: what trunk and leg fall by; the loop takes next to none of it."""
    found = balance(ran(*LANDING))
    assert found["potential"] == pytest.approx(-0.26, rel=0.02)
    assert found["kinetic"] == pytest.approx(0.0, abs=1e-5)
    assert found["motor"] + found["ground"] == pytest.approx(found["potential"], rel=1e-3)
    assert found["motor"] < -0.1
    assert found["ground"] < -0.05
    assert abs(found["constraints"]) < 1e-3 * abs(found["ground"])


def test_gear_friction_takes_its_part() -> None:
    """Coulomb's: friction times the way that the motors turn."""
    result = ran("classic-ellipse", "servo.friction=0.01", "duration=2.25")
    turned = sum(np.abs(np.diff(result.record[f"theta_{motor}"])).sum() for motor in "AE")
    assert balance(result)["constraints"] == pytest.approx(-0.01 * turned, rel=0.02)


def test_a_leg_that_walks_drives_its_belt() -> None:
    """What the ground takes is what the belt gets, and what is lost by sliding and sinking in."""
    result = ran("treadmill-trot")
    speed = result.scenario.scene.speed  # pyright: ignore[reportAttributeAccessIssue]
    to_belt = speed * float(result.record["ground_x"].sum()) * 1e-3  # it moves towards -x
    found = balance(result)
    assert to_belt > 0.1
    assert 0.0 < -found["ground"] - to_belt < 0.02 * found["turnover"]
    assert found["motor"] > to_belt


def test_a_leg_at_rest_has_no_balance() -> None:
    hold = "path={kind='line', start=[0,-0.08], stop=[0,-0.08], frequency=1, ramp=0}"
    found = balance(ran("classic-ellipse", hold, "leg.gravity=[0,0]", "duration=1"))
    assert found["turnover"] < 1e-9
    assert found["imbalance"] is None


def test_a_wrong_torque_is_noticed_however_little_is_at_stake() -> None:
    """A foot that moves by micrometres without gravity turns far less than 1 nJ over."""
    small = ("path.radii=[1e-6,1e-6]", "path.frequency=1", "leg.gravity=[0,0]", "duration=1.5")
    body, result, steps = acted(planned("classic-ellipse", *small))
    right = energy.balance(body, result.record, steps)
    assert 0.0 < right.turnover < 1e-10
    assert right.imbalance is not None
    assert right.imbalance < 1e-3
    off = {**result.record, "torque_A": 1.1 * result.record["torque_A"]}
    wrong = energy.balance(body, off, steps).imbalance
    assert wrong is not None
    assert wrong > 1e-3


# what it notices


EVERY = (
    *("classic-ellipse", "airhockey-gain-schedule", "doggo-fast-ellipse"),
    *("extended-figure-eight", "minitaur-trot", "q8bot-trot", "rail-landing"),
)


@pytest.mark.parametrize("name", EVERY)
def test_a_torque_ten_percent_off_is_noticed(name: str) -> None:
    """Of every preset, and in a landing: the balance is 1e-3 of the turnover wrong, or more."""
    plan = planned(name, f"duration={shortened(name).duration}")
    body, result, steps = acted(plan)
    assert result.verdict == "not judged"
    for column in ("torque_A", "torque_E"):
        off = {**result.record, column: 1.1 * result.record[column]}
        wrong = energy.balance(body, off, steps).imbalance
        assert wrong is not None, column
        assert wrong > plan.scenario.guards.energy, column


def test_a_wrong_mass_trunk_or_rotor_is_noticed() -> None:
    body, result, steps = acted(planned(*LANDING))
    for changed in (
        dataclasses.replace(body, payload=0.02),
        dataclasses.replace(body, trunk=1.05 * body.trunk),
    ):
        wrong = energy.balance(changed, result.record, steps).imbalance
        assert wrong is not None
        assert wrong > 0.01
    body, result, steps = acted(planned("classic-ellipse", "duration=1"))
    light = dataclasses.replace(body.leg, armature=0.5 * body.leg.armature)
    wrong = energy.balance(dataclasses.replace(body, leg=light), result.record, steps).imbalance
    assert wrong is not None
    assert wrong > 0.01


def test_a_forgotten_constraint_is_noticed() -> None:
    body, result, steps = acted(planned("classic-ellipse", "servo.friction=0.01", "duration=1"))
    wrong = energy.balance(body, result.record, steps._replace(constraint=0.0 * steps.constraint))
    assert wrong.imbalance is not None
    assert wrong.imbalance > 0.5


def test_slow_foot_under_a_trunk_is_no_false_alarm() -> None:
    """Half a kilogram stands while the foot goes to and fro by 12 mm in 4 s: little work is done.

    The loop of `implicitfast` gives a millijoule while the trunk settles, but what carries the
    trunk afterwards is what `discrete` gives, whose loop gives nothing.
    """
    slow = (
        *("path={kind='line', start=[-0.006,-0.08], stop=[0.006,-0.08], frequency=0.25}",),
        *("path.ramp=0.25", "duration=4.25", "scene={kind='rail', mass=0.5, friction=0}"),
    )
    runs = [ran("classic-ellipse", *slow, f"sim.integrator={i}") for i in INTEGRATORS]
    assert [run.verdict for run in runs] == ["not judged", "not judged"]
    for motor in "AE":
        exact, loose = (run.metrics["load"]["torque_rms"][motor] for run in runs)
        assert loose == pytest.approx(exact, rel=1e-5)
