"""Servos and gaits as the firmware maps them: the same bits as `firmware/fivebar_leg.c`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.firmware.elementary import LARGEST_ANGLE, Real, magnitude, numbers, within_turn
from fivebar_sim.firmware.status import Status, Statuses, first_of, then

TIE = 2.0**-10
"""How far beyond an end of its range a command still counts as on it, in steps."""

MOST_COMMAND = 1_000_000
"""Largest command, of either sign."""

FARTHEST = 1e6
"""Largest phase of a periodic gait, of either sign [periods]."""


class FirmwareServo(NamedTuple):
    """A servo that takes commands first .. last at equal steps of angle: `fivebar_servo`.

        angle = offset + direction theta, plus whole turns, in [low, high]
        command = first + (angle - low) (last - first) / (high - low), to the nearest, half up

    Attributes:
        offset: Angle of the servo at theta = 0 [rad].
        direction: +1 if it grows with theta, -1 if the servo is mounted mirrored.
        low: Least angle of the servo [rad].
        high: Greatest, at most a turn above [rad].
        first: Command at low.
        last: Command at high.
    """

    offset: float
    direction: int
    low: float
    high: float
    first: int
    last: int


def servo_command(
    servo: FirmwareServo, theta: ArrayLike, kind: type[np.floating] = np.float32
) -> tuple[NDArray[np.int32], Statuses]:
    """Return the commands of motor angles, (...), 0 where there is none, and statuses.

    Args:
        servo: The servo.
        theta: Motor angles [rad], (...).
        kind: np.float32, or np.float64 for -DFIVEBAR_DOUBLE.
    """
    angle = np.asarray(theta, dtype=kind)
    offset, low, high = (kind(x) for x in (servo.offset, servo.low, servo.high))
    with np.errstate(all="ignore"):
        half = kind(0.5) * (high - low)
        from_middle = (offset - (low + half)) + kind(servo.direction) * angle
        far = ~(magnitude(from_middle) <= LARGEST_ANGLE)
        span = kind(servo.last - servo.first)
        near = within_turn(np.where(far, kind(0.0), from_middle))
        steps = (near + half) * (span / (high - low))
        beyond = ~((steps >= -TIE) & (steps <= span + kind(TIE)))
        status = first_of(
            (~np.isfinite(angle), Status.NOT_FINITE),
        )
        status = then(status, _check(servo, kind, status))
        status = then(status, first_of((far | beyond, Status.OUT_OF_LIMITS)))
        whole = np.trunc(np.where(status == Status.OK, steps, kind(0.0)) + kind(0.5))
    command = np.int32(servo.first) + whole.astype(np.int32)

    return np.where(status == Status.OK, command, np.int32(0)), status


def servo_angle(
    servo: FirmwareServo, command: ArrayLike, kind: type[np.floating] = np.float32
) -> tuple[Real, Statuses]:
    """Return the motor angles of commands in (-pi, pi] [rad], (...), and statuses.

    Args:
        servo: The servo.
        command: Commands, (...).
        kind: np.float32, or np.float64 for -DFIVEBAR_DOUBLE.
    """
    count = np.asarray(command, dtype=np.int64)
    offset, low, high = (kind(x) for x in (servo.offset, servo.low, servo.high))
    outside = (count < servo.first) | (count > servo.last)
    status = _check(servo, kind, np.zeros(count.shape, dtype=np.int32))
    status = then(status, first_of((outside, Status.OUT_OF_LIMITS)))
    steps = np.where(outside, 0, count - servo.first).astype(kind)
    with np.errstate(all="ignore"):
        span = kind(servo.last - servo.first)
        angle = (low - offset) + steps * ((high - low) / span)
        far = ~(magnitude(angle) <= LARGEST_ANGLE)
        near = within_turn(kind(servo.direction) * np.where(far, kind(0.0), angle))
    status = then(status, first_of((far, Status.OUT_OF_LIMITS)))
    pi = kind(numbers(near).pi)
    theta = np.where((near <= -pi) | (near > pi), pi, near)

    return np.where(status == Status.OK, theta, kind(np.nan)), status


def gait_at(theta: ArrayLike, periodic: bool, phase: ArrayLike) -> tuple[Real, Statuses]:
    """Return the setpoints at phases, linear between rows, (..., 2), and statuses.

    Args:
        theta: The table's rows (theta_A, theta_E) [rad], float32 or float64, (n, 2).
        periodic: Whether row 0 comes again after the last.
        phase: Phase 1 is a whole period: any within a million periods where periodic, else 0..1.
    """
    table = np.asarray(theta)
    kind = table.dtype.type
    f = np.asarray(phase, dtype=kind)
    rows = kind(len(table))
    with np.errstate(all="ignore"):
        if periodic:
            beyond = ~(magnitude(f) <= FARTHEST)
            kept = np.where(beyond, kind(0.0), f)
            part = kept - np.trunc(kept)
            part = np.where(part < 0.0, part + kind(1.0), part)
            place = part * rows
            # Both may round up to the next period.
            place = np.where(place < rows, place, kind(0.0))
        else:
            beyond = ~((f >= 0.0) & (f <= 1.0))
            place = np.where(beyond, kind(0.0), f) * (rows - kind(1.0))

    status = first_of(
        (~np.isfinite(f), Status.NOT_FINITE),
        (np.full(f.shape, len(table) < 2), Status.BAD_ARGUMENT),
        (beyond, Status.OUT_OF_LIMITS),
    )
    row = np.trunc(place).astype(np.int32)
    last = 0 if periodic else len(table) - 1
    following = np.where(row + 1 < len(table), row + 1, last)
    fraction = (place - row.astype(kind))[..., None]
    between = table[row] + fraction * (table[following] - table[row])
    return np.where((status == Status.OK)[..., None], between, kind(np.nan)), status


def _check(servo: FirmwareServo, kind: type[np.floating], like: Statuses) -> Statuses:
    """Return the status of a servo, in the shape of others."""
    offset, low, high = (kind(x) for x in (servo.offset, servo.low, servo.high))
    n = numbers(np.zeros(0, dtype=kind))
    turn = (kind(2.0) * kind(n.pi)) * (kind(1.0) + kind(8.0) * kind(n.epsilon))
    finite = bool(np.isfinite([offset, low, high]).all())
    ranged = bool(low < high) and bool(high - low <= turn) and servo.direction in (-1, 1)
    ordered = -MOST_COMMAND <= servo.first < servo.last <= MOST_COMMAND
    every = np.ones_like(like, dtype=bool)
    return first_of(
        (every & (not finite), Status.NOT_FINITE),
        (every & (not (ranged and ordered)), Status.BAD_ARGUMENT),
    )
