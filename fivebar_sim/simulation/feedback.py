"""Legs in the loop: their controllers are asked at every control step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control import Feedback, Reference
from fivebar_sim.control.interface import answer_of, is_numbers
from fivebar_sim.control.servo import FARTHEST
from fivebar_sim.control.step import ControlStep
from fivebar_sim.errors import ConfigError, DivergedError, PoseError
from fivebar_sim.motion import Motion
from fivebar_sim.simulation.plan import Plan, period_steps
from fivebar_sim.simulation.record import broken
from fivebar_sim.simulation.steps import States, Watch, check_states, is_broken, simulate_asking

MOTORS = slice(-4, None, 2)
"""Where qpos and qvel have A and E."""


class _Group(NamedTuple):
    """Plans whose leg, servo, sensors, controller and payload are equal: one call answers all."""

    rows: list[int]
    plan: Plan
    controller: Feedback
    step: ControlStep
    wanted: Reference


def steer(plans: Sequence[Plan], nthread: int, watch: Watch | None) -> States:
    """Return the states of plans with feedback controllers of one timestep, length and period.

    Raises:
        ConfigError: A controller that fails, or commands what is no finite (nsim, 2).
        DivergedError: A controller that cannot answer, as where the loop would not close, or a
            simulation that broke down on the way; says which.
    """
    groups = _groups(plans)
    every = groups[0].step.every
    steps = plans[0].scenario.steps
    h = plans[0].motion.timestep

    def ask(so_far: States) -> Array | None:
        k = so_far.time.shape[1]
        new = slice(max(k - every, 0), k)
        if is_broken(so_far, new):
            return None

        n = min(every, steps - k)
        ctrl = np.empty((len(plans), n, plans[0].model.nu))
        for row, plan in enumerate(plans):
            ctrl[row, :, :-2] = plan.pushes[k : k + n]

        for group in groups:
            own = slice(None) if len(groups) == 1 else group.rows
            group.step.moved(so_far.qpos[own, new, MOTORS], so_far.qvel[own, new, MOTORS])
            try:
                command = _command(group, k)
            except PoseError as error:
                row = group.rows[error.index[0] if error.index else 0]
                why = f"controller {plans[row].scenario.controller_name!r} has no answer: {error}"
                stopped = DivergedError(why, k * h)
                raise broken(plans[row], so_far.rows([row]), stopped) from error
            ctrl[group.rows, :, -2:] = group.step.send(k, command)
        return ctrl

    start = np.stack([plan.start for plan in plans])
    states = simulate_asking([plan.model for plan in plans], start, steps, ask, nthread, watch)
    if states.time.shape[1] < steps:  # the others' were ended with it
        _raise_broken(plans, states)

    return states


def _raise_broken(plans: Sequence[Plan], states: States) -> None:
    """Raise the error of the first plan whose simulation broke down."""
    for row, plan in enumerate(plans):
        own = states.rows([row])
        try:
            check_states(own, plan.motion.timestep)
        except DivergedError as error:
            raise broken(plan, own, error) from None


def _groups(plans: Sequence[Plan]) -> list[_Group]:
    """Return the plans by what they have in common."""
    members: dict[tuple, list[int]] = {}
    for row, plan in enumerate(plans):
        s = plan.scenario
        kind = (s.leg, s.servo, s.sensors, _hashable(s.controller), plan.motion.payload)
        members.setdefault(kind, []).append(row)
    return [_group([plans[row] for row in rows], rows) for rows in members.values()]


def _hashable(controller: object) -> object:
    """Return a controller, or of one that cannot be hashed, as a user's may be, which one it is."""
    try:
        hash(controller)
    except TypeError:
        return id(controller)
    return controller


def _group(plans: list[Plan], rows: list[int]) -> _Group:
    plan = plans[0]
    s = plans[0].scenario
    controller = cast(Feedback, s.controller)
    step = ControlStep(
        s.servo,
        s.sensors,
        controller.drive,
        timestep=plan.motion.timestep,
        every=period_steps(plan),
        steps=s.steps,
        start=np.stack([p.motion.q[0, ::2] for p in plans]),
        seeds=[p.scenario.sim.seed for p in plans],
    )

    return _Group(rows, plan, controller, step, _references([p.motion for p in plans]))


def _references(motions: list[Motion]) -> Reference:
    """Return the references of all steps, arrays of shape (nsim, N + 1, 2)."""
    q, q_dot, q_ddot = (
        np.stack([getattr(m, name)[:, ::2] for m in motions]) for name in ("q", "q_dot", "q_ddot")
    )
    foot, foot_dot, foot_ddot, force = (
        np.stack([getattr(m, name) for m in motions])
        for name in ("foot", "foot_dot", "foot_ddot", "force")
    )
    payload = np.array([m.payload for m in motions])
    return Reference(foot, foot_dot, foot_ddot, q, q_dot, q_ddot, force, float(payload[0]))


def _command(group: _Group, k: int) -> Array:
    """Return what a controller commands at step k, checked, (nsim, 2).

    Raises:
        PoseError: It has no answer in a pose, or one that is not finite or no setpoint.
        ConfigError: It fails otherwise, or answers with another shape.
    """
    s = group.plan.scenario
    shape = (len(group.rows), 2)
    arrays = [field[:, k] for field in group.wanted[:-1]]
    wanted = Reference(*arrays, payload=group.wanted.payload)
    name = s.controller_name
    seen = group.step.observe(k)
    command = answer_of(name, lambda: group.controller.command(s.leg, s.servo, seen, wanted))
    if not is_numbers(command, shape):
        raise ConfigError(
            f"controller {name!r} must command numbers of shape {shape}, "
            f"got {command.dtype} of shape {command.shape}"
        )

    if not np.isfinite(command).all():
        bad = ~np.isfinite(command).all(axis=1)
        raise PoseError("its command is not finite", (int(np.argmax(bad)),))

    if group.controller.drive == "position":
        _check_near(command, seen.theta)
    return command


def _check_near(command: Array, theta: Array) -> None:
    """Raise if a setpoint is farther from the angle that is seen than a servo can mean.

    Raises:
        PoseError: Says of which motor, and how far.
    """
    away = np.abs(command - theta)
    row, motor = np.unravel_index(int(np.argmax(away)), away.shape)
    name = "AE"[motor]
    if not away[row, motor] <= FARTHEST:
        raise PoseError(
            f"its setpoints must be within {FARTHEST:.4g} rad (half a turn) of the motors' angles, "
            f"got one for {name} that is {away[row, motor]:.4g} rad away",
            (int(row),),
        )
