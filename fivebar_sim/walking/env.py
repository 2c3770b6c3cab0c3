"""A robot that learns to walk, as a Gymnasium environment: fivebar/Walk-v0.

This module needs Gymnasium: install the extra `rl`. Importing `fivebar_sim.gym` registers it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box

from fivebar_sim import model
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import MotorStep, applied_torque
from fivebar_sim.control.step import ControlStep
from fivebar_sim.errors import ArgumentError
from fivebar_sim.metrics.columns import MOTOR_JOINTS
from fivebar_sim.robots import LEGS, Floor, Robot
from fivebar_sim.robots.measure import Trunk, falls
from fivebar_sim.robots.places import rotation
from fivebar_sim.simulation.steps import Legs, States, is_broken
from fivebar_sim.walking.draws import Ranges, draw_robot
from fivebar_sim.walking.task import Moved, WalkTask

PARTS = {"command": 2, "gyro": 3, "down": 3, "theta": 8, "theta_dot": 8, "action": 8}
"""What an observation is made of, and how many numbers each is."""

MOTORS = [4 * leg + joint for leg in range(len(LEGS)) for joint in MOTOR_JOINTS]
"""Where the motors are among the joints of all legs."""

ROUNDING = 4.0 * float(np.finfo(np.float32).eps)
"""What a network's float32 may leave of an action beyond 1."""


