"""Feedback controllers and the legs that each of them drives."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import repeat
from typing import Any, NamedTuple, cast

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control import Feedback, Reference
from fivebar_sim.control.interface import answer_of, is_numbers
from fivebar_sim.control.servo import FARTHEST
from fivebar_sim.control.step import ControlStep
from fivebar_sim.errors import ConfigError, PoseError
from fivebar_sim.metrics.columns import MOTORS
from fivebar_sim.motion import Motion
from fivebar_sim.simulation.plan import Plan, period_steps

Latest = tuple[Array, Array]
"""Angles and rates of the motors after some steps, (nsim, n, 2)."""


class Refusal(NamedTuple):
    """A command that no motor can follow.

    Attributes:
        after: How many good ones came before it.
        error: Why; its index is that of the leg.
    """

    after: int
    error: PoseError


class Asked:
    """One controller and its legs, equal but for their motions: one call answers for all.

    Args:
        plans: Their plans.
        rows: Which of all plans they are.

    Attributes:
        name: The controller's.
        part: Where they are among all plans.
    """

    def __init__(self, plans: list[Plan], rows: list[int]) -> None:
        s = plans[0].scenario
        every = period_steps(plans[0])
        self.rows = rows
        beside = rows == [*range(rows[0], rows[-1] + 1)]
        # Of rows that follow each other a slice: a list would have to be looked up at every step.
        self.part = slice(rows[0], rows[-1] + 1) if beside else rows
        self.name = s.controller_name
        controller = cast(Feedback, s.controller)
        self._is_angle = controller.drive == "position"
        self._ask = controller.command
        self._leg = s.leg
        self._servo = s.servo
        self._step = ControlStep(
            s.servo,
            s.sensors,
            controller.drive,
            timestep=plans[0].motion.timestep,
            every=every,
            steps=s.steps,
            start=np.stack([p.motion.q[0, ::2] for p in plans]),
            seeds=[p.scenario.sim.seed for p in plans],
        )

        wanted = _references([p.motion for p in plans])
        # Yields the rows of one control step after the other: cheaper than an index for each.
        fields = (field[::every] for field in wanted[:-1])
        self._wanted = map(Reference._make, zip(*fields, repeat(wanted.payload)))
        self._commands: list[Any] = []
        self._seen: list[Array] = []

    def sent(self, k: int, latest: Latest | None) -> Array:
        """Return what reaches the motors from step k on, (nsim, n, 2); see `refusal`.

        Args:
            k: The step.
            latest: The motors' motion since they were asked last; None at the start.

        Raises:
            PoseError: The controller has no answer in a pose.
            ConfigError: It fails otherwise, or answers with another shape.
        """
        if latest is not None:
            self._step.moved(*latest)
        seen = self._step.observe(k)
        wanted = next(self._wanted)
        command = answer_of(self.name, self._ask, self._leg, self._servo, seen, wanted)
        if not is_numbers(command, seen.theta.shape):
            raise ConfigError(
                f"controller {self.name!r} must command numbers of shape {seen.theta.shape}, "
                f"got {command.dtype} of shape {command.shape}"
            )

        self._commands.append(command)
        self._seen.append(seen.theta)
        return self._step.send(k, command)

    def refusal(self) -> Refusal | None:
        """Return the first command since this was last called that is no command, if any is."""
        commands = np.array(self._commands, dtype=np.float64).reshape(-1, len(self.rows), 2)
        seen = self._seen
        self._commands = []
        self._seen = []
        good = np.isfinite(commands)
        if self._is_angle:
            good &= np.abs(commands - np.array(seen).reshape(commands.shape)) <= FARTHEST
        if good.all():
            return None
        k = int(np.argmin(good.all(axis=(1, 2))))
        return Refusal(k, _why(commands[k], seen[k]))


def _why(command: Array, theta: Array) -> PoseError:
    """Return why no motor can follow a command: it is not finite, or no setpoint.

    Args:
        command: Commands (A, E) of some legs, (nsim, 2).
        theta: The angles that their controller saw [rad], (nsim, 2).
    """
    finite = np.isfinite(command).all(axis=1)
    if not finite.all():
        return PoseError("its command is not finite", (int(np.argmin(finite)),))

    away = np.abs(command - theta)
    row, motor = np.unravel_index(int(np.argmax(away)), away.shape)
    return PoseError(
        f"its setpoints must be within {FARTHEST:.4g} rad (half a turn) of the motors' angles, "
        f"got one for {MOTORS[motor]} that is {away[row, motor]:.4g} rad away",
        (int(row),),
    )


def asked(plans: Sequence[Plan]) -> list[Asked]:
    """Return the controllers of plans, one for all plans that have it and the leg in common."""
    members: dict[tuple, list[int]] = {}
    for row, plan in enumerate(plans):
        s = plan.scenario
        kind = (s.leg, s.servo, s.sensors, _hashable(s.controller), plan.motion.payload)
        members.setdefault(kind, []).append(row)
    return [Asked([plans[row] for row in rows], rows) for rows in members.values()]


def _hashable(controller: object) -> object:
    """Return a controller, or of one that cannot be hashed, as a user's may be, which one it is."""
    try:
        hash(controller)
    except TypeError:
        return id(controller)
    return controller


def _references(motions: list[Motion]) -> Reference:
    """Return the references of all steps, arrays of shape (N + 1, nsim, 2)."""
    q, q_dot, q_ddot = (
        [getattr(m, name)[:, ::2] for m in motions] for name in ("q", "q_dot", "q_ddot")
    )
    foot, foot_dot, foot_ddot, force = (
        [getattr(m, name) for m in motions] for name in ("foot", "foot_dot", "foot_ddot", "force")
    )
    fields = (foot, foot_dot, foot_ddot, q, q_dot, q_ddot, force)
    stacked = [np.stack(each, axis=1) for each in fields]
    return Reference(*stacked, payload=float(motions[0].payload))
