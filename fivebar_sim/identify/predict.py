"""What logs would say of simulated legs: all legs and all logs in one batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim import kinematics, model
from fivebar_sim.arrays import Array
from fivebar_sim.control.bus import Bus
from fivebar_sim.control.servo import MotorStep, Servo, applied_torque
from fivebar_sim.errors import ConfigError, FiveBarError
from fivebar_sim.identify.measured import Measured
from fivebar_sim.identify.parameters import Case
from fivebar_sim.kinematics import closure
from fivebar_sim.simulation.steps import Legs

CHUNK = 1000
"""Steps that are kept at a time: of what comes in between only what is compared."""


class Predicted(NamedTuple):
    """What one log would say.

    Attributes:
        theta: Angles in the log's own frame [rad], (n, 2).
        current: [A], (n, 2); None where the servo has no kt.
    """

    theta: Array
    current: Array | None


def predict(
    cases: Sequence[Case], logs: Sequence[Measured], nthread: int = 0
) -> list[list[Predicted]]:
    """Return what each log would say of each case, [case][log].

    Args:
        cases: The legs, of one timestep and integrator.
        logs: Their commands, and the times at which they are looked at.
        nthread: Threads; 0 is one for every processor.

    Raises:
        ConfigError: The leg cannot stand as a log begins.
    """
    pairs = [(case, log) for case in cases for log in logs]
    h = cases[0].scenario.sim.timestep
    steps = max(int(np.ceil(log.time[-1] / h - 1e-6)) + 1 for log in logs)
    models = [_model(case) for case in cases]
    starts = np.stack([_start(case, log) for case, log in pairs])
    built = [each for each in models for _ in logs]
    ctrl = np.stack([_commands(case, log, steps) for case, log in pairs])

    legs = Legs(built, starts, nthread, forces=False)
    nu = legs.nu
    kept = [_Kept(case, log, start) for (case, log), start in zip(pairs, starts, strict=True)]
    sent = np.zeros((len(pairs), CHUNK, nu))
    for begin in range(0, steps, CHUNK):
        part = ctrl[:, begin : begin + CHUNK]
        whole = sent[:, : part.shape[1]]
        whole[..., -2:] = part
        q, v, _ = legs.moved(whole)
        for row, each in enumerate(kept):
            each.add(q[row, :, -4::2], v[row, :, -4::2], part[row], begin)

    found = [each.predicted() for each in kept]
    return [found[i : i + len(logs)] for i in range(0, len(found), len(logs))]


def _model(case: Case):
    s = case.scenario
    return model.build(
        s.leg,
        servo=s.servo,
        scene=s.scene,
        timestep=s.sim.timestep,
        integrator=s.sim.integrator,
    )


def _start(case: Case, log: Measured) -> Array:
    """Return the pose in which a log begins, (4,).

    Raises:
        ConfigError: The loop cannot close there.
    """
    leg = case.scenario.leg
    theta = log.start + np.array(case.offset)
    try:
        points = closure.closed_points(leg, theta)
    except FiveBarError as error:
        raise ConfigError(f"{log.name}: the leg cannot stand as it begins: {error}") from None
    q = np.array(
        [
            theta[0],
            np.arctan2(*(points.C_left - points.B)[::-1]) - theta[0],
            theta[1],
            np.arctan2(*(points.C_left - points.D)[::-1]) - theta[1],
        ]
    )
    # The model's stops are about its rest pose: the knees' angles are those next to it.
    home = kinematics.home(leg)
    q[1::2] -= 2.0 * np.pi * np.round((q - home)[1::2] / (2.0 * np.pi))
    return q


def _commands(case: Case, log: Measured, steps: int) -> Array:
    """Return what reaches the motors in each step [rad], (N, 2)."""
    h = case.scenario.sim.timestep
    # A sample in the middle of a step acts from the next one on; rounding must not delay it.
    row = np.searchsorted(log.time, (np.arange(steps) + 1e-6) * h, side="right") - 1
    table = log.ctrl[row] + np.array(case.offset)
    servo = case.scenario.servo
    # The log itself says when commands were sent, and which ones.
    plain = Servo(kp=servo.kp, delay=servo.delay)
    bus = Bus([plain], "position", timestep=h, steps=steps)
    bus.restart(np.arange(1), table[:1])
    return bus.send_all(table[None])[0]


class _Kept:
    """The samples of one simulation."""

    def __init__(self, case: Case, log: Measured, start: Array) -> None:
        self._case = case
        h = case.scenario.sim.timestep
        at = np.maximum(log.time / h, 0.0)
        # Row k of the states is at (k + 1) h; the start is row -1.
        whole = np.floor(at + 1e-6)
        self._part = np.maximum(at - whole, 0.0)[:, None]
        self._rows: tuple[NDArray[np.int64], NDArray[np.int64]] = (
            whole.astype(np.int64) - 1,
            whole.astype(np.int64),
        )
        self._theta = np.repeat(np.tile(start[::2], (len(at), 1))[None], 2, axis=0)
        self._torque = np.zeros_like(self._theta)
        self._before = start[::2]

    def add(self, q: Array, v: Array, ctrl: Array, begin: int) -> None:
        """Take some steps' angles and rates, and what was sent."""
        before = np.concatenate([self._before[None], q[:-1]])
        torque = _torque(self._case, before, q, v, ctrl)
        for side, rows in enumerate(self._rows):
            mine = (rows >= begin) & (rows < begin + len(q))
            self._theta[side][mine] = q[rows[mine] - begin]
            self._torque[side][mine] = torque[rows[mine] - begin]
        self._before = q[-1].copy()

    def predicted(self) -> Predicted:
        """Return what the log would say."""
        theta = (1.0 - self._part) * self._theta[0] + self._part * self._theta[1]
        kt = self._case.scenario.servo.kt
        return Predicted(
            theta - np.array(self._case.offset),
            None if kt is None else self._torque[0] / kt,
        )


def _torque(case: Case, q: Array, q_next: Array, v: Array, ctrl: Array) -> Array:
    """Return the motors' torques in some steps [N m], (n, 2)."""
    servo = case.scenario.servo
    step = MotorStep(case.scenario.sim.integrator, ctrl, q, q_next, v)
    return applied_torque(servo, step)