class WalkEnv(gymnasium.Env[Array, Array]):
    """A robot that is told how fast to go and to turn, and tells its eight motors their angles.

    An action in [-1, 1] moves each motor by up to `span` from its standing angle, A and E of FL,
    FR, RL, RR. Observations are `PARTS` one after the other: the commanded speed [m/s] and turning
    rate [rad/s], the gyroscope [rad/s], the direction of down in the trunk's frame, the motors'
    angles [rad] and rates [rad/s] as their sensors show them, and the last action. An episode
    ends when the robot falls. info has the reward's "terms", and the "reason" of an end.

    Args:
        robot: A preset's name, a TOML file, or a `Robot`.
        render_mode: None; pictures are those of `fivebar render`.
        options: Attributes of `WalkTask`; randomise also as a table or True, its defaults.

    Raises:
        ArgumentError: An unknown option, or a value of the wrong type or out of range.
        ConfigError: An unknown preset, or a file with an illegal value.
    """

    metadata = {"render_modes": [], "render_fps": 50}  # noqa: RUF012 - as in Env

    def __init__(
        self, robot: str | Robot = "q8bot", render_mode: str | None = None, **options: Any
    ) -> None:
        if render_mode is not None:
            raise ArgumentError(f"render_mode must be None, got {render_mode!r}")
        unknown = sorted(set(options) - set(WalkTask.__struct_fields__))
        if unknown:
            raise ArgumentError(f"unknown option {unknown[0]!r} of Walk-v0")
        options["randomise"] = _ranges(options.get("randomise"))
        loaded = robot if isinstance(robot, Robot) else Robot.load(robot)
        self.task = WalkTask(robot=loaded, **options)

        self.render_mode = None
        size = sum(PARTS.values())
        self.observation_space: Any = Box(-np.inf, np.inf, (size,), np.float64)
        self.action_space: Any = Box(-1.0, 1.0, (len(MOTORS),), np.float64)
        self.robot = loaded
        self._model = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Return the first observation of an episode, and info.

        Args:
            seed: Seed of this and the following episodes; None: go on with the last one.
            options: None or {}: a reset has no options.
        """
        if options:
            raise ArgumentError(f"reset has no options, got {sorted(options)[0]!r}")
        super().reset(seed=seed)
        self._build()
        task = self.task
        assert self._model is not None
        start = self._model.key("stand").qpos.copy()
        self._standing = start[7:][MOTORS].reshape(len(LEGS), 2)
        gravity = self._model.opt.gravity
        self._gravity = gravity / np.linalg.norm(gravity)
        self._legs = Legs(self._model, start[None])
        self._control = ControlStep(
            self.robot.servo,
            task.sensors,
            "position",
            timestep=task.timestep,
            every=task.every,
            steps=task.periods * task.every,
            start=self._standing,
            seeds=self.np_random.integers(2**31, size=len(LEGS)).tolist(),
        )

        self._k = 0
        self._qpos = start[None]
        self._qvel = np.zeros((1, self._model.nv))
        self._action = np.zeros(len(MOTORS))
        low, high = np.array([task.speed, task.turn]).T
        self._wanted = self.np_random.uniform(low, high)
        return self._observation(), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Return observation, reward, terminated, truncated and info after a control period.

        Raises:
            ArgumentError: An action that is not eight numbers in [-1, 1].
        """
        self._action = _checked(action)
        task = self.task
        command = self._standing + task.span * self._action.reshape(len(LEGS), 2)
        sent = self._control.send(self._k, command)
        states = self._legs.advance(np.concatenate([*sent], axis=-1)[None])
        before = self._qpos[-1:]
        self._k += task.every

        if is_broken(states, slice(None)):
            return self._observation(), 0.0, True, False, {"terms": {}, "reason": "diverged"}
        self._qpos = states.qpos[0].copy()
        self._qvel = states.qvel[0].copy()
        seen = (self._qpos[:, 7:][:, MOTORS], self._qvel[:, 6:][:, MOTORS])
        self._control.moved(*(np.moveaxis(part.reshape(-1, len(LEGS), 2), 1, 0) for part in seen))

        trunk = self._trunk(before)
        terms = task.terms(
            self._wanted, Moved.of(trunk, self.robot.length), self._torque(states, before)
        )
        box = self.robot.trunk
        fell = falls(trunk, box.size, np.array(box.center))
        over = self._k >= task.periods * task.every
        info = {"terms": terms, "reason": fell[0].why if fell else ""}
        return self._observation(), sum(terms.values()), bool(fell), over, info

    @property
    def down(self) -> Array:
        """Direction of gravity in the trunk's frame, without noise, (3,)."""
        # It leans where the floor rises: the world's axes are the floor's.
        return self._gravity @ rotation(self._qpos[-1:, 3:7])[0]

    @property
    def theta(self) -> Array:
        """Angles of the motors, without noise [rad], (4, 2)."""
        return self._qpos[-1, 7:][MOTORS].reshape(len(LEGS), 2)

    def _build(self) -> None:
        """Build the robot's model: once, or for every episode if it is drawn."""
        task = self.task
        friction = task.friction
        if task.randomise is not None:
            self.robot, friction = draw_robot(task.robot, task.randomise, self.np_random)
        elif self._model is not None:
            return
        floor = Floor(friction=friction, slope=task.slope)
        self._model = model.build_robot(self.robot, floor, timestep=task.timestep)

    def _trunk(self, before: Array) -> Trunk:
        """Return the trunk before the last control period and after each step of it."""
        qpos = np.concatenate([before, self._qpos])
        time = self.task.timestep * np.arange(1, len(qpos) + 1, dtype=np.float64)
        turning = np.zeros((len(qpos), 3))
        return Trunk(time, qpos[:, :3], qpos[:, 3:7], turning)

    def _torque(self, states: States, before: Array) -> Array:
        """Return the torque of each motor in each step of the last period [N m], (n, 8)."""
        q = np.concatenate([before, self._qpos])[:, 7:][:, MOTORS]
        step = MotorStep(
            integrator="discrete",
            ctrl=states.ctrl[0],
            q=q[:-1],
            q_next=q[1:],
            v_next=self._qvel[:, 6:][:, MOTORS],
            drive="position",
        )
        return applied_torque(self.robot.servo, step)

    def _observation(self) -> Array:
        """Return what the robot knows."""
        seen = self._control.observe(self._k)
        task = self.task
        down = self.down + task.down_noise * self.np_random.standard_normal(3)
        gyro = self._qvel[-1, 3:6] + task.gyro_noise * self.np_random.standard_normal(3)
        parts = [self._wanted, gyro, down, seen.theta, seen.theta_dot, self._action]
        return np.concatenate([np.ravel(part) for part in parts])


def _checked(action: Any) -> Array:
    """Return an action as an array, at most 1 off 0; see `ROUNDING`."""
    values = np.asarray(action, dtype=np.float64)
    if values.shape != (len(MOTORS),) or not np.all(np.abs(values) <= 1.0 + ROUNDING):
        raise ArgumentError(
            f"an action must be {len(MOTORS)} numbers in [-1, 1], got {values.tolist()}"
        )
    return np.clip(values, -1.0, 1.0)


def _ranges(value: Any) -> Ranges | None:
    """Return what is drawn for every episode: of a table, of True, or as it is."""
    if value is None or isinstance(value, Ranges):
        return value
    if value is True:
        return Ranges()
    known = Ranges._fields
    if not isinstance(value, Mapping) or not set(value) <= set(known):
        raise ArgumentError(
            f"randomise must be True or a table of {', '.join(known)}, got {value!r}"
        )
    return Ranges(**{key: (float(low), float(high)) for key, (low, high) in value.items()})
