"""A robot's model: the same leg four times, and nothing of a leg lost by being attached."""

from __future__ import annotations

from typing import Any

import msgspec
import mujoco
import numpy as np
import pytest

from fivebar_sim import dynamics, kinematics, model
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import MotorStep, Servo, applied_torque
from fivebar_sim.errors import ArgumentError
from fivebar_sim.integrator import Integrator
from fivebar_sim.robots import LEGS, Air, Floor, Hip, Robot
from fivebar_sim.scenario import scenes
from fivebar_sim.simulation.steps import simulate

Q8BOT = Robot.load("q8bot")
STIFF = Servo(kp=20.0, kd=0.02)
"""Holds the robot within a tenth of a degree."""

STEPS = 400


def swinging(robot: Robot, steps: int) -> Array:
    """Return setpoints of A and E that swing about the rest pose, (N, 2)."""
    t = 1e-3 * np.arange(steps)[:, None]
    rest = kinematics.hanging(robot.leg)[[0, 2]]
    return rest + 0.3 * np.sin(2.0 * np.pi * np.array([3.0, 2.0]) * t)


@pytest.mark.parametrize("servo", [Q8BOT.servo, STIFF], ids=["xl330", "stiff"])
@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_legs_of_a_held_trunk_move_as_one_alone(servo: Servo, integrator: Integrator) -> None:
    robot = msgspec.structs.replace(Q8BOT, servo=servo)
    # One leg turned round: its plane is the same, seen from the other side.
    hips = {**robot.hips, "RL": Hip(pos=robot.hips["RL"].pos, mirrored=True)}
    robot = msgspec.structs.replace(robot, hips=hips)
    ctrl = swinging(robot, STEPS)
    q = kinematics.hanging(robot.leg)

    alone = simulate(
        model.build(robot.leg, servo=servo, integrator=integrator), q[None], ctrl[None]
    )
    four = simulate(
        model.build_robot(robot, Air(), integrator=integrator),
        np.tile(q, 4)[None],
        np.tile(ctrl, 4)[None],
    )

    torque = applied(servo, integrator, ctrl, q, alone.qpos[0], alone.qvel[0])
    for k in range(4):
        joints = slice(4 * k, 4 * k + 4)
        qpos = four.qpos[0, :, joints]
        qvel = four.qvel[0, :, joints]
        np.testing.assert_allclose(qpos, alone.qpos[0], atol=1e-9)
        same = applied(servo, integrator, ctrl, q, qpos, qvel)
        assert np.abs(same - torque).max() < 1e-6 * np.abs(torque).max()


def applied(servo: Servo, integrator: Integrator, ctrl: Array, q: Array, *moved: Array) -> Array:
    """Return the torques of the motors in each step [N m], (N, 2)."""
    qpos, qvel = (values[:, ::2] for values in moved)
    before = np.concatenate([q[None, ::2], qpos[:-1]])
    step = MotorStep(integrator, ctrl, before, qpos, qvel, "position")
    return applied_torque(servo, step)


def test_standing_robot_weighs_what_it_weighs() -> None:
    """The floor carries the weight; each motor holds what virtual work says it must."""
    # One diagonal pair of legs is farther from the middle than the other: the load is not even.
    hips = {**Q8BOT.hips, "FL": Hip(pos=(0.055, 0.036, 0.0)), "RR": Hip(pos=(-0.050, -0.036, 0.0))}
    robot = msgspec.structs.replace(Q8BOT, servo=STIFF, hips=hips)
    # Without friction the legs cannot push against each other, and forces are vertical.
    built = model.build_robot(robot, Floor(friction=0.0))
    key = built.key("stand")
    steps = 1500
    ctrl = np.broadcast_to(key.ctrl, (1, steps, 8))
    states = simulate(built, key.qpos[None], ctrl)

    forces = floor_forces(built, states.qpos[0, -1], states.qvel[0, -1], key.ctrl)
    assert forces[:, 2].sum() == pytest.approx(9.81 * robot.mass, rel=1e-3)
    np.testing.assert_allclose(forces[:, :2], 0.0, atol=1e-3 * 9.81 * robot.mass)
    assert forces[:, 2].max() > 1.05 * forces[:, 2].min()

    joints = states.qpos[0, -1, 7:].reshape(4, 4)
    held = robot.servo.kp * (key.ctrl.reshape(4, 2) - joints[:, ::2])
    for force, q, torque in zip(forces, joints, held, strict=True):
        foot_force = force[[0, 2]]
        theta = q[::2]
        by_hand = dynamics.LegDynamics(robot.leg).bias(theta, np.zeros(2))
        by_hand = by_hand - kinematics.jacobian(robot.leg, theta).T @ foot_force
        np.testing.assert_allclose(torque, by_hand, rtol=1e-2)


