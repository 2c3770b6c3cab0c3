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

from fivebar_sim import rollout
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import ON_GROUND, Integrator
from fivebar_sim.metrics import contact
from fivebar_sim.scenario import Scenario

FLOOR = Floor(0.5, 0.006, 0.8, stiffness=1e4, damping=20.0)
STEPS: dict[Integrator, float] = {"discrete": 1e-3, "implicitfast": ON_GROUND}
"""The default timesteps on a ground [s]."""

BOTH = pytest.mark.parametrize("integrator", STEPS)
CREEPS = ("sim.integrator=implicitfast", "guards.contact=10")

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


@pytest.mark.parametrize("preset", ["classic", "minitaur"])
def test_shortfall_is_what_the_step_takes_from_the_contact(preset: str) -> None:
    """The oracle's 1 / M, column by column: accelerations of unit torques at rest."""
    leg = FiveBar.load(preset)
    known = oracle.Leg.of(leg)
    theta = np.array([[-2.2, -0.9], [-2.1, -1.2]])
    inverse = []
    for pair in theta.tolist():
        psi = oracle.closed(known, *pair)
        rest, left, right = (
            np.array(oracle.forward_dynamics(known, psi, [0.0] * 4, tau)[0])[[0, 3]]
            for tau in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
        )
        inverse.append(np.stack([left - rest, right - rest]))
    record = {
        "time": np.array([1e-3, 2e-3]),
        "theta_A": theta[:, 0],
        "theta_E": theta[:, 1],
        "ground_z": np.array([1.0, 0.0]),
    }
    found = contact.shortfall(leg, record, 0.05)
    assert found is not None
    largest = np.abs(np.linalg.eigvals(inverse[0])).max()
    assert found[0] == pytest.approx(1e-3 * 0.05 * largest, rel=1e-6)
    assert found[1] == 0.0  # in the air nothing creeps


def guard(name: str, *settings: str) -> float | None:
    """Return the value of the guard, or -1 where the run has none."""
    guards = rollout.run(Scenario.load(name, settings)).metrics["guards"]
    return next((each["value"] for each in guards if each["name"] == "contact"), -1.0)


def test_guard_falls_with_the_timestep_and_only_where_it_must() -> None:
    short = ("duration=0.9", "sim.integrator=implicitfast")
    coarse, fine = (guard("treadmill-trot", *short, f"sim.timestep={h}") for h in (1e-3, 5e-4))
    assert coarse is not None
    assert fine == pytest.approx(0.5 * coarse, rel=0.02)
    assert guard("treadmill-trot", "duration=0.9") == -1.0
    assert guard("treadmill-trot", *short, "scene.friction=0") == -1.0
    assert guard("classic-ellipse", *short) == -1.0
    # A torque drive has its damping in the controller, which the step does not know.
    assert guard("doggo-landing", "duration=0.8", short[1]) == 0.0


def test_implicitfast_starts_with_a_timestep_that_holds() -> None:
    table = {
        "duration": 0.9,
        "scene": {"kind": "rail", "drop": 1e-6},
        "path": {"kind": "line", "start": [0.0, -0.08], "stop": [0.0, -0.07], "frequency": 2.0},
        "sim": {"integrator": "implicitfast"},
    }

    def step(**changes: object) -> float:
        return Scenario.from_table({"name": "x", **table, **changes}, "x", Path()).sim.timestep

    assert step() == ON_GROUND
    assert step(sim={"integrator": "implicitfast", "timestep": 0.001}) == 0.001
    assert step(sim={}) == 0.001
    assert step(scene="air") == 0.001
    result = rollout.run(Scenario.from_table({"name": "x", **table}, "x", Path()))
    assert [each.name for each in result.measured.guards if not each.ok] == []
