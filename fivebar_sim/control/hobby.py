"""Hobby servos at A and E: the angles to command for given motor angles, and what rounding costs.

A servo takes an angle within its range, in whole steps. Theta is anticlockwise from +x of the hip
frame; the servos are mounted on AE, which is turned by `tilt`, and count from there:

    commanded = offset + direction (theta - tilt), plus whole turns, rounded to the nearest step

The published controller sends 90 deg + angle in whole degrees, 0..180 deg, on both sides: that is
`PUBLISHED`. It fits a leg that stands upright with both cranks between -90 and 90 deg. A hanging
leg with its knees outwards has theta_A about -135 deg and theta_E about -45 deg, and the published
offset would put theta_A out of range; `HANGING`, the default, puts these two at mid-range.

Everything is in radians, commanded angles too: divide by the resolution for a count of steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, Bools, as_pairs, at, first_index
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, UnreachableError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import forward, knees
from fivebar_sim.kinematics.half_angle import principal
from fivebar_sim.kinematics.planar import dot, wrap
from fivebar_sim.kinematics.rates import jacobian

TURN = 2.0 * math.pi

TIE = 1e-9
"""How far an angle may be off a half step, or off an end of the range, and still count as on it, as
a fraction of a step: degrees converted to radians are rounded."""


@dataclass(frozen=True, slots=True)
class HobbyServo:
    """One servo: how its commanded angle follows from the motor angle.

    Attributes:
        offset: Commanded angle at theta = tilt [rad].
        direction: +1 if it grows with theta (anticlockwise), -1 if the servo is mounted mirrored.
        range: (low, high) of the commanded angle [rad], both ends legal; at most one turn, and a
            whole number of steps.
        resolution: One step of the commanded angle [rad]; steps are counted from `low`.
    """

    offset: float
    direction: int = 1
    range: tuple[float, float] = (0.0, math.pi)
    resolution: float = math.pi / 180.0

    def __post_init__(self) -> None:
        check_number("offset", self.offset, "rad")
        # Checked by type too: 1.0 and True equal 1, and neither is a direction.
        if self.direction not in (-1, 1) or type(self.direction) is not int:
            raise ArgumentError(f"direction must be -1 or 1, got {self.direction!r}")
        if not isinstance(self.range, tuple) or len(self.range) != 2:
            raise ArgumentError(f"range must be (low, high) [rad], got {self.range!r}")

        for end in self.range:
            check_number("range", end, "rad")

        low, high = self.range
        # Wider than a turn, an angle would have two commands in the range.
        if not 0.0 < high - low <= TURN * (1.0 + TIE):
            raise ArgumentError(f"range must be in (0, {TURN:g}] rad wide, got {self.range!r}")

        check_number("resolution", self.resolution, "rad", low=0.0, high=high - low)
        if not self.resolution > 0.0 or abs((high - low) / self.resolution - self.steps) > 1e-6:
            raise ArgumentError(
                f"resolution must be {high - low:g} rad, the width of the range, over a whole "
                f"number of steps, got {self.resolution!r}"
            )

    @property
    def steps(self) -> int:
        """The number of steps from one end of the range to the other."""
        return round((self.range[1] - self.range[0]) / self.resolution)

    @property
    def half_step(self) -> float:
        """The largest change of an angle by rounding [rad]."""
        return (0.5 + TIE) * self.resolution


@dataclass(frozen=True, slots=True)
class ServoTable:
    """The servos of both motors.

    Attributes:
        A: The servo at A.
        E: The servo at E.
    """

    A: HobbyServo
    E: HobbyServo


PUBLISHED = ServoTable(HobbyServo(math.pi / 2.0), HobbyServo(math.pi / 2.0))
"""90 deg + angle, 0..180 deg, whole degrees: for an upright leg."""

HANGING = ServoTable(HobbyServo(1.25 * math.pi), HobbyServo(0.75 * math.pi))
"""225 deg + theta_A and 135 deg + theta_E, 0..180 deg, whole degrees: theta_A in -225..-45 deg and
theta_E in -135..45 deg, a half turn about cranks that point 45 deg outwards and down."""


class RoundingBound(NamedTuple):
    """Bound on how far rounding moves the foot [m], in two parts, each of shape (...).

    Attributes:
        first: First order in the step: half a step on each servo, through the Jacobian.
        remainder: All higher orders; inf where rounding may bring B, C and D in line.
    """

    first: Array
    remainder: Array

    @property
    def total(self) -> Array:
        """The sum of both [m]."""
        return self.first + self.remainder


def servo_angles(leg: FiveBar, theta: ArrayLike, table: ServoTable = HANGING) -> Array:
    """Return the commanded angles, rounded to the servos' steps, but in radians.

        angle = offset + direction (theta - tilt)
        commanded = low + resolution floor((angle - low) / resolution + 1/2)

    with whole turns added to the angle where that brings it into the range. A half step, to within
    `TIE`, goes up.

    Args:
        leg: The leg; only its tilt is used.
        theta: (theta_A, theta_E) [rad], (..., 2).
        table: The servos.

    Returns:
        Commanded angles of the servos at A and E [rad], whole steps from `low`, (..., 2).

    Raises:
        UnreachableError: Unless low <= commanded <= high in every pose; `.index` is the first pose
            out of range.
        ArgumentError: A shape other than (..., 2), or angles that are not finite.
    """
    theta = _finite_pairs(theta, "theta")
    commanded = np.empty(theta.shape)
    beyond = np.empty(theta.shape, dtype=bool)
    for side, servo in enumerate((table.A, table.E)):
        low, high = servo.range
        middle = 0.5 * (low + high)
        angle = servo.offset + servo.direction * (theta[..., side] - leg.tilt)
        # The whole turn nearest to mid-range: no other can be within a range of at most a turn.
        angle = middle + wrap(angle - middle)
        steps = (angle - low) / servo.resolution
        beyond[..., side] = ~((steps >= -TIE) & (steps <= servo.steps + TIE))
        # Angles past an end by less than TIE were let pass: here they go to that end.
        whole = np.clip(np.floor(steps + 0.5 + TIE), 0, servo.steps)
        commanded[..., side] = np.where(
            beyond[..., side], angle, low + whole * ((high - low) / servo.steps)
        )

    if beyond.any():
        raise _beyond_range(commanded, beyond, table)
    return commanded


def joint_angles(leg: FiveBar, commanded: ArrayLike, table: ServoTable = HANGING) -> Array:
    """Return the motor angles of commanded angles, theta = tilt + direction (commanded - offset).

    Args:
        leg: The leg; only its tilt is used.
        commanded: Commanded angles of the servos at A and E [rad], whole steps or not, (..., 2).
        table: The servos.

    Returns:
        (theta_A, theta_E) [rad] in (-pi, pi], (..., 2).

    Raises:
        UnreachableError: Unless low <= commanded <= high in every pose; `.index` is the first pose
            out of range.
        ArgumentError: A shape other than (..., 2), or angles that are not finite.
    """
    commanded = _finite_pairs(commanded, "commanded")
    servos = (table.A, table.E)
    low, high = np.array([servo.range for servo in servos]).T
    slack = TIE * np.array([servo.resolution for servo in servos])
    beyond = ~((commanded >= low - slack) & (commanded <= high + slack))
    if beyond.any():
        raise _beyond_range(commanded, beyond, table)
    offset = np.array([servo.offset for servo in servos])
    direction = np.array([servo.direction for servo in servos])
    return principal(leg.tilt + direction * (commanded - offset))


def rounding_error(leg: FiveBar, theta: ArrayLike, table: ServoTable = HANGING) -> Array:
    """Return how far the servos' rounding moves the foot, forward(rounded) - forward(theta).

    Exact, in the leg's own assembly mode.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        table: The servos.

    Returns:
        The shift of F [m], hip frame, (..., 2).

    Raises:
        UnreachableError: Where an angle is out of a servo's range.
        LoopOpenError: Where the links do not meet at the angles, or at the rounded ones.
    """
    rounded = joint_angles(leg, servo_angles(leg, theta, table), table)
    return forward(leg, rounded) - forward(leg, theta)


def rounding_bound(leg: FiveBar, theta: ArrayLike, table: ServoTable = HANGING) -> RoundingBound:
    """Return how far the servos' rounding can move the foot at most, wherever their steps lie.

    With h_A, h_E half a step, lam = L6 / L2, d = |BD| and gamma the angle at C:

        first = |J_:A| h_A + |J_:E| h_E
        remainder = ((1 + lam) a + lam L1 h_A^2) / 2
        a = (L1 h_A^2 + L4 h_E^2 + (1/L2 + 1/L3) (k / s)^2) / s
        k = L1 h_A + L4 h_E,   s = least sin(gamma) for |BD| within d -+ k

    On the straight line from theta to the rounded angles let a dot be d/dt, t from 0 to 1. B and D
    move by no more than k against each other, so sin(gamma) >= s: gamma grows with |BD|, and its
    sine is least at an end of the interval. L2 and L3 turn with |psi_2_dot| <= k / (L2 s) and
    |psi_3_dot| <= k / (L3 s). C obeys, along the directions u of BC and v of DC,

        u . C_ddot = u . B_ddot - L2 psi_2_dot^2,   v . C_ddot = v . D_ddot - L3 psi_3_dot^2

    with |B_ddot| <= L1 h_A^2, |D_ddot| <= L4 h_E^2 and |u x v| >= s, so |C_ddot| is at most a.
    F_ddot = C_ddot + lam R(bend) (C_ddot - B_ddot), and the foot is off its tangent by at most half
    the greatest |F_ddot|.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        table: The servos; only their resolutions are used.

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where B, C and D are in line.
    """
    theta = _finite_pairs(theta, "theta")
    h_A = table.A.half_step
    h_E = table.E.half_step
    J = jacobian(leg, theta)
    first = np.hypot(J[..., 0, 0], J[..., 1, 0]) * h_A + np.hypot(J[..., 0, 1], J[..., 1, 1]) * h_E

    k = leg.L1 * h_A + leg.L4 * h_E
    lam = leg.L6 / leg.L2
    B, D = knees(leg, theta)
    d = np.sqrt(dot(D - B, D - B))
    s = np.minimum(_sine_at_C(leg, d - k), _sine_at_C(leg, d + k))

    # Where rounding may bring B, C and D in line s is 0, and the bound is inf.
    with np.errstate(divide="ignore"):
        turning = (1.0 / leg.L2 + 1.0 / leg.L3) * (k / s) ** 2
        C_ddot = (leg.L1 * h_A**2 + leg.L4 * h_E**2 + turning) / s
    return RoundingBound(first, 0.5 * ((1.0 + lam) * C_ddot + lam * leg.L1 * h_A**2))


def _sine_at_C(leg: FiveBar, d: Array) -> Array:
    """Return the sine of the angle at C for |BD| = d [m], and 0 where the triangle cannot close."""
    high = leg.L2 + leg.L3
    low = leg.L2 - leg.L3
    # Heron's formula with 4 area = 2 L2 L3 sin; outside of the triangle the product is negative.
    square = (high**2 - d**2) * (d**2 - low**2)
    return np.where(d > 0.0, np.sqrt(np.maximum(square, 0.0)), 0.0) / (2.0 * leg.L2 * leg.L3)


def _finite_pairs(values: ArrayLike, name: str) -> Array:
    """Return values as finite float64 pairs (..., 2), or raise ArgumentError."""
    pairs = as_pairs(values, name)
    if not np.isfinite(pairs).all():
        index = first_index(~np.isfinite(pairs))[:-1]
        raise ArgumentError(f"{name} must be finite [rad], got {pairs[index].tolist()}{at(index)}")
    return pairs


def _beyond_range(commanded: Array, beyond: Bools, table: ServoTable) -> UnreachableError:
    """Return the error for commanded angles that are not all in their servo's range."""
    bad = np.logical_not((~beyond).all(axis=-1))
    index = first_index(bad)
    side = int(np.argmax(beyond[index]))
    low, high = (table.A, table.E)[side].range
    came = float(commanded[index][side])
    count = f"{int(bad.sum())} of {bad.size} poses are" if bad.ndim else "the pose is"

    return UnreachableError(
        f"{count} beyond a servo's range: the commanded angle at {'AE'[side]} must be in "
        f"[{np.degrees(low):g}, {np.degrees(high):g}] deg ([{low:g}, {high:g}] rad), got "
        f"{np.degrees(came):g} deg ({came:g} rad){at(index)}",
        index,
    )
