"""Friction: an independent contact, why `implicitfast` creeps, and the guard that sees it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import oracle
import oracle_coulomb
import oracle_stance
import pytest
import validation_air as air
import validation_friction as friction
import validation_stance as stance
from oracle_coulomb import Floor, touch
from validation_friction import Load

from fivebar_sim import rollout
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import ON_BELT, ON_RAIL, Integrator
from fivebar_sim.metrics.guards import Guards
from fivebar_sim.model import leg_spec, quiet
from fivebar_sim.scenario import Scenario

FLOOR = Floor(0.5, 0.006, 0.8, stiffness=1e4, damping=20.0)
STEPS: dict[Integrator, float] = {"discrete": 1e-3, "implicitfast": 1e-4}
"""Timesteps at which the squat holds [s]."""

BOTH = pytest.mark.parametrize("integrator", STEPS)
CREEPS = ("sim.integrator=implicitfast", "guards.contact=10")

CONVERGED = Load(0.513, 0.2451, 0.2156)
"""Of `treadmill-trot` within its first second, `discrete` at 1/16 ms."""

# the independent contact


def test_springs_press_stick_and_slide() -> None:
    assert touch(FLOOR, -1e-6, 1.0, 1.0, 1.0)[:2] == (0.0, 0.0)
    assert touch(FLOOR, 1e-4, -1.0, 0.0, 0.0).N == 0.0  # the floor does not pull
    sticking = touch(FLOOR, 1e-3, 0.0, 5e-4, 0.01)
    assert sticking == (-(1e4 * 5e-4 + 20.0 * 0.01), 10.0, 0.01, True)
    for way in (-1.0, 1.0):
        sliding = touch(FLOOR, 1e-3, 0.0, way * 1e-3, way * 0.3)
        assert sliding[:2] == (-0.8 * 10.0 * way, 10.0)
        assert not sliding.sticks
        # The spring comes to rest where it has the force of the sliding foot.
        settled = touch(FLOOR, 1e-3, 0.0, way * 8e-4, way * 0.3)
        assert settled.rate == pytest.approx(0.0, abs=1e-12)


def test_without_friction_it_is_the_rigid_floor() -> None:
    """Two models of one stance, one with a constraint and one with a spring."""
    leg = FiveBar.load("classic")
    law = air.servo_of(stance.gains(leg), "velocity")
    path = air.path_of(stance.squat(leg))
    times = stance.GRID[:160]
    floor = Floor(stance.TRUNK, leg.foot_radius, 0.0, stiffness=2e5, damping=60.0)
    soft = oracle_coulomb.simulate(oracle.Leg.of(leg), floor, law, path, times)
    rigid = oracle_stance.Ground(stance.TRUNK, leg.foot_radius)
    known = oracle_stance.simulate(oracle.Leg.of(leg), rigid, law, path, times)
    late = slice(stance.FIRST, None)
    scale = air.rms(known.tau[late])
    assert air.worst(air.rms(soft.tau[late] - known.tau[late]) / scale) < 2e-3
    np.testing.assert_array_equal(soft.ground[:, 0], 0.0)


@BOTH
def test_share_and_torques_are_those_of_dry_friction(integrator: Integrator) -> None:
    """At impratio 100 the foot creeps, which costs 4 % of the share in a single squat."""
    known = friction.coulomb(0.75, 2e5, 60.0)
    found = friction.mujoco(integrator, STEPS[integrator], 0.75)
    np.testing.assert_allclose(found, known, rtol=0.015)
    creeps = friction.mujoco(integrator, STEPS[integrator], 0.75, impratio=100.0)
    assert 0.03 < 1.0 - creeps.share / known.share < 0.06
    assert 0.06 < creeps.E / known.E - 1.0 < 0.10


@pytest.mark.long
def test_stiffer_models_agree_better() -> None:
    """A spring of 2e4 N/m is no better than creep: it gives way where a rigid floor would not."""
    known = friction.coulomb(1.25, 4e6, 300.0)
    hard = friction.mujoco("discrete", 6.25e-5, 1.25, impratio=1e4, hard=True)
    np.testing.assert_allclose(hard, known, rtol=6e-3)
    for integrator, h in STEPS.items():
        np.testing.assert_allclose(friction.mujoco(integrator, h, 1.25), known, rtol=0.03)
        noslip = friction.mujoco(integrator, h, 1.25, noslip=3)
        np.testing.assert_allclose(noslip, known, rtol=0.03)
        creeps = friction.mujoco(integrator, h, 1.25, impratio=100.0)
        assert 0.06 < 1.0 - creeps.share / known.share < 0.09
    assert friction.coulomb(1.25, 2e4, 20.0).share > 1.07 * known.share
    assert friction.coulomb(1.25, 1e6, 100.0).share == pytest.approx(known.share, rel=3e-3)


# how much the softness of the friction costs


def rms_torques(plan: rollout.Plan) -> np.ndarray:
    return np.array(list(rollout.execute(plan).metrics["load"]["torque_rms"].values()))


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "more"), [("treadmill-trot", (1.10, 1.07)), ("doggo-landing", (1.034, 0.966))]
)
def test_faster_friction_changes_the_torques(name: str, more: tuple[float, float]) -> None:
    """What docs/validation.md says: friction of 0.25 ms instead of the 5 ms of leg.xml."""
    scenario = Scenario.load(name, ["limits={}", "sim.timestep=1.25e-4"])
    plan = rollout.plan(scenario)
    spec = leg_spec(
        scenario.leg,
        servo=scenario.servo,
        scene=scenario.scene,
        timestep=scenario.sim.timestep,
        drive=getattr(scenario.controller, "drive", "position"),
    )
    foot = spec.geom("foot")
    pair = spec.add_pair(geomname1="floor", geomname2="foot", condim=3)
    pair.friction = [foot.friction[k] for k in (0, 0, 1, 2, 2)]
    pair.solref = foot.solref
    pair.solimp = foot.solimp
    pair.solreffriction = (2.5e-4, 1.0)
    with quiet():
        fast = plan._replace(model=spec.compile())
    np.testing.assert_allclose(rms_torques(fast) / rms_torques(plan), more, rtol=0.01)


# why implicitfast creeps


def test_contact_and_step_with_one_inertia_do_not_creep() -> None:
    """H kd as armature, taken out of the step: what is solved stays, and the contact knows it."""
    limit = 0.487
    scenario = Scenario.load("treadmill-trot", CREEPS)
    found = rollout.run(scenario).metrics["load"]["share_A"]
    plan = rollout.plan(scenario)
    model = plan.model
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    model.dof_armature[:] += scenario.sim.timestep * model.dof_damping
    alike = rollout.execute(plan).metrics["load"]["share_A"]
    assert abs(alike / limit - 1.0) < 0.04
    assert abs(found / limit - 1.0) > 0.6


# the guard


def guard(name: str, *settings: str) -> float | None:
    """Return the value of the guard, or -1 where the run has none."""
    guards = rollout.run(Scenario.load(name, settings)).metrics["guards"]
    return next((each["value"] for each in guards if each["name"] == "contact"), -1.0)


def test_guard_falls_with_the_timestep_and_only_where_it_must() -> None:
    short = ("duration=0.9", "sim.integrator=implicitfast")
    coarse, fine = (guard("treadmill-trot", *short, f"sim.timestep={h}") for h in (2e-4, 1e-4))
    assert coarse is not None
    assert fine is not None
    assert 0.3 * coarse < fine < 0.55 * coarse
    assert guard("treadmill-trot", "duration=0.9") == -1.0
    assert guard("treadmill-trot", *short, "scene.friction=0") == -1.0
    assert guard("classic-ellipse", *short) == -1.0
    # A torque drive has its damping in the controller, which the step does not know.
    assert guard("doggo-landing", "duration=0.8", short[1]) == 0.0


def errors(timestep: float) -> tuple[float, float]:
    """Return the guard's value and the largest error of share and RMS torques of a short trot."""
    settings = ("limits={}", "duration=1.0", *CREEPS, f"sim.timestep={timestep}")
    found = rollout.run(Scenario.load("treadmill-trot", settings)).measured
    load = found.load
    own = (load.share_A, load.torque_rms.A, load.torque_rms.E)
    value = next(each.value for each in found.guards if each.name == "contact")
    assert value is not None
    return value, float(np.abs(np.array(own) / CONVERGED - 1.0).max())


