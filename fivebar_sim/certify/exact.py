"""Exact answers, in double precision, and how far a program of a stated precision may be off.

A program rounds its numbers some times on its way, each time by at most h = 2^-24 (float32) or
2^-53 (float64) of them; u = `ROUNDINGS` h is what that comes to. Its answer is the exact one for
lengths and points moved by u times the leg's size, and that is what the tolerances say:

- An angle of a side chain with links `near` and `far` to a point at the distance d is alpha + s
  beta. The direction alpha moves by p / d, with p = u size, and cos beta by
  w = p (near + far + d) / (near d), so beta by at most 2 w / (sin beta + sqrt(2 w)): w / sin beta,
  but never more than the root that full stretch and the fold have.
- Anything else is smooth where it is asked for: its slopes with each input, times u of the input.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fivebar_sim import kinematics, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.errors import LoopOpenError, SingularError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics import reach

ROUNDINGS = 16
"""Roundings that an answer may have gone through, all in one direction. The published two-triangle
form has about ten one after the other: two squares, their sum, N, the root, two products, atan2."""

HALF_ULPS = (2.0**-24, 2.0**-53)
"""One rounding of float32 and of float64, relative."""

KEYS = ("L1", "L2", "L3", "L4", "L5", "L6", "bend", "tilt")
"""The numbers of a leg, in the order in which they are sent."""

STEP = 1e-5
"""Step of the differences that give the slopes, relative."""


class Answer(NamedTuple):
    """The exact numbers, () for a refusal; tolerances; and whether a refusal is right as well."""

    numbers: tuple[float, ...]
    within: tuple[float, float]
    may_refuse: bool


REFUSE = Answer((), (0.0, 0.0), may_refuse=True)


def answer(leg: FiveBar, kind: str, values: Sequence[float]) -> Answer:
    """Return the answer to a question.

    Args:
        leg: The leg.
        kind: One of `suite.ANSWERS`.
        values: The inputs; for `inverse` s_A, s_E, x, z; for `nearest` x, z; else the assembly
            mode first.
    """
    if not all(map(math.isfinite, values)):
        return REFUSE
    if kind == "inverse":
        return _inverse(leg, values)
    # The others have a sign first.
    if kind == "nearest":
        values = [0, *values]
    try:
        numbers = evaluate(leg, kind, values)
    except (LoopOpenError, SingularError):
        return REFUSE

    slack = _slack(leg, kind, values)
    first = ROUNDINGS * HALF_ULPS[0]
    second = ROUNDINGS * HALF_ULPS[1]
    return Answer(tuple(numbers.tolist()), (first * slack, second * slack), may_refuse=False)


def evaluate(leg: FiveBar, kind: str, values: Sequence[float]) -> Array:
    """Return the numbers that answer a question about given motor angles, or a given point.

    Raises:
        LoopOpenError: The links do not meet.
        SingularError: The Jacobian is infinite.
    """
    assembly = int(values[0])
    theta = np.array(values[1:3])
    if kind == "nearest":
        return workspace.nearest(leg, theta)
    if kind == "forward":
        return kinematics.forward(leg, theta, assembly)
    if kind == "knees":
        return np.concatenate(kinematics.knees(leg, theta))

    J = kinematics.jacobian(leg, theta, assembly)
    if kind == "jacobian":
        return J.ravel()
    return -J.T @ np.array(values[3:5])


def _slack(leg: FiveBar, kind: str, values: Sequence[float]) -> float:
    """Return the sum of |slope| times the input's size, over all inputs, and the answer's own."""
    lengths = [getattr(leg, key) for key in KEYS]
    point = np.array([*lengths, *values[1:]])
    # Two angles follow on bend and tilt, or the point.
    unit = leg.size if kind == "nearest" else np.pi
    sizes = np.array([*[leg.size] * 6, np.pi, np.pi, unit, unit, *[abs(v) for v in values[3:]]])
    total = np.abs(_at(leg, kind, values[0], point)).max()

    for k, size in enumerate(sizes):
        # A length of 0 cannot be made less: the difference is taken on the other side alone.
        low = point.copy()
        low[k] -= 0.0 if k in (4, 5) and point[k] == 0.0 else STEP * size
        high = point.copy()
        high[k] += STEP * size
        if high[k] == low[k]:
            continue
        change = _at(leg, kind, values[0], high) - _at(leg, kind, values[0], low)
        total += np.abs(change).max() / (high[k] - low[k]) * size

    return float(total)


def _at(leg: FiveBar, kind: str, assembly: float, point: Array) -> Array:
    """Return an answer for other lengths and inputs; where there is none it is not smooth: 0."""
    moved = FiveBar(**dict(zip(KEYS, point[:8].tolist(), strict=True)), scale="any")
    try:
        return evaluate(moved, kind, [assembly, *point[8:]])
    except (LoopOpenError, SingularError):
        return np.zeros(1)


def _inverse(leg: FiveBar, values: Sequence[float]) -> Answer:
    """Return the angles of a working mode, also a little beyond the edge of reach."""
    s_A = int(values[0])
    s_E = int(values[1])
    foot = np.array(values[2:4])
    A, E = kinematics.bases(leg)
    theta, _ = reach.solve(leg, foot, (s_A, s_E))
    rho, _ = reach.foot_radius_and_angle(leg)
    C = foot if leg.L6 == 0.0 else reach.points_at(leg, foot, theta).C_left

    d_A = float(np.hypot(*(foot - A)))
    d_E = float(np.hypot(*(C - E)))
    gaps = (_gap(d_A, leg.L1, rho), _gap(d_E, leg.L4, leg.L3))
    within = []
    for h in HALF_ULPS:
        u = ROUNDINGS * h
        moved = u * leg.size
        error_A = _angle_error(d_A, leg.L1, rho, moved) + u
        # An error at A moves C, to which side E is solved.
        if leg.L6 > 0.0:
            moved += leg.L1 * error_A * (1.0 + leg.L2 / rho)
        within.append(max(error_A, _angle_error(d_E, leg.L4, leg.L3, moved) + u))

    doubt = ROUNDINGS * HALF_ULPS[0] * leg.size
    if min(gaps) < -doubt:
        return REFUSE
    answer = (float(theta[0]), float(theta[1]))
    return Answer(answer, (within[0], within[1]), may_refuse=min(gaps) < doubt)


def _gap(d: float, near: float, far: float) -> float:
    """Return how deep [m] within its ring a distance is; negative outside."""
    return min(d - abs(near - far), near + far - d)


def _angle_error(d: float, near: float, far: float, moved: float) -> float:
    """Return how far the angle of a side chain may be off; see the top of this file."""
    # Exactly on the motor any angle fits, and 0 is the agreed one.
    if d == 0.0:
        return 0.0
    w = moved * (near + far + d) / (near * d)
    cosine = (d * d + (near - far) * (near + far)) / (2.0 * near * d)
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    return moved / d + 2.0 * w / (sine + math.sqrt(2.0 * w))
