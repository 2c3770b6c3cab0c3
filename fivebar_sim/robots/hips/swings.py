"""What the motors of all hips do in a gait: the angle of each at any time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError
from fivebar_sim.paths import FootPath
from fivebar_sim.paths.base import ease, times
from fivebar_sim.robots.hips.motors import HipMotor, SideStep
from fivebar_sim.robots.hips.sideways import Sideways
from fivebar_sim.robots.robot import LEGS, Robot


def swings(
    robot: Robot, paths: Mapping[str, FootPath], steering: Mapping[str, float], time: Array
) -> Array:
    """Return the angles of the motors of all hips [rad], (N, 4, m), those of a leg as in its hip.

    S follows its foot's way to the side; T turns, while the gait begins, to where its leg is
    steered.

    Args:
        robot: The robot.
        paths: The path of each foot.
        steering: Where each leg is steered [rad].
        time: Of the run [s], (N,).

    Raises:
        ConfigError: One would turn too far; says which leg's, when and by how much.
    """
    motors = robot.hips[LEGS[0]].motors
    found = np.empty((len(time), len(LEGS), len(motors)))
    for i, leg in enumerate(LEGS):
        path = paths[leg]
        for k, motor in enumerate(motors):
            if isinstance(path, Sideways) and isinstance(motor, SideStep):
                found[:, i, k] = path.swing(time)
            else:
                found[:, i, k] = steering[leg] * ease(times(time, path.end), path.ramp)[1]
            _check_reach(leg, motor, found[:, i, k], time)
    return found


def _check_reach(leg: str, motor: HipMotor, angle: Array, time: Array) -> None:
    """Raise if a motor would turn too far."""
    far = np.abs(angle) > motor.most
    if far.any():
        k = int(np.argmax(far))
        raise ConfigError(
            f"{leg}: theta_{motor.letter} must be in [{-motor.most:g}, {motor.most:g}] rad, "
            f"hips.{motor.key}.most, got {angle[k]:g} rad at t = {time[k]:g} s"
        )
