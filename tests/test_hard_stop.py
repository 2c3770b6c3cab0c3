"""The stops of the angle at C keep the assembly mode, also of a leg that is thrown at them."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fivebar_sim import FiveBar, kinematics, model
from fivebar_sim.kinematics.stops import angle_at_C


@pytest.mark.parametrize("speed", [20.0, 80.0])
def test_leg_that_is_thrown_straight_does_not_swing_through(speed: float) -> None:
    """A Doggo's leg opens as at take-off, both motors and their rotors at up to 80 rad/s.

    With the 20 ms of MuJoCo's defaults it swings through straight, knees past each other.
    """
    leg = replace(FiveBar.load("doggo"), armature=4e-4)
    foot = (0.0, -0.243)
    slope = kinematics.jacobian(leg, kinematics.inverse(leg, foot))[1]
    thrown = kinematics.joint_motion(leg, foot, (0.0, -speed * 2.0 * abs(slope[0])), (0.0, 0.0))
    built = model.build(leg, timestep=2.5e-4, drive="torque")
    built.opt.gravity[:] = 0.0

    data = mujoco.MjData(built)
    data.qpos[:] = thrown.q
    data.qvel[:] = thrown.q_dot
    assert np.abs(thrown.q_dot[[0, 2]]) == pytest.approx([speed, speed])
    at_C = [angle_at_C(data.qpos[None])[0]]
    for _ in range(200):
        mujoco.mj_step(built, data)
        at_C.append(angle_at_C(data.qpos[None])[0])
    # It is stopped, not held: the angle has grown again.
    assert 0.0 < min(at_C) < 0.05
    assert at_C[-1] > 0.1
