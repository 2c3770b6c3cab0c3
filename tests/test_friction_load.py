"""Friction that changes with speed and load: the models' formulas, and steps that keep to them."""

from __future__ import annotations

import copy
import math
from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fivebar_sim import FiveBar, Scenario, model, run
from fivebar_sim.arrays import Array
from fivebar_sim.control.friction import Friction, FrictionArrays
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError
from fivebar_sim.gym import LegEnv
from fivebar_sim.rollout import Result
from fivebar_sim.simulation.steps import Legs
from fivebar_sim.vector import LegVectorEnv

M6 = Servo.load("xl330-m288").gear
LOADED = ["servo=xl330-m288", "limits={}", "duration=0.4", "path.ramp=0.1", "path.frequency=4.0"]
UNIT = st.floats(-1.0, 1.0)


def m6(t: float, x: float, rate: float) -> float:
    """Return M6 of the paper, by hand."""
    s = math.exp(-((abs(rate) / M6.rate_stribeck) ** M6.alpha))
    square = 0.0
    if t * x < 0.0 or (t == 0.0) != (x == 0.0):
        square = M6.external_quadratic * x * x if abs(x) < abs(t) else M6.motor_quadratic * t * t
    rest = abs(x * M6.external_stribeck - t * M6.motor_stribeck)
    return M6.base + abs(x * M6.external - t * M6.motor) + s * (M6.stribeck + rest + square)


@settings(max_examples=40)
@given(t=UNIT, x=UNIT, rate=st.floats(-20.0, 20.0))
def test_directional_friction_is_the_papers(t: float, x: float, rate: float) -> None:
    got = FrictionArrays.of([M6]).largest(t, x, rate)
    if abs(t) != abs(x):  # the paper's has neither term there
        assert got[0] == pytest.approx(m6(t, x, rate), abs=1e-14)


@settings(max_examples=40)
@given(t=UNIT, x=UNIT, rate=st.floats(-20.0, 20.0))
def test_models_contain_each_other(t: float, x: float, rate: float) -> None:
    """With the same numbers on both sides a directional gear is a loaded one, and so on down."""
    load = Friction(model="load", base=0.01, stribeck=0.02, load=0.1, load_stribeck=0.3)
    both = Friction(
        model="directional",
        **{"base": 0.01, "stribeck": 0.02, "motor": 0.1, "external": 0.1},
        **{"motor_stribeck": 0.3, "external_stribeck": 0.3},
    )
    plain = msgspec.structs.replace(load, model="stribeck", load=0.0, load_stribeck=0.0)
    found = FrictionArrays.of([load, both, plain, Friction(base=0.01)]).largest(t, x, rate)
    assert found[0] == pytest.approx(found[1], abs=1e-15)
    s = math.exp(-abs(rate) / 0.2)
    assert found[2] == pytest.approx(0.01 + s * 0.02)
    assert found[0] - found[2] == pytest.approx((0.1 + 0.3 * s) * abs(x - t))
    assert found[3] == 0.01


def ran(sets: list[str]) -> Result:
    return run(Scenario.load("payload-ellipse", [*LOADED, *sets]))


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_a_turning_gear_resists_as_its_model_says(integrator: str) -> None:
    """About 0.1 N m: where a joint turns, the record's friction is the formula of a step before."""
    result = ran([f"sim.integrator={integrator}"])
    r = result.record
    outer = from_outside(result)
    torque = np.stack([r["torque_A"], r["torque_E"]], axis=1)
    rate = np.stack([r["theta_dot_A"], r["theta_dot_E"]], axis=1)
    got = np.stack([r["friction_A"], r["friction_E"]], axis=1) + M6.viscous * rate
    most = FrictionArrays.of([M6]).largest(torque[:-1], outer[:-1], rate[:-1])
    # Near a reversal the gear sticks, and MuJoCo's discrete step turns friction up to two early.
    side = np.sign(np.concatenate([rate, rate[-1:], rate[-1:]]))
    turns = (side[1:-2] == side[:-3]) & (side[1:-2] == side[2:-1]) & (side[1:-2] == side[3:])
    turns &= np.abs(rate[1:]) > 0.05
    assert turns.mean() > 0.8
    assert np.abs(torque).max() > 0.1
    np.testing.assert_allclose(got[1:][turns], (-np.sign(rate[1:]) * most)[turns], atol=1e-9)
    # Row 1's bound needs the momentum of the step before the record's first row.
    assert (np.abs(got[2:]) <= most[1:] + 1e-9).all()
    assert result.metrics["energy"]["imbalance"] < 1e-5
    assert result.metrics["energy"]["constraints"] < 0.0


