"""Hold a robot's trunk level and at its height on a slope, by its joint angles and a noisy IMU.

Run: .venv/bin/python scripts/level_robot.py

The one closed loop over a whole robot: `Level` sees what `fivebar/Walk-v0` observes, and lengthens
each leg until down is down and the mean of the legs' lengths is what it was.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.robots import LEGS, Robot
from fivebar_sim.walking.env import PARTS, WalkEnv

NOISE = 0.02
"""Of a cheap IMU, in each observation: 1 deg/s of the gyroscope, 1 deg of the direction of down."""

SLOPES = (-8.0, -4.0, 0.0, 4.0, 8.0)
"""Of the table [deg]."""


class Level:
    """Length by length, the integral of what is off.

        down' = -gyro x down + trust (seen - down)               complementary filter
        L_i'  = tilt (x_i down_x + y_i down_y) + height (L - mean L)

    x_i, y_i are the hips' places: a nose that is up has down point backward, and shortens the legs
    in front.

    Args:
        robot: The robot.
        period: Time between two actions [s].
    """

    trust = 2.0
    """How fast the seen direction of down corrects the gyroscope's [1/s]."""

    tilt = 3.0
    height = 3.0
    """Gains [1/s]."""

    def __init__(self, robot: Robot, period: float) -> None:
        self._leg = robot.leg
        self._hips = np.array([robot.hips[leg].pos[:2] for leg in LEGS])
        self._period = period
        self._stand = kinematics.hanging(self._leg)[::2]
        self.foot = kinematics.forward(self._leg, self._stand)
        self._longer = np.zeros(len(LEGS))
        self._down = np.array([0.0, 0.0, -1.0])

    def __call__(self, seen: Array) -> Array:
        """Return the motors' angles [rad] for an observation, (4, 2)."""
        parts = dict(zip(PARTS, np.split(seen, np.cumsum([*PARTS.values()])[:-1]), strict=True))
        h = self._period
        turned = -np.cross(parts["gyro"], self._down)
        self._down = self._down + h * (turned + self.trust * (parts["down"] - self._down))

        feet = kinematics.forward(self._leg, parts["theta"].reshape(len(LEGS), 2))
        short = np.mean(feet[:, 1]) - self.foot[1]
        lean = self._hips @ self._down[:2]
        self._longer += h * (self.tilt * lean + self.height * short)

        wanted = np.tile(self.foot, (len(LEGS), 1))
        wanted[:, 1] -= self._longer
        return kinematics.inverse(self._leg, wanted)


def settled(
    slope: float, *, held: bool, seconds: float = 3.0, seed: int = 0
) -> tuple[float, float]:
    """Return pitch of the trunk [rad] and what its legs are too short by [m], in the end.

    Args:
        slope: Of the floor [rad].
        held: Whether `Level` is at work; else the motors stay at their standing angles.
        seconds: How long it stands [s].
        seed: Of the noise.
    """
    robot = Robot.load("q8bot")
    options: dict[str, Any] = {"gyro_noise": NOISE, "down_noise": NOISE, "span": 1.0}
    env = WalkEnv(robot, None, slope=slope, duration=seconds, **options)
    level = Level(robot, env.task.period)
    standing = kinematics.hanging(robot.leg)[::2]
    seen, _ = env.reset(seed=seed)
    over = False

    while not over:
        theta = level(seen) if held else np.tile(standing, (len(LEGS), 1))
        seen, _, fell, over, _ = env.step(((theta - standing) / env.task.span).ravel())
        assert not fell
    lengths = kinematics.forward(robot.leg, env.theta)[:, 1]
    return float(np.arcsin(env.down[0])), float(np.mean(lengths) - level.foot[1])


def main() -> None:
    """Print the table."""
    print("| slope [deg] | motors held: nose up [deg], sunk [mm] | levelled: nose up, sunk |")
    for slope in SLOPES:
        rows = [settled(np.radians(slope), held=held) for held in (False, True)]
        cells = [f"{-np.degrees(pitch):.2f}, {1e3 * sunk:.2f}" for pitch, sunk in rows]
        print(f"| {slope:g} | {cells[0]} | {cells[1]} |", flush=True)


if __name__ == "__main__":
    main()
