"""The servos of one leg or robot in one step, in plain numbers: see `clipping`.

Arrays of two to twelve numbers would take several times as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.simulation.limits.clipping import SLACK, Clipping

Modes = tuple[int, ...]
"""The mode of each motor."""


class Servos:
    """The servos, bound to MuJoCo's data of their leg or robot.

    Args:
        clipping: Their numbers, of one simulation.
        data: The data.

    Attributes:
        own: Where their commands are in ctrl.
        limit: Largest torques [N m], (motors,).
    """

    def __init__(self, clipping: Clipping, data: mujoco.MjData) -> None:
        self._clipping = clipping
        self._joints = clipping.joints
        self._late = bool(clipping.late.item())
        self._kp: list[float] = clipping.kp[0, 0].tolist()
        self._kd: list[float] = clipping.kd[0, 0].tolist()
        self._limit: list[float] = clipping.limit[0, 0].tolist()
        least = [-limit for limit in self._limit]
        self._laws = list(zip(self._kp, self._kd, least, self._limit, strict=True))
        self.own = slice(-clipping.motors, None)
        self.limit = clipping.limit[0, 0]

        joints = clipping.joints
        # Of a list, which is made faster as a whole than some of its numbers are found.
        self._of = itemgetter(joints) if isinstance(joints, slice) else itemgetter(*joints.tolist())
        self._qpos = data.qpos
        self._qvel = data.qvel
        self._ctrl = data.ctrl
        self._forces = data.qfrc_applied

    def begin(self) -> None:
        """Remember the state before the next step."""
        self._q = self._of(self._qpos.tolist())
        self._v = self._of(self._qvel.tolist())

    def is_right(self, sent: list[float]) -> bool:
        """Return whether a step ended in the modes that MuJoCo chose at its start.

        Args:
            sent: Its commands, (motors,).
        """
        self._u = sent
        self._end()
        motors = zip(self._laws, sent, self._q, self._v, self._q_end, self._v_end, strict=True)
        for (kp, kd, least, most), u, q, v, q_end, v_end in motors:
            begun = kp * (u - q) - kd * v
            ended = kp * (u - q_end) - kd * v_end
            # Most are on one side; NaN is on none.
            if least <= begun <= most:
                if least <= ended <= most:
                    continue
            elif (begun > most and ended > most) or (begun < least and ended < least):
                continue
            mode = _side(begun, most)
            if _end_side(ended, mode, most) != mode:
                return False
        return True

    def go_on(self) -> None:
        """Begin the next step where the last one ended."""
        self._q = self._of(self._qpos.tolist()) if not self._late else self._q_end
        self._v = self._v_end

    def begun(self) -> Modes:
        """Return the modes that MuJoCo chose with the state before the step."""
        asked = self._asked(self._q, self._v)
        return tuple(map(_side, asked, self._limit))

    def ended(self, modes: Modes) -> Modes:
        """Return the modes that the state after the step in some modes calls for."""
        self._end()
        return tuple(map(_end_side, self._asked(self._q_end, self._v_end), modes, self._limit))

    def asked(self) -> Array:
        """Return what the step ends with before a limit clips it [N m], (motors,)."""
        self._end()
        return np.array(self._asked(self._q_end, self._v_end))

    def push(self, modes: Modes) -> None:
        """Send what makes the next step one in these modes, as `Clipping.forced`; see `release`."""
        acting = []
        lacks = []
        motors = zip(modes, self._kp, self._kd, self._limit, self._u, self._q, self._v, strict=True)
        for mode, kp, kd, limit, u, q, v in motors:
            pushed = 2.0 * mode * limit if mode else 0.0
            acting.append(q + (pushed + kd * v) / kp)
            lacks.append(0.0 if mode else kp * (u - acting[-1]))
        self._send(acting, lacks)

    def push_constant(self, torque: Array) -> None:
        """Send what makes the next step one with these torques [N m]; see `release`."""
        q, v = (np.array(each)[None, None] for each in (self._q, self._v))
        forced = self._clipping.constant(torque[None, None], q, v)[0, 0]
        self._send(*np.split(forced, 2))

    def release(self) -> None:
        """Push no more."""
        self._forces[self._joints] = 0.0

    def wrong(self, ctrl: Array, before: Array, after: Array) -> Bools:
        """Return which of many steps are wrong in the modes that MuJoCo chose, (N,).

        Args:
            ctrl: Commands, (1, N, nu).
            before: Time, qpos and qvel before each step, and more, (1, N, ...).
            after: And after it.
        """
        u = ctrl[..., self.own]
        q, v = self._motors(before)
        begun = self._clipping.begun(u, q, v)
        asked = self._clipping.ended(begun, u, q, *self._motors(after))
        return (begun != asked).any(axis=-1)[0]

    def _motors(self, state: Array) -> tuple[Array, Array]:
        nq = len(self._qpos)
        q = state[..., 1 : 1 + nq]
        v = state[..., 1 + nq : 1 + nq + len(self._qvel)]
        return q[..., self._joints], v[..., self._joints]

    def _end(self) -> None:
        """Remember the angles that the springs act with, and the rates after the step."""
        self._q_end = self._of(self._qpos.tolist()) if self._late else self._q
        self._v_end = self._of(self._qvel.tolist())

    def _asked(self, angles: Sequence[float], rates: Sequence[float]) -> list[float]:
        motors = zip(self._kp, self._kd, self._u, angles, rates, strict=True)
        return [kp * (u - q) - kd * v for kp, kd, u, q, v in motors]

    def _send(self, acting: ArrayLike, lacks: ArrayLike) -> None:
        """Send commands and joint torques, (motors,) each."""
        self._ctrl[self.own] = acting
        self._forces[self._joints] = lacks


def _side(asked: float, limit: float) -> int:
    """Return on which side a torque is beyond a limit, 0 within it and for NaN."""
    return (asked > limit) - (asked < -limit)


def _end_side(asked: float, mode: int, limit: float) -> int:
    """Return the mode that a torque calls for at the end of a step in some mode."""
    # On the limit, to rounding, both modes give the same torque: the present one stays.
    return _side(asked + SLACK * mode * limit, (1.0 + SLACK * (mode == 0)) * limit)
