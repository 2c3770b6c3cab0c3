"""Episodes of many legs at one task: actions in, observations, rewards and ends out; no physics.

The code that steps the physics, with `mujoco.batch` or dm_control, asks for `commands`, reports the
states with `update`, and reads `outcome`. Only the draws of a restart are done leg by leg.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools, as_vectors
from fivebar_sim.control.servo import MotorStep, ServoArrays, applied_torque
from fivebar_sim.control.step import ControlStep
from fivebar_sim.errors import ArgumentError
from fivebar_sim.kinematics.leg_arrays import LegArrays
from fivebar_sim.kinematics.stops import SPEED_LIMIT
from fivebar_sim.metrics.columns import MOTORS_FROM_END
from fivebar_sim.tasks.base import Part, Task
from fivebar_sim.tasks.motion import TIME, motion

ROUNDINGS = 4
"""How many units in the last place of a float32 an action may be outside, as rounding leaves it."""


class Outcome(NamedTuple):
    """What agents get after a control period, or at the start of an episode.

    Attributes:
        observation: The observations, (n, size).
        reward: Weighted sum of the terms, (n,).
        terms: Reward terms by name, (n,) each.
        terminated: Whether a leg has failed or a robot fallen, and why see `reason`, (n,).
        truncated: Whether the episode's duration is over, (n,).
        reason: Index in REASONS, of robots the words themselves, (n,).
    """

    observation: Array
    reward: Array
    terms: dict[str, Array]
    terminated: Bools
    truncated: Bools
    reason: NDArray[Any]


class Episodes:
    """Episodes of n legs at one task.

    Args:
        task: The nominal task; its leg sets scales, bounds and targets for all.
        drawn: The same task with each leg's own numbers, n of them.
        starts: Poses at rest that each leg's episodes may start in, (n, m, nq).

    Attributes:
        size: n.
        low, high: Bounds of an action.
        qpos, qvel: The state of each leg, (n, nq).
    """

    def __init__(self, task: Task, drawn: Sequence[Task], starts: Array) -> None:
        self.task = task
        self.size = len(drawn)
        self.low, self.high = task.bounds
        legs = [each.leg for each in drawn]
        # Equal legs are one: what depends on the leg alone is then computed once for all steps.
        self._leg = legs[0] if len(set(legs)) == 1 else LegArrays.of(legs)
        servos = [each.servo for each in drawn]
        self._servo = ServoArrays.of(servos)
        self._starts = starts
        self._targets = np.concatenate(list(task.targets().values()), axis=1)
        self._weights = {name: task.weight(name) for name in task.WEIGHTS}

        self.qpos = starts[:, 0].copy()
        self.qvel = np.zeros_like(starts[:, 0])
        self._count = np.zeros(self.size, dtype=np.int64)
        self._fresh = np.ones(self.size, dtype=bool)
        self._broken = np.zeros(self.size, dtype=bool)
        self._ctrl = np.zeros((self.size, task.every, 2))
        self._torque = np.zeros_like(self._ctrl)
        self._control = ControlStep(
            servos,
            task.sensors,
            task.drive,
            timestep=task.timestep,
            every=task.every,
            steps=task.periods * task.every,
            start=self.qpos[:, MOTORS_FROM_END].copy(),
            seeds=range(self.size),
        )

    def begin(self, rows: NDArray[np.int64], random: Sequence[np.random.Generator]) -> Array:
        """Start episodes of some legs and return their qpos, at rest, (k, nq).

        Args:
            rows: Indices of those legs, (k,).
            random: A generator for each of them, for its start and its sensor noise.
        """
        # Another order of these draws would make other episodes of the same seeds.
        which = [int(generator.integers(self._starts.shape[1])) for generator in random]
        seeds = [int(generator.integers(2**63)) for generator in random]
        qpos = self._starts[rows, which]
        self.qpos[rows] = qpos
        self.qvel[rows] = 0.0
        self._count[rows] = 0
        self._fresh[rows] = True
        self._broken[rows] = False
        self._torque[rows] = 0.0
        self._control.restart(rows, qpos[:, MOTORS_FROM_END], seeds)
        return qpos

    def check_action(self, action: object, shape: tuple[int, ...]) -> Array:
        """Return an action as an array; what lies outside by rounding alone is moved to the bound.

        Raises:
            ArgumentError: Not finite numbers of that shape within the bounds; nothing is clipped.
        """
        values = as_vectors(np.asarray(action), "action", len(self.low))
        if values.shape != shape:
            raise ArgumentError(f"action must have shape {shape}, got {values.shape}")

        inside, outside = to_bounds(values, self.low, self.high)
        if outside.any():
            index = tuple(int(i) for i in np.argwhere(outside)[0])
            name, unit, number = part_at(self.task.actions, index[-1])
            low = self.low[index[-1]]
            high = self.high[index[-1]]
            raise ArgumentError(
                f"action {name}[{number}] must be in [{low:.6g}, {high:.6g}] {unit}, "
                f"got {float(values[index])!r} at index {index}"
            )

        return inside

    def commands(self, action: Array) -> Array:
        """Return what reaches the motors in each step of the next control period, (n, every, 2).

        Args:
            action: A checked action, (n, size).
        """
        command = action
        if self.task.action == "motion":
            # A servo lags its setpoint by damping / kp times the rate: so much is put on top.
            lead = (self._servo.damping / self._servo.kp)[:, 0]
            command = action[:, :2] + lead * action[:, 2:]
        # A leg whose episode is over is stepped on with the others; the bus has no later period.
        periods = np.minimum(self._count, self.task.periods - 1)
        self._ctrl = self._control.send(periods * self.task.every, command)
        return self._ctrl

    def update(self, qpos: Array, qvel: Array, warnings: NDArray[Any]) -> None:
        """Take over the states after each step of a control period.

        A leg whose physics broke down keeps its state of a period before.

        Args:
            qpos: Positions, (n, every, nq).
            qvel: Rates, (n, every, nq).
            warnings: Number of MuJoCo's warnings since the leg's start, (n,).
        """
        # A comparison with NaN is False, so NaN is unsound too.
        sound = np.abs(qvel).max(axis=(1, 2)) < SPEED_LIMIT
        self._broken = ~(sound & np.isfinite(qpos).all(axis=(1, 2)) & (warnings == 0))
        q = qpos[..., MOTORS_FROM_END]
        v = qvel[..., MOTORS_FROM_END]

        # Agents must never see NaN: the observation after a breakdown is that of the period before.
        if self._broken.any():
            bad = self._broken[:, None, None]
            qpos = np.where(bad, self.qpos[:, None], qpos)
            qvel = np.where(bad, self.qvel[:, None], qvel)
            q = qpos[..., MOTORS_FROM_END]
            v = qvel[..., MOTORS_FROM_END]

        before = np.concatenate([self.qpos[:, None, MOTORS_FROM_END], q[:, :-1]], axis=1)
        task = self.task
        step = MotorStep(task.integrator, self._ctrl, before, q, v, task.drive)
        self._torque = applied_torque(self._servo, step)
        # Copies: a view of the last step would keep all steps of the period in memory.
        self._control.moved(q.copy(), v.copy())
        self.qpos = qpos[:, -1].copy()
        self.qvel = qvel[:, -1].copy()
        self._count += 1
        self._fresh[:] = False

    def outcome(self, rows: NDArray[np.int64] | None = None) -> Outcome:
        """Return what agents get; legs that have just started have no reward and no end.

        Args:
            rows: The legs that matter: the others' sensors are not read again. None: all of them.
        """
        task = self.task
        now = motion(self._leg, self.qpos, self.qvel, self._torque, self._broken)
        targets = self._targets[np.minimum(self._count, task.periods)]
        seen = self._control.observe(self._count * task.every, rows)
        # A fresh leg has run no period that could be rewarded.
        ran = ~self._fresh
        terms = {name: term * ran for name, term in task.terms(now, targets).items()}
        reward = np.zeros(self.size)

        for name, term in terms.items():
            reward += self._weights[name] * term

        reason = now.reason * ran
        terminated = reason > 0
        # A leg that fails in the last period has failed: its discount is 0, not 1.
        truncated = ~terminated & (self._count >= task.periods)
        reason[truncated] = TIME
        observation = task.observation(seen, now, targets)

        return Outcome(observation, reward, terms, terminated, truncated, reason)


def to_bounds(values: Array, low: Array, high: Array) -> tuple[Array, Bools]:
    """Return numbers moved to the bound that they miss by rounding, and which miss it by more.

    An agent's network scales its answer, of [-1, 1], as centre + half * answer in float32: some
    roundings of numbers that are at most as large as the larger bound.
    """
    largest = np.maximum(np.abs(low), np.abs(high)).astype(np.float32)
    inside = np.clip(values, low, high)
    # Written so that NaN is outside too.
    return inside, ~(np.abs(values - inside) <= ROUNDINGS * np.spacing(largest))


def part_at(parts: dict[str, Part], index: int) -> tuple[str, str, int]:
    """Return the name and unit of the part that holds an index, and the index within the part."""
    for name, part in parts.items():
        if index < part.size:
            return name, part.unit, index
        index -= part.size
    raise IndexError(index)