def test_guard_says_how_wrong_the_torques_are() -> None:
    """A trot on a belt: 38 % wrong at 0.25 ms, 12 % at 0.1 ms, and the guard's value likewise."""
    for timestep, known in ((2.5e-4, 0.38), (1e-4, 0.12)):
        value, error = errors(timestep)
        assert error == pytest.approx(known, rel=0.05)
        assert 0.8 < error / value < 1.3


@pytest.mark.long
def test_default_timestep_on_a_belt_is_right_to_three_percent() -> None:
    value, error = errors(ON_BELT)
    assert error < 0.03
    assert value < Guards().contact


def test_implicitfast_starts_with_a_timestep_that_holds() -> None:
    table = {
        "duration": 0.9,
        "scene": {"kind": "rail", "drop": 1e-6},
        "path": {"kind": "line", "start": [0.0, -0.08], "stop": [0.0, -0.07], "frequency": 2.0},
        "sim": {"integrator": "implicitfast"},
    }

    def step(**changes: object) -> float:
        return Scenario.from_table({"name": "x", **table, **changes}, "x", Path()).sim.timestep

    assert step() == ON_RAIL
    assert step(scene={"kind": "treadmill", "speed": 0.1}) == ON_BELT
    assert step(sim={"integrator": "implicitfast", "timestep": 0.001}) == 0.001
    assert step(sim={}) == 0.001
    assert step(scene="air") == 0.001
    result = rollout.run(Scenario.from_table({"name": "x", **table}, "x", Path()))
    assert [each.name for each in result.measured.guards if not each.ok] == []
