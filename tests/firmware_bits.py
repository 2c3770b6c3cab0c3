"""The digests of tests/firmware/bits.c in NumPy: the same legs and points, the same order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim import firmware
from fivebar_sim.firmware import FirmwareServo, Hip, Leg, Status

Words = NDArray[np.uint32]
Kind = type[Any]

PI = 3.1415926535897931
HIPS = (
    Hip(False, -1, 0.03, 0.01),
    Hip(True, 1, 0.02, -0.015),
    Hip(False, 1, 0.0, 0.0),
    Hip(True, -1, -0.04, 0.0),
)
SERVOS = (
    FirmwareServo(3.9269908169872414, 1, 0.0, PI, 0, 180),
    FirmwareServo(1.5707963267948966, -1, 0.0, PI, 500, 2500),
    FirmwareServo(0.0, 1, -PI, PI, 0, 4096),
    FirmwareServo(1.0, 1, 2.0, 1.0, 0, 10),
)
ROWS = ((-2.5, -0.75), (-2.25, -0.5), (-2.0, -0.25), (-2.25, -0.625), (-2.75, -0.875))


class Sums:
    """One running sum of bits for each sample."""

    def __init__(self, index: Words) -> None:
        self.sum = index.copy()

    def ints(self, values: ArrayLike, rows: Any = slice(None)) -> None:
        """Mix a whole number of each sample."""
        bits = np.asarray(values).astype(np.int32).view(np.uint32)
        s = (self.sum[rows] ^ bits) * np.uint32(16777619)
        self.sum[rows] = s ^ (s >> np.uint32(15))

    def reals(self, values: NDArray[Any], rows: Any = slice(None)) -> None:
        """Mix the numbers of each sample, (n, m): 0 where there is no answer."""
        kept = np.where(np.isnan(values), values.dtype.type(0.0), values)
        words = np.ascontiguousarray(kept).view(np.uint32)
        for k in range(words.shape[-1]):
            self.ints(words[:, k], rows)


def draw(index: Words, k: int) -> Words:
    """Return the k-th random number of each sample."""
    x = index * np.uint32(0x9E3779B1) + np.uint32(k * 0x85EBCA77 & 0xFFFFFFFF)
    x ^= x >> np.uint32(16)
    x *= np.uint32(0x85EBCA6B)
    x ^= x >> np.uint32(13)
    x *= np.uint32(0xC2B2AE35)
    return x ^ (x >> np.uint32(16))


def digests(first: int, count: int, block: int, kind: Kind = np.float32) -> list[str]:
    """Return what `bits FIRST COUNT BLOCK` prints, line by line."""
    return [_digest(start, block, kind) for start in range(first, first + count, block)]


def _digest(first: int, count: int, kind: Kind) -> str:
    index = np.arange(first, first + count, dtype=np.uint32)
    with np.errstate(all="ignore"):
        bits = bits_of(index, kind)
    plain = np.sum(bits, dtype=np.uint32)
    weighted = np.sum(bits * (np.uint32(2) * index + np.uint32(1)), dtype=np.uint32)
    return f"{(int(weighted) << 32) | int(plain):016x}"


def bits_of(index: Words, kind: Kind) -> Words:
    """Return one number for all that is computed of each sample, (n,)."""
    odd = draw(index, 30) & np.uint32(255)
    how = draw(index, 0)
    leg, status = firmware.prepare(_fields(index, how, odd, kind), kind)
    sums = Sums(index)
    sums.ints(status)

    # As in C, what is refused goes no further.
    good = np.flatnonzero(status == Status.OK)
    leg = _rows(leg, good)
    rest = Sums(sums.sum[good])
    _mix_all(rest, index[good], how[good], odd[good], leg, kind)
    sums.sum[good] = rest.sum
    return sums.sum


def _rows(leg: Any, rows: NDArray[np.intp]) -> Any:
    """Return the legs of some rows."""
    fields = (_rows(value, rows) if isinstance(value, tuple) else value[rows] for value in leg)
    return type(leg)(*fields)


def _mix_all(s: Sums, index: Words, how: Words, odd: Words, leg: Leg, kind: Kind) -> None:
    """Mix what is computed of usable legs."""
    for vector in (leg.A, leg.foot, leg.back):
        s.reals(vector)
    for chain in (leg.to_foot, leg.to_C, leg.knee_knee):
        s.reals(np.stack(chain, axis=-1))
    s.reals(leg.apart2[:, None])

    coarse = (how & 1) != 0
    s_A = _sign(how, 8)
    s_E = np.where(odd == 4, 0, _sign(how, 9))
    x = _place(index, 9, coarse, kind)
    x = np.where(odd == 5, kind(np.nan), np.where(odd == 6, kind(1e30), x))
    foot = np.stack([x, _place(index, 10, coarse, kind)], axis=-1)
    theta_A = _angle(index, 18, coarse, kind)
    theta_A = np.where(odd == 7, kind(np.inf), np.where(odd == 8, kind(100.0), theta_A))
    theta = np.stack([theta_A, _angle(index, 19, coarse, kind)], axis=-1)

    theta = _mix_angles(s, index, leg, foot, (s_A, s_E), theta)
    assembly = _sign(how, 7)
    _mix_points(s, index, leg, theta, assembly)
    for k in range(4):
        rows = np.flatnonzero(index & 3 == k)
        one = _rows(leg, rows)
        _mix_hip(s, rows, index[rows], one, HIPS[k], (foot, s_A, s_E, assembly))
        _mix_servo(s, rows, index[rows], SERVOS[k], theta[rows, 0])
    for periodic in (0, 1):
        rows = np.flatnonzero(index & 1 == periodic)
        phase = _between(index[rows], 17, kind, -1.5, 1.5)
        angles, status = firmware.gait_at(np.array(ROWS, dtype=kind), bool(periodic), phase)
        s.ints(status, rows)
        s.reals(angles, rows)


def _mix_angles(
    s: Sums, index: Words, leg: Leg, foot: Any, mode: tuple[Any, Any], theta: Any
) -> Any:
    """Mix the angles of feet; return those angles, or the drawn ones where there are none."""
    kind = foot.dtype.type
    angles, status = firmware.inverse(leg, foot, *mode)
    s.ints(status)
    s.reals(angles)
    theta = np.where((status == Status.OK)[:, None], angles, theta)

    every, each = firmware.inverse_all(leg, foot)
    own = np.where(leg.s_A > 0, 2, 0) + np.where(leg.s_E > 0, 1, 0)
    some = (each == Status.OK).any(axis=-1)
    s.ints(np.where(some, 0, each[np.arange(len(own)), own]))
    for k in range(4):
        s.ints(each[:, k])
        s.reals(every[:, k])
    fine = np.zeros(len(index), dtype=bool)
    now = np.stack([_angle(index, k, fine, kind) for k in (11, 12)], axis=-1)
    near, status = firmware.inverse_nearest(leg, foot, now)
    s.ints(status)
    s.reals(near)
    for elbow in (-1, 0, 1):
        s.ints(firmware.reaches(leg, foot, elbow))
    # With an extension it takes longer than all else together: every sixteenth will do.
    rows = np.flatnonzero((leg.L6 == 0.0) | (index & np.uint32(15) == 0))
    near, status = firmware.nearest(_rows(leg, rows), foot[rows])
    s.ints(status, rows)
    s.reals(near, rows)
    return theta


def _mix_points(s: Sums, index: Words, leg: Leg, theta: Any, assembly: Any) -> None:
    kind = theta.dtype.type
    F, status = firmware.forward(leg, theta, assembly)
    s.ints(status)
    s.reals(F)
    points, status = firmware.joints(leg, theta, assembly)
    s.ints(status)
    for point in points:
        s.reals(point)
    B, D, status = firmware.knees(leg, theta)
    s.ints(status)
    s.reals(B)
    s.reals(D)
    J, status = firmware.jacobian(leg, theta, assembly)
    s.ints(status)
    s.reals(J[:, 0])
    s.reals(J[:, 1])
    force = np.stack([_between(index, k, kind, -9.0, 9.0) for k in (13, 14)], axis=-1)
    tau, status = firmware.torque(leg, theta, assembly, force)
    s.ints(status)
    s.reals(tau)


def _mix_hip(s: Sums, rows: Any, index: Words, leg: Leg, hip: Hip, what: tuple[Any, ...]) -> None:
    foot, s_A, s_E, assembly = (values[rows] for values in what)
    kind = foot.dtype.type
    y = _place(index, 15, np.zeros(len(index), dtype=bool), kind)
    space = np.stack([foot[:, 0], y, foot[:, 1]], axis=-1)
    angles, status = firmware.hip_inverse(leg, hip, space, s_A, s_E)
    s.ints(status, rows)
    s.reals(angles, rows)
    # In C the angles stay 0 where there is no answer.
    angles = np.where(np.isnan(angles), kind(0.0), angles)
    back, status = firmware.hip_forward(leg, hip, angles, assembly)
    s.ints(status, rows)
    s.reals(back, rows)


def _mix_servo(s: Sums, rows: Any, index: Words, servo: FirmwareServo, theta: Any) -> None:
    kind = theta.dtype.type
    command, status = firmware.servo_command(servo, theta, kind)
    s.ints(status, rows)
    s.ints(command, rows)
    command = (draw(index, 16) % np.uint32(5000)).astype(np.int32) - 100
    back, status = firmware.servo_angle(servo, command, kind)
    s.ints(status, rows)
    s.reals(back[:, None], rows)


def _fields(index: Words, how: Words, odd: Words, kind: Kind) -> dict[str, Any]:
    """Return the legs: every other one on a coarse grid, a few that must be refused."""
    coarse = (how & 1) != 0
    zero = kind(0.0)
    L1, L2, L3, L4, L5, L6 = (_length(index, k, coarse, kind) for k in range(1, 7))
    bend, tilt = (np.where(coarse, zero, _between(index, k, kind, -3.14, 3.14)) for k in (7, 8))
    return {
        "L1": np.where(odd == 1, kind(np.inf), L1),
        "L2": np.where(odd == 0, kind(np.nan), L2),
        "L3": np.where(odd == 2, kind(1e-5), L3),
        "L4": L4,
        "L5": np.where((how & 6) == 0, zero, L5),
        "L6": np.where((how & 8) != 0, zero, L6 * kind(0.5)),
        "bend": bend,
        "tilt": tilt,
        "s_A": np.where(odd == 3, 0, _sign(how, 4)),
        "s_E": _sign(how, 5),
        "assembly": _sign(how, 6),
    }


def _sign(how: Words, bit: int) -> NDArray[np.int32]:
    return np.where((how >> np.uint32(bit)) & 1, 1, -1).astype(np.int32)


def _between(index: Words, k: int, kind: Kind, low: float, high: float) -> Any:
    part = (draw(index, k) >> np.uint32(8)).astype(kind) * kind(2.0**-24)
    return kind(low) + (kind(high) - kind(low)) * part


def _length(index: Words, k: int, coarse: Any, kind: Kind) -> Any:
    grid = (1 + (draw(index, k) & 7)).astype(kind) * kind(0.015625)
    return np.where(coarse, grid, _between(index, k, kind, 0.01, 0.1))


def _place(index: Words, k: int, coarse: Any, kind: Kind) -> Any:
    grid = ((draw(index, k) % 33).astype(kind) - kind(16.0)) * kind(0.015625)
    return np.where(coarse, grid, _between(index, k, kind, -0.15, 0.15))


def _angle(index: Words, k: int, coarse: Any, kind: Kind) -> Any:
    grid = ((draw(index, k) % 17).astype(kind) - kind(8.0)) * kind(0.78539816339744828)
    return np.where(coarse, grid, _between(index, k, kind, -4.0, 4.0))
