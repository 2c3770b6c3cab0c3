"""The numbers of a group of legs, put on the present device for the kernels of its episodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control import delay
from fivebar_sim.control.servo import Servo
from fivebar_sim.kinematics.leg_arrays import LENGTHS, LegArrays
from fivebar_sim.tasks import KINDS, Gait, Task
from fivebar_sim.tasks.base import ACTIONS
from fivebar_sim.tasks.episodes import ROUNDINGS
from fivebar_sim.warp import device as devices

MOST_TERMS = 3
"""Reward terms of a task, at most."""


def group_of(task: Task, drawn: Sequence[Task], starts: Array) -> Any:
    """Return what never changes of a group, on the present device; see `structs.Group`.

    Args:
        task: The nominal task.
        drawn: The task with each leg's own numbers, n of them.
        starts: Poses at rest, (n or 1, m, nq).
    """
    group = devices.kernels("episodes.structs").Group()
    _tell_task(group, task)
    _tell_legs(group, drawn)
    _tell_servos(group, task, [each.servo for each in drawn])
    group.starts = sent(starts)
    return group


def _tell_task(group: Any, task: Task) -> None:
    """Write the numbers of a task."""
    low, high = task.bounds
    largest = np.maximum(np.abs(low), np.abs(high)).astype(np.float32)
    weights = np.zeros(MOST_TERMS)
    weights[: len(task.WEIGHTS)] = [task.weight(name) for name in task.WEIGHTS]

    group.kind = list(KINDS).index(task.kind)
    group.action = ACTIONS.index(task.action)
    group.every = task.every
    group.periods = task.periods
    group.grounded = int(task.GROUNDED)
    group.late = int(task.integrator == "discrete")
    group.size = task.leg.size
    group.speed = task.foot_path.stance_speed if isinstance(task, Gait) else 0.0
    group.low = sent(low)
    group.high = sent(high)
    group.slack = sent(ROUNDINGS * np.spacing(largest))
    group.weights = sent(weights)
    group.targets = sent(np.concatenate(list(task.targets().values()), axis=1))

    steps = task.periods * task.every
    group.seen_step = task.sensors.resolution
    group.seen_part = delay.in_steps(task.sensors.delay, task.timestep, steps)[1]


def _tell_legs(group: Any, drawn: Sequence[Task]) -> None:
    """Write the legs' lengths, and what all of them share."""
    legs = LegArrays.of([each.leg for each in drawn])
    group.s_A = float(legs.mode[0])
    group.s_E = float(legs.mode[1])
    group.assembly = float(legs.assembly)
    group.tilt = legs.tilt
    group.bend = legs.bend
    group.foot_radius = legs.foot_radius
    group.lengths = sent(np.concatenate([getattr(legs, name) for name in LENGTHS], axis=1))


def _tell_servos(group: Any, task: Task, servos: Sequence[Servo]) -> None:
    """Write the servos' gains, and the bus that they hang on."""
    first = servos[0]
    group.clips = int(first.limit is not None)
    group.limit = first.limit or 0.0
    group.back_emf = first.back_emf
    group.command_step = first.resolution

    # The gear's friction damps too, but is not part of the motor's torque.
    free = [
        each.kd if each.limit is None and task.drive == "position" else each.back_emf
        for each in servos
    ]
    gains = [(each.kp, each.kd, each.damping / each.kp) for each in servos]
    group.servo = sent(np.column_stack([gains, free]))

    steps = task.periods * task.every
    late = [each.late(steps, task.timestep) for each in servos]
    group.lag = sent(np.array([whole for whole, _ in late]), int)
    group.part = sent(np.array([part for _, part in late]))
    group.hold = sent(np.array([held(each, steps, task.timestep) for each in servos]), int)


def held(servo: Servo, steps: int, timestep: float) -> int:
    """Return the timesteps for which a command on the bus is held; see `Servo.latched`."""
    if servo.rate is None:
        return 1
    part = servo.rate * timestep
    return max(1, round(1.0 / part) if part * steps > 1.0 else steps)


def now_of(task: Task, group: Any, n: int) -> Any:
    """Return where n legs are, before their first episode; see `structs.Now`."""
    wp = devices.warp()
    now = devices.kernels("episodes.structs").Now()
    for name in ("count", "fresh", "over", "broken"):
        setattr(now, name, wp.zeros(n, dtype=int))

    nq = group.starts.shape[2]
    for name, width in {"q": nq, "v": nq, "rest": 2, "begun": 2, "before": 2, "effort": 2}.items():
        setattr(now, name, wp.zeros((n, width), dtype=float))
    now.sent = wp.zeros((n, kept_periods(task, group), 2), dtype=float)

    steps = task.periods * task.every
    late, part = delay.in_steps(task.sensors.delay, task.timestep, steps)
    rows = late + 1 + (part > 0.0)
    now.seen_q = wp.zeros((n, rows, 2), dtype=float)
    now.seen_v = wp.zeros((n, rows, 2), dtype=float)
    now.tick = wp.zeros(1, dtype=int)
    now.random = wp.zeros((n, 6), dtype=wp.uint64)
    return now


def kept_periods(task: Task, group: Any) -> int:
    """Return how many commands of each leg are kept: as many as may still be on their way."""
    oldest = int(group.lag.numpy().max()) + 1 + int(group.hold.numpy().max())
    return min(task.periods, oldest // task.every + 2)


def shown_of(task: Task, n: int) -> Any:
    """Return where agents of n legs find what they get; see `structs.Shown`."""
    wp = devices.warp()
    shown = devices.kernels("episodes.structs").Shown()
    size = sum(part.size for part in task.parts.values())
    shown.observation = wp.zeros((n, size), dtype=float)
    shown.last = wp.zeros((n, size), dtype=float)
    shown.terms = wp.zeros((MOST_TERMS, n), dtype=float)
    shown.reward = wp.zeros(n, dtype=float)
    shown.reason = wp.zeros(n, dtype=int)
    for name in ("terminated", "truncated", "ended"):
        setattr(shown, name, wp.zeros(n, dtype=wp.bool))
    return shown


def generators(random: Sequence[np.random.Generator]) -> Any:
    """Return the states of generators PCG64, (n, 6); see `draws`."""
    half = 2**64
    rows = []
    for each in random:
        kept = each.bit_generator.state
        state = kept["state"]["state"]
        step = kept["state"]["inc"]
        left = kept["has_uint32"], kept["uinteger"]
        rows.append((state // half, state % half, step // half, step % half, *left))
    return np.array(rows, dtype=np.uint64)


def sent(values: Any, kind: type[int | float] = float) -> Any:
    """Return values as an array of the present device, in single precision."""
    host = np.ascontiguousarray(values, dtype=np.float32 if kind is float else np.int32)
    return devices.warp().array(host, dtype=kind)