def from_outside(result: Result) -> Array:
    """Return the joint torques from outside, from each step's momentum alone (N, 2).

    M (v' - v) / h = torque + friction + outer, with the mass matrix of the open tree.
    """
    scenario = result.scenario
    r = result.record
    built = model.build(scenario.leg, scene=scenario.scene, integrator=scenario.sim.integrator)
    built.dof_armature[[0, 2]] = scenario.leg.armature
    data = mujoco.MjData(built)
    M = np.zeros((4, 4))
    q = np.stack([r[f"theta_{joint}"] for joint in "ABED"], axis=1)
    v = np.stack([r[f"theta_dot_{joint}"] for joint in "ABED"], axis=1)
    outer = np.zeros((len(q), 2))
    for k in range(1, len(q)):
        data.qpos[:] = q[k - 1]
        mujoco.mj_fwdPosition(built, data)
        mujoco.mj_fullM(built, data, M)
        moved = M @ (v[k] - v[k - 1]) / scenario.sim.timestep
        for i, (joint, motor) in enumerate(((0, "A"), (2, "E"))):
            outer[k, i] = moved[joint] - r[f"torque_{motor}"][k] - r[f"friction_{motor}"][k]
    return outer


def test_legs_of_a_batch_are_legs_alone() -> None:
    """With gears, lengths and limits of their own, some with constant friction: the same bits."""
    servo = Servo.load("xl330-m288")
    others = (
        (FiveBar(L2=0.062), servo),
        (
            FiveBar(),
            msgspec.structs.replace(servo, friction=msgspec.structs.replace(M6, motor=0.1)),
        ),
        (FiveBar(), msgspec.structs.replace(servo, friction=0.02, limit=0.1)),
        (FiveBar(), msgspec.structs.replace(servo, friction=0.0)),
    )
    for scene in ("payload", "rail"):
        built = [model.build(leg, servo=each, scene=scene) for leg, each in others]
        start = np.stack([each.key("home").qpos for each in built])
        ctrl = np.stack([np.tile(each.key("home").ctrl, (20, 1)) for each in built])
        ctrl[..., -2:] += 0.5 * np.sin(np.arange(20))[:, None]
        together = Legs(built, start).advance(ctrl)
        for row in range(len(built)):
            alone = Legs(built[row], start[[row]]).advance(ctrl[[row]])
            np.testing.assert_array_equal(together.qpos[row], alone.qpos[0])
            np.testing.assert_array_equal(together.constraint[row], alone.constraint[0])


def test_environments_agree_and_their_copies_go_on() -> None:
    """One leg, one of two, and a copy that was made on the way, after a reset: the same bits."""
    options = {"servo": "xl330-m288", "duration": 1.0}
    alone = LegEnv("track", **options)
    two = LegVectorEnv("track", 2, nthread=1, **options)
    two.reset(seed=[7, 8])
    low = two.episodes.low
    high = two.episodes.high
    for _ in range(3):
        two.step(np.tile(0.6 * low + 0.4 * high, (2, 1)))
    seen = [alone.reset(seed=4)[0], two.reset(seed=[4, 5])[0][0]]
    action = 0.5 * (low + high)
    for k in range(4):
        np.testing.assert_array_equal(*seen)
        if k == 2:
            alone = copy.deepcopy(alone)
        seen = [alone.step(action)[0], two.step(np.stack([action, action]))[0][0]]
    np.testing.assert_array_equal(*seen)


def test_a_small_gear_is_a_large_one_by_the_ratio() -> None:
    """The M077 is the M288 behind less gear, to the digits of its file."""
    large = Servo.load("xl330-m288")
    small = Servo.load("xl330-m077")
    ratio = 77.5 / 288.4
    wanted = large.gear.geared(ratio)
    for name in wanted.__struct_fields__[1:]:
        assert getattr(small.gear, name) == pytest.approx(getattr(wanted, name), rel=1e-7)
    motor = {
        "kt": ratio,
        "limit": ratio,
        "speed": 1.0 / ratio,
        "armature": ratio**2,
        "resistance": 1.0,
    }
    for name, factor in motor.items():
        assert getattr(small, name) == pytest.approx(factor * getattr(large, name), rel=1e-6)
    for servo in (large, small):
        assert servo.limit is not None
        assert servo.kt is not None
        assert servo.resistance is not None
        volts = 5.0
        assert servo.limit == pytest.approx(servo.kt * volts / servo.resistance, rel=1e-6)
        assert servo.speed == pytest.approx(volts / servo.kt, rel=1e-6)


@pytest.mark.parametrize(
    ("sets", "message"),
    [
        (["servo.friction.model=coulomb"], "servo.friction.model must be one of 'constant', "),
        (["servo.friction.bas=1.0"], r"\[servo.friction\]: unknown key 'bas'.*did you mean 'base'"),
        (["servo.friction={model='load', motor=0.1}"], "motor has no use in model 'load'"),
        (["servo.friction.motor=1.5"], r"friction.motor must be in \[0, 1\]"),
        (["servo.friction.base=-1.0"], "friction.base must be in"),
        (["servo.friction=-1.0"], r"servo.friction must be in \[0, inf\) N m"),
    ],
)
def test_refusal(sets: list[str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Scenario.load("payload-ellipse", [*LOADED, *sets])


def test_a_written_scenario_keeps_its_friction() -> None:
    scenario = Scenario.load("payload-ellipse", [*LOADED, "servo.friction.base=0.01"])
    again = Scenario.from_table(scenario.table(), "again", Path())
    assert again.servo.gear == msgspec.structs.replace(M6, base=0.01)