def floor_forces(built: mujoco.MjModel, qpos: Array, qvel: Array, ctrl: Array) -> Array:
    """Return the forces of the floor on the feet in a state [N], world axes, (4, 3)."""
    data = mujoco.MjData(built)
    data.qpos[:] = qpos
    data.qvel[:] = qvel
    data.ctrl[:] = ctrl
    mujoco.mj_forward(built, data)
    sensors = [data.sensor(f"{name}_ground").data for name in LEGS]
    assert all(sensor[0] == 1.0 for sensor in sensors)
    return np.array([sensor[1:] for sensor in sensors])


@pytest.mark.parametrize("scene", [Air(), Floor()], ids=["air", "floor"])
@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_attached_legs_keep_every_option_and_name(
    scene: Air | Floor, integrator: Integrator
) -> None:
    built = model.build_robot(Q8BOT, scene, integrator=integrator, timestep=5e-4)
    alone = model.build(Q8BOT.leg, servo=Q8BOT.servo, integrator=integrator, timestep=5e-4)

    for option in dir(alone.opt):
        if not option.startswith("_"):
            np.testing.assert_array_equal(getattr(built.opt, option), getattr(alone.opt, option))

    for name in LEGS:
        for joint in "ABED":
            one = built.joint(f"{name}_{joint}")
            two = alone.joint(joint)
            for field in ("range", "armature", "damping", "frictionloss", "qpos0"):
                np.testing.assert_array_equal(getattr(one, field), getattr(two, field))
        for motor in "AE":
            one = built.actuator(f"{name}_{motor}")
            two = alone.actuator(motor)
            for field in ("gainprm", "biasprm", "forcerange"):
                np.testing.assert_array_equal(getattr(one, field), getattr(two, field))
        loop = built.equality(f"{name}_C")
        np.testing.assert_array_equal(loop.solref, alone.equality("C").solref)
        assert built.tendon(f"{name}_C_angle").id >= 0

    motors = [f"{name}_{motor}" for name in LEGS for motor in "AE"]
    assert [built.actuator(i).name for i in range(built.nu)] == motors


def test_keyframe_closes_the_loops_with_a_foot_on_the_floor() -> None:
    low = {**Q8BOT.hips, "FR": Hip(pos=(0.040, -0.036, -0.005))}
    robot = msgspec.structs.replace(Q8BOT, hips=low)
    built = model.build_robot(robot)
    data = mujoco.MjData(built)
    mujoco.mj_resetDataKeyframe(built, data, 0)
    mujoco.mj_forward(built, data)

    for name in LEGS:
        gap = data.site(f"{name}_C_left").xpos - data.site(f"{name}_C_right").xpos
        np.testing.assert_allclose(gap, 0.0, atol=1e-12)
    heights = [data.site(f"{name}_foot").xpos[2] - robot.leg.foot_radius for name in LEGS]
    np.testing.assert_allclose(heights, [0.005, 0.0, 0.005, 0.005], atol=1e-12)


def test_mass_and_inertia_are_the_robots() -> None:
    built = model.build_robot(Q8BOT)
    assert built.body_mass.sum() == pytest.approx(0.220, rel=1e-12)
    trunk = built.body("trunk")
    np.testing.assert_allclose(trunk.ipos, Q8BOT.trunk.center)
    # A slab of 12 x 5.6 x 3.4 cm, about its middle.
    length, width, height = np.square([0.120, 0.056, 0.034])
    squares = [width + height, length + height, length + width]
    np.testing.assert_allclose(
        np.sort(trunk.inertia), np.sort(Q8BOT.trunk_mass / 12.0 * np.array(squares)), rtol=1e-9
    )


@pytest.mark.parametrize("scene", [scenes.Rail(), "floor"])
def test_scene_of_a_leg_is_refused(scene: Any) -> None:
    with pytest.raises(ArgumentError, match=r"scene must be robots\.Air\(\) or robots\.Floor\(\)"):
        model.build_robot(Q8BOT, scene)
