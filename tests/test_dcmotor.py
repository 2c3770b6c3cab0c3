"""A second opinion on the servo's limit: MuJoCo's own `dcmotor`, fed the voltage of a PWM stage."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.integrator import Integrator

VOLTS = 5.0
H = 1e-3
SERVO = Servo.load("xl330-m288")
GOAL = 2.0
"""The setpoint [rad], far enough for the limit to clip."""


def crank(integrator: Integrator, motor: bool) -> mujoco.MjModel:
    """Return a crank on one joint, driven by the servo's law or by a `dcmotor` of its constants."""
    assert SERVO.kt is not None
    assert SERVO.limit is not None
    assert SERVO.resistance is not None
    spec = mujoco.MjSpec()
    spec.option.timestep = H
    spec.option.gravity = (0.0, 0.0, 0.0)
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    body = spec.worldbody.add_body()
    body.add_geom(size=(0.02, 0.0, 0.0))
    joint = body.add_joint(name="A", type=mujoco.mjtJoint.mjJNT_HINGE, armature=2e-3)
    drive = spec.add_actuator(name="A", trntype=mujoco.mjtTrn.mjTRN_JOINT, target="A")
    if motor:
        volts = int(mujoco.mjtCtrlInput.mjINPUT_VOLTAGE)
        drive.set_to_dcmotor([SERVO.kt, SERVO.kt], SERVO.resistance, ctrlspec=volts)
        return spec.compile()
    drive.set_to_position(kp=SERVO.kp, kv=0.0)
    drive.forcerange = (-SERVO.limit, SERVO.limit)
    drive.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    joint.damping[0] = SERVO.back_emf
    return spec.compile()


def motion(integrator: Integrator, motor: bool) -> Array:
    """Return angle and rate after each step to the setpoint, (N, 2)."""
    assert SERVO.kt is not None
    assert SERVO.resistance is not None
    built = crank(integrator, motor)
    data = mujoco.MjData(built)
    rows = []
    for _ in range(300):
        asked = SERVO.kp * (GOAL - data.qpos[0]) * SERVO.resistance / SERVO.kt
        data.ctrl[0] = np.clip(asked, -VOLTS, VOLTS) if motor else GOAL
        mujoco.mj_step(built, data)
        rows.append((data.qpos[0], data.qvel[0]))
    return np.array(rows)


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_dcmotor_agrees_where_the_voltage_is_at_its_end(integrator: Integrator) -> None:
    ours = motion(integrator, motor=False)
    other = motion(integrator, motor=True)
    assert SERVO.limit is not None
    clipped = int(np.argmax(SERVO.kp * (GOAL - ours[:, 0]) < SERVO.limit))
    assert clipped > 100
    # The presets' numbers are written to eight digits.
    np.testing.assert_allclose(ours[:clipped], other[:clipped], rtol=1e-7)
    after = np.abs(ours[clipped:] - other[clipped:]).max(axis=0)
    if integrator == "implicitfast":
        # Its spring acts with the angle before the step, as the voltage does.
        assert (after < 1e-6).all()
    else:
        # The voltage of a step is late by a part of it: a spring at the step's end is not.
        assert 1e-3 < after[0] < 2e-2
