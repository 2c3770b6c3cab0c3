"""An episode of one robot: actions in, observation, reward and end out; no physics."""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import MotorStep, applied_torque
from fivebar_sim.control.step import ControlStep
from fivebar_sim.errors import ArgumentError
from fivebar_sim.metrics.columns import MOTOR_JOINTS
from fivebar_sim.robots import LEGS, Robot
from fivebar_sim.robots.measure import Trunk, falls
from fivebar_sim.robots.places import rotation
from fivebar_sim.walking.task import Moved, WalkTask

PARTS = {"command": 2, "gyro": 3, "down": 3, "theta": 8, "theta_dot": 8, "action": 8}
"""What an observation is made of, and how many numbers each is."""

TERMS = ("speed", "turn", "effort")
"""What a reward is made of."""

MOTORS = [4 * leg + joint for leg in range(len(LEGS)) for joint in MOTOR_JOINTS]
"""Where the motors are among the joints of all legs."""

ROUNDING = 4.0 * float(np.finfo(np.float32).eps)
"""What a network's float32 may leave of an action beyond 1."""


class Period(NamedTuple):
    """What came of a control period.

    Attributes:
        observation: What the robot knows.
        terms: Terms of the reward, weighted.
        terminated: Whether it fell, or the simulation broke down.
        truncated: Whether the episode's duration is over.
        reason: Why it ended, "" if it did not.
    """

    observation: Array
    terms: dict[str, float]
    terminated: bool
    truncated: bool
    reason: str

    @property
    def reward(self) -> float:
        """Sum of the terms."""
        return sum(self.terms.values())


class Episode:
    """An episode of one robot.

    Args:
        task: The task.
        robot: The robot of this episode.
        model: Its model.
        random: Draws the sensors' seeds, the command and the noise of the observations.

    Attributes:
        wanted: Speed [m/s] and turning rate [rad/s] that are commanded, (2,).
        qpos: What MuJoCo had after each step of the last period, (n, nq).
    """

    def __init__(
        self, task: WalkTask, robot: Robot, model: mujoco.MjModel, random: np.random.Generator
    ) -> None:
        self._task = task
        self._robot = robot
        self._random = random
        start = model.key("stand").qpos.copy()
        self._standing = start[7:][MOTORS].reshape(len(LEGS), 2)
        gravity = model.opt.gravity
        self._gravity = gravity / np.linalg.norm(gravity)
        self._control = ControlStep(
            robot.servo,
            task.sensors,
            "position",
            timestep=task.timestep,
            every=task.every,
            steps=task.periods * task.every,
            start=self._standing,
            seeds=random.integers(2**31, size=len(LEGS)).tolist(),
        )

        self._k = 0
        self.qpos = start[None]
        self._qvel = np.zeros((1, model.nv))
        self._action = np.zeros(len(MOTORS))
        self._ctrl = np.tile(start[7:][MOTORS], (task.every, 1))
        low, high = np.array([task.speed, task.turn]).T
        self.wanted = random.uniform(low, high)

    @property
    def down(self) -> Array:
        """Direction of gravity in the trunk's frame, without noise, (3,)."""
        # It leans where the floor rises: the world's axes are the floor's.
        return self._gravity @ rotation(self.qpos[-1:, 3:7])[0]

    @property
    def theta(self) -> Array:
        """Angles of the motors, without noise [rad], (4, 2)."""
        return self.qpos[-1, 7:][MOTORS].reshape(len(LEGS), 2)

    @property
    def held(self) -> Array:
        """What reached the motors last, which a robot whose episode is over keeps, (every, 8)."""
        return self._ctrl

    def commands(self, action: Array) -> Array:
        """Return what reaches the motors in each step of the next period [rad], (every, 8).

        Args:
            action: A checked action, (8,).
        """
        self._action = action
        task = self._task
        command = self._standing + task.span * action.reshape(len(LEGS), 2)
        sent = self._control.send(self._k, command)
        self._ctrl = np.concatenate([*sent], axis=-1)
        return self._ctrl

    def update(self, qpos: Array, qvel: Array, *, sound: bool) -> Period:
        """Return what came of a period.

        Args:
            qpos: MuJoCo's coordinates after each step, (every, nq).
            qvel: Their rates, (every, nv).
            sound: Whether the simulation did not break down.
        """
        task = self._task
        before = self.qpos[-1:]
        self._k += task.every
        # Agents must never see NaN: they are shown the state of the period before.
        if not sound:
            return Period(self.observe(), dict.fromkeys(TERMS, 0.0), True, False, "diverged")

        self.qpos = qpos.copy()
        self._qvel = qvel.copy()
        seen = (self.qpos[:, 7:][:, MOTORS], self._qvel[:, 6:][:, MOTORS])
        self._control.moved(*(np.moveaxis(part.reshape(-1, len(LEGS), 2), 1, 0) for part in seen))
        trunk = self._trunk(before)
        moved = Moved.of(trunk, self._robot.length)
        terms = task.terms(self.wanted, moved, self._torque(before))
        box = self._robot.trunk
        fell = falls(trunk, box.size, np.array(box.center))
        over = self._k >= task.periods * task.every
        return Period(self.observe(), terms, bool(fell), over, fell[0].why if fell else "")

    def observe(self) -> Array:
        """Return what the robot knows now; the noise is drawn anew."""
        seen = self._control.observe(self._k)
        task = self._task
        down = self.down + task.down_noise * self._random.standard_normal(3)
        gyro = self._qvel[-1, 3:6] + task.gyro_noise * self._random.standard_normal(3)
        parts = [self.wanted, gyro, down, seen.theta, seen.theta_dot, self._action]
        return np.concatenate([np.ravel(part) for part in parts])

    def _trunk(self, before: Array) -> Trunk:
        """Return the trunk before the last control period and after each step of it."""
        qpos = np.concatenate([before, self.qpos])
        time = self._task.timestep * np.arange(1, len(qpos) + 1, dtype=np.float64)
        turning = np.zeros((len(qpos), 3))
        return Trunk(time, qpos[:, :3], qpos[:, 3:7], turning)

    def _torque(self, before: Array) -> Array:
        """Return the torque of each motor in each step of the last period [N m], (n, 8)."""
        q = np.concatenate([before, self.qpos])[:, 7:][:, MOTORS]
        step = MotorStep(
            integrator="discrete",
            ctrl=self._ctrl,
            q=q[:-1],
            q_next=q[1:],
            v_next=self._qvel[:, 6:][:, MOTORS],
            drive="position",
        )
        return applied_torque(self._robot.servo, step)


def check_action(action: Any, count: int | None = None) -> Array:
    """Return an action, or those of several robots, as an array at most 1 off 0; see `ROUNDING`.

    Args:
        action: The action, (8,), or (count, 8).
        count: Number of robots; None: one alone.

    Raises:
        ArgumentError: Of another shape, or not numbers in [-1, 1].
    """
    shape = (len(MOTORS),) if count is None else (count, len(MOTORS))
    wanted = f"an action must be {len(MOTORS)} numbers in [-1, 1]"
    if count is not None:
        wanted += f", one for each of {count} robots"
    try:
        values = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError(f"{wanted}, got {action!r}") from None
    if values.shape != shape:
        raise ArgumentError(f"{wanted}, got shape {values.shape}")

    # Written so that NaN is outside too.
    outside = ~(np.abs(values) <= 1.0 + ROUNDING)
    if outside.any():
        index = tuple(int(i) for i in np.argwhere(outside)[0])
        raise ArgumentError(f"{wanted}, got {float(values[index])!r} at index {index}")
    return np.clip(values, -1.0, 1.0)
