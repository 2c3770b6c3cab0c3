"""Torque limits that hold at the end of a step, where MuJoCo decides clipping at its start.

MuJoCo's integrators let a servo's spring and damper act with the state that a step ends in, but
clip them with the state that it begins in: a step that begins within the limit may end beyond it,
and one that begins beyond it may end within. A motor is in one of three modes in a step, and one
alone agrees with the torque that the step ends with:

    0        kp (u - q+) - kd v+, where that is within +-limit
    +1, -1   +limit or -limit, where it is beyond, on that side

with q in place of q+ under `implicitfast`. A step whose modes do not agree is taken again in other
modes. Under `implicitfast`, where the loop's force does not know the damping, it happens that none
agree: then the step is taken with the constant torques that it ends with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import product
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools

Integers = NDArray[np.int64]

SLACK = 1e-9
"""How far a torque may be off the limit and still count as on it, as a part of the limit."""

UNLIMITED = 1e300
"""Stands for no limit beside legs that have one [N m]: not infinite, so that 0 times it is 0."""

MOST_MODES = 9
"""Modes of the motors of one leg; so many are tried of more motors, too."""

TRIES = 10
"""Most attempts to find constant torques; the second is exact where nothing touches or lets go."""


@cache
def modes_of(motors: int) -> Integers:
    """Return every combination of the modes of some motors, (3^motors, motors)."""
    return np.array(list(product((0, 1, -1), repeat=motors)))


def motors_of(model: mujoco.MjModel) -> int:
    """Return the number of motors of a model: its last actuators, which act on joints."""
    joint = mujoco.mjtTrn.mjTRN_JOINT
    return int((model.actuator_trntype == joint).sum())


class Clipping(NamedTuple):
    """Position servos with torque limits.

    Attributes:
        kp: Gains on the angle [N m/rad], (n, 1, motors).
        kd: Gains on the rate, within what the limit clips [N m s/rad], (n, 1, motors).
        limit: Largest torques [N m], (n, 1, motors).
        late: Whether the spring acts at the end of a step, not at its start, (n, 1, 1).
        joints: Where the motors' joints are in qpos and qvel, from their ends.
    """

    kp: Array
    kd: Array
    limit: Array
    late: Bools
    joints: slice | Integers

    @classmethod
    def of(cls, models: Sequence[mujoco.MjModel]) -> Clipping | None:
        """Return the servos of some models; None if no limit of theirs needs a look."""
        own = slice(-motors_of(models[0]), None)
        # A bare motor has no term in q and v.
        springs = np.array([built.actuator_biasprm[own, 1] != 0.0 for built in models])
        limited = springs & np.array([built.actuator_forcelimited[own] != 0 for built in models])
        if not limited.any():
            return None

        kp = np.array([built.actuator_gainprm[own, 0] for built in models])
        kd = np.array([-built.actuator_biasprm[own, 2] for built in models])
        most = np.array([built.actuator_forcerange[own, 1] for built in models])
        limit = np.where(limited, most, UNLIMITED)
        discrete = mujoco.mjtIntegrator.mjINT_DISCRETE
        late = np.array([built.opt.integrator == discrete for built in models])
        return cls(
            kp[:, None], kd[:, None], limit[:, None], late[:, None, None], _joints(models[0])
        )

    @property
    def motors(self) -> int:
        """The number of motors."""
        return self.kp.shape[-1]

    def rows(self, ids: Integers) -> Clipping:
        """Return the servos of some simulations."""
        return Clipping(self.kp[ids], self.kd[ids], self.limit[ids], self.late[ids], self.joints)

    def begun(self, u: Array, q: Array, v: Array) -> Integers:
        """Return the modes that MuJoCo chooses with the states before steps, (n, N, motors)."""
        return sides(self.kp * (u - q) - self.kd * v, self.limit)

    def ended(self, modes: Integers, u: Array, q: Array, q_next: Array, v_next: Array) -> Integers:
        """Return the modes that the states after steps in some modes call for, (n, N, motors)."""
        asked = self.asked(u, q, q_next, v_next)
        # On the limit, to rounding, both modes give the same torque: the present one stays.
        return sides(asked + SLACK * modes * self.limit, (1.0 + SLACK * (modes == 0)) * self.limit)

    def asked(self, u: Array, q: Array, q_next: Array, v_next: Array) -> Array:
        """Return what steps end with before a limit clips it [N m], (n, N, motors)."""
        return self.kp * (u - np.where(self.late, q_next, q)) - self.kd * v_next

    def constant(self, torque: Array, q: Array, v: Array) -> Array:
        """Return what `forced` does, for constant torques [N m], (n, N, motors)."""
        full = np.ones(torque.shape, dtype=np.int64)
        forced = self.forced(full, q, q, v)
        forced[..., self.motors :] = torque - self.limit
        return forced

    def forced(self, modes: Integers, u: Array, q: Array, v: Array) -> Array:
        """Return commands and joint torques for steps in these modes, (n, N, 2 motors).

        In mode 0 a step begins without torque; what its command then lacks comes as a joint torque,
        which MuJoCo does not clip.
        """
        push = np.where(modes == 0, 0.0, 2.0 * modes * self.limit)
        acting = q + (push + self.kd * v) / self.kp
        lacks = np.where(modes == 0, self.kp * (u - acting), 0.0)
        return np.concatenate([acting, lacks], axis=-1)


def _joints(model: mujoco.MjModel) -> slice | Integers:
    """Return where the motors' joints are in qpos and qvel, from their ends."""
    motors = motors_of(model)
    found = model.jnt_dofadr[model.actuator_trnid[-motors:, 0]].astype(np.int64) - model.nv
    # Every other joint of legs that have no more than A, B, E and D: a slice is faster.
    usual = slice(-2 * motors, None, 2)
    alike = np.array_equal(found, np.arange(-2 * motors, 0, 2))
    return usual if alike else found


