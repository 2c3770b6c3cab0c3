"""One step of the physics on a device."""

from __future__ import annotations

from typing import Any

from fivebar_sim.warp.device import mujoco_warp


def take_step(model: Any, data: Any) -> None:
    """Take a step of all legs on the present device.

    MuJoCo Warp 3.17 computes the velocities of bodies after the constraints that need them, for
    J_dot q_dot of the loop: those of the step before were used, or of the one that is taken again.

    Args:
        model: The legs' model on the device.
        data: Their state there.
    """
    mjw = mujoco_warp()
    mjw.kinematics(model, data)
    mjw.com_pos(model, data)
    mjw.com_vel(model, data)

    mjw.step(model, data)
