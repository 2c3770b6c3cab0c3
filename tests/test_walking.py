"""Robots that walk: every leg is a leg alone, every force and torque keeps its law."""

from __future__ import annotations

from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest

from fivebar_sim import Scenario, run
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError, UnreachableError
from fivebar_sim.integrator import Integrator, Sim
from fivebar_sim.paths import Gait as Steps
from fivebar_sim.robots import LEGS, TROT, Air, Gait, Robot
from fivebar_sim.robots.measure import measure
from fivebar_sim.walking import Walk, plan, walk

Q8BOT = Robot.load("q8bot")
STIFF = msgspec.structs.replace(Q8BOT, servo=Servo(kp=8.0, kd=0.05))
STEP = Steps(frequency=4.0, centre=(0.0, -0.044), stride=0.03, lift=0.012, duty=0.6, ramp=0.25)
SPEED = STEP.stance_speed
"""Speed of a robot whose feet do not slip [m/s]."""


@pytest.fixture(scope="module")
def trot() -> Walk:
    return walk(plan(STIFF, Gait(path=STEP, phases=TROT), duration=1.5))


@pytest.fixture(scope="module")
def soft_trot() -> Walk:
    """The robot's own servos, which reach their limit."""
    return walk(plan(Q8BOT, Gait(path=STEP, phases=TROT), duration=1.0))


def test_stiff_trot_goes_straight_at_the_speed_of_its_feet(trot: Walk) -> None:
    assert trot.trunk is not None
    went = measure(trot.trunk, trot.plan.window, STIFF.length, len(trot.falls))
    assert went.speed == pytest.approx(SPEED, rel=0.1)
    assert abs(went.drift) < 0.05 * SPEED
    assert abs(went.turn_rate) < 0.1
    assert went.falls == 0


def test_strides_of_both_signs_turn_it_on_the_spot() -> None:
    """Feet at 36 mm from the middle, left backward and right forward, turn it to the left."""
    strides = {"FL": -1.0, "FR": 1.0, "RL": -1.0, "RR": 1.0}
    turning = walk(plan(STIFF, Gait(path=STEP, phases=TROT, strides=strides), duration=1.5))
    assert turning.trunk is not None
    went = measure(turning.trunk, turning.plan.window, STIFF.length, len(turning.falls))
    assert went.turn_rate > 1.0
    assert abs(went.speed) < 0.1 * SPEED
    assert went.falls == 0


def test_forces_on_the_feet_are_what_moves_the_robot(trot: Walk) -> None:
    """Newton's law for the whole robot, between any two steps: sum of F h = m (v + g t)."""
    mass = STIFF.mass
    h = trot.plan.sim.timestep
    forces = sum(
        np.stack([trot.record[f"{leg}_ground_{axis}"] for axis in "xyz"], axis=-1) for leg in LEGS
    )
    impulse = np.cumsum(forces * h, axis=0)
    moved = np.diff(centre_of_mass(trot), axis=0) / h
    # The mean velocity of a step against that at its end: off by half a step's acceleration.
    momentum = mass * (moved + 9.81 * trot.record["time"][1:, None] * np.array([0.0, 0.0, 1.0]))
    first = 100
    change = momentum - momentum[first]
    given = impulse[1:] - impulse[1:][first]
    assert np.abs(change - given)[first:].max() < 0.02 * mass * 9.81 * 0.25


def centre_of_mass(went: Walk) -> Array:
    """Return where MuJoCo's kinematics has the robot's centre of mass [m], (N, 3)."""
    data = mujoco.MjData(went.plan.model)
    names = ["trunk_x", "trunk_y", "trunk_z", "trunk_qw", "trunk_qx", "trunk_qy", "trunk_qz"]
    names += [f"{leg}_theta_{joint}" for leg in LEGS for joint in "ABED"]
    rows = np.stack([went.record[name] for name in names], axis=-1)
    places = np.empty((len(rows), 3))
    for k, qpos in enumerate(rows):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(went.plan.model, data)
        mujoco.mj_comPos(went.plan.model, data)
        places[k] = data.subtree_com[0]
    return places


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_every_motor_keeps_its_limit(integrator: Integrator) -> None:
    """In every step of all eight: within clip(kp (u - q) - kd v, limit) - (limit / speed) v."""
    sim = Sim(integrator=integrator, timestep=1e-3 if integrator == "discrete" else 1e-4)
    went = walk(plan(Q8BOT, Gait(path=STEP, phases=TROT), duration=0.5, sim=sim))
    servo = Q8BOT.servo
    assert servo.limit is not None
    most = 0.0
    for name in (f"{leg}_{{}}_{motor}" for leg in LEGS for motor in "AE"):
        rate = went.record[name.format("theta_dot")]
        driving = went.record[name.format("torque")] + servo.back_emf * rate
        most = max(most, float(np.abs(driving).max()))
    assert most == pytest.approx(servo.limit, rel=1e-6)


def test_loops_stay_closed(soft_trot: Walk) -> None:
    assert max(soft_trot.record[f"{leg}_gap"].max() for leg in LEGS) < 20e-6


def test_legs_in_the_air_have_the_record_of_a_leg_alone() -> None:
    """Same path, servo and steps as a scenario in the air: targets, feet, commands, torques."""
    gait = Gait(path=STEP, phases=dict.fromkeys(LEGS, 0.0))
    went = walk(plan(Q8BOT, gait, duration=1.0, scene=Air()))
    table = {
        "leg": "q8bot",
        "servo": "xl330",
        "duration": 1.0,
        "path": msgspec.to_builtins(STEP),
        "limits": {"tracking.rms": 1.0},
    }
    scenario = Scenario.from_table({"name": "leg", **table}, "leg", Path())
    alone = run(scenario).record
    assert went.trunk is None
    for leg in LEGS:
        for name in alone.keys() - {"time"}:
            scale = np.abs(alone[name]).max()
            np.testing.assert_allclose(
                went.record[f"{leg}_{name}"], alone[name], atol=1e-7 * scale + 1e-12
            )


def test_robot_that_cannot_stand_falls() -> None:
    """Its mass is beyond the feet of its left legs, so it tips over to the left."""
    off = msgspec.structs.replace(STIFF.trunk, center=(0.0, 0.08, 0.006))
    slow = msgspec.structs.replace(STEP, frequency=1.0)
    robot = msgspec.structs.replace(STIFF, trunk=off)
    went = walk(plan(robot, Gait(path=slow, phases=TROT), duration=1.5))
    assert went.falls[0].time < 0.5
    assert went.falls[0].why.startswith("the trunk touches the floor, leaning")
    assert repr(went).startswith("Walk('q8bot': 1500 steps, fell at 0.")


def test_leg_out_of_reach_is_named() -> None:
    far = msgspec.structs.replace(STEP, stride=0.2)
    strides = {"FL": 0.1, "FR": 0.1, "RL": 1.0, "RR": 0.1}
    with pytest.raises(UnreachableError, match=r"^RL: .*out of reach.* mm"):
        plan(Q8BOT, Gait(path=far, phases=TROT, strides=strides))


def test_run_needs_a_period_to_measure() -> None:
    with pytest.raises(ConfigError, match=r"duration must be at least the ramp of 0\.25 s and one"):
        plan(Q8BOT, Gait(path=STEP, phases=TROT), duration=0.4)


def test_same_plan_has_the_same_bits(soft_trot: Walk) -> None:
    again = walk(soft_trot.plan)
    for name, column in soft_trot.record.items():
        np.testing.assert_array_equal(column, again.record[name])