def clipped(offset: Array, slope: Array, limit: Array) -> Array:
    """Return the torques t = clip(offset + slope t, limit), or what comes nearest, (motors,)."""
    eye = np.eye(len(offset))
    best = np.zeros(len(offset))
    least = np.inf
    for mode in modes_of(len(offset)):
        free = mode == 0
        torque = mode * limit
        # t - slope t = offset in the free rows, with the others on their limits.
        system = (eye - slope)[np.ix_(free, free)]
        torque[free] = np.linalg.solve(system, (offset + slope @ torque)[free])
        torque = np.clip(torque, -limit, limit)
        misses = np.abs(np.clip(offset + slope @ torque, -limit, limit) - torque).max()
        if misses < least:
            best = torque
            least = misses
    return best


def settle(ended: Callable[[Array], Array], limit: Array) -> bool:
    """Take a step with the constant torques that it ends with; return whether they were found.

    Args:
        ended: Takes it with some torques, and returns what it asks for at its end, (motors,).
        limit: Largest torques, (motors,).
    """
    motors = len(limit)
    torque = np.zeros(motors)
    for _ in range(TRIES):
        now = ended(torque)
        if (np.abs(np.clip(now, -limit, limit) - torque) <= SLACK * limit).all():
            return True

        slope = np.empty((motors, motors))
        for motor in range(motors):
            other = torque.copy()
            other[motor] -= np.copysign(0.1 * limit[motor], torque[motor])
            slope[:, motor] = (ended(other) - now) / (other - torque)[motor]
        torque = clipped(now - slope @ torque, slope, limit)
    return False


def sides(asked: Array, limit: Array) -> Integers:
    """Return on which side torques are beyond a limit, 0 within it and for NaN."""
    return (asked > limit).astype(np.int64) - (asked < -limit)


def number(modes: Integers) -> Integers:
    """Return which row of `modes_of` some modes are, (n,)."""
    places = 3 ** np.arange(modes.shape[1])[::-1]
    return modes % 3 @ places
