r"""Two-link legs for comparison with the five-bar's load sharing: serial leg, crouching leg.

  A            A  hip, driven; origin, x forward, z up; theta_A anticlockwise from +x to +z
L1 \           B  knee, driven; theta_B turns L1's direction into L2's
    B          F  foot; angles, sign of the knee and foot force are as on side A of the five-bar
L2 /
  F
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, Bools, as_pairs, at, broadcast, finite, first_index
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, GeometryError, SingularError, UnreachableError
from fivebar_sim.geometry import LONGEST
from fivebar_sim.kinematics.closure import ROUNDING
from fivebar_sim.kinematics.planar import angle_between, cross, perp, unit
from fivebar_sim.kinematics.rates import SINGULAR
from fivebar_sim.kinematics.reach import side_angle


@dataclass(frozen=True, slots=True)
class SerialLeg:
    """The serial 2R leg.

    Attributes:
        L1: Femur |AB| [m].
        L2: Tibia |BF| [m].
        knee: Solution that `inverse` returns, the sign of AF x AB: +1 puts the knee of a hanging
            leg forward (theta_B < 0), -1 backward (theta_B > 0).
    """

    L1: float
    L2: float
    knee: int = 1

    def __post_init__(self) -> None:
        _check(self, "L1", "L2")

    def forward(self, theta: ArrayLike) -> Array:
        """Return the foot: F = L1 e(theta_A) + L2 e(theta_A + theta_B), e(t) = (cos t, sin t).

        Args:
            theta: (theta_A, theta_B) [rad], (..., 2).

        Returns:
            F [m], origin in A, (..., 2).

        Raises:
            ArgumentError: A shape other than (..., 2), or angles that are not finite.
        """
        AB, BF = self._links(theta)
        return AB + BF

    def inverse(self, foot: ArrayLike, knee: int | None = None) -> Array:
        """Return the angles that put the foot at given points.

        theta_A = alpha + knee beta by the law of cosines (see `kinematics.reach.side_angle`), and
        theta_B is the angle from AB to BF = F - AB. At F = A (only if L1 = L2) any theta_A fits;
        it is 0 by convention.

        Args:
            foot: F [m], origin in A, (..., 2).
            knee: +1 or -1; None is the leg's own.

        Returns:
            (theta_A, theta_B) [rad], both in (-pi, pi], (..., 2).

        Raises:
            UnreachableError: Unless |L1 - L2| <= |AF| <= L1 + L2; `.index` is the first bad point.
            ArgumentError: A shape other than (..., 2), or an unknown knee.
        """
        sign = self.knee if knee is None else knee
        if sign not in (-1, 1):
            raise ArgumentError(f"knee must be -1 or 1, got {sign!r}")

        # Adding 0.0 turns -0.0 into 0.0: the sign of a zero must not decide a direction.
        F = as_pairs(foot, "foot") + 0.0
        # Far points may overflow to inf, which is as far out of reach.
        with np.errstate(over="ignore", invalid="ignore"):
            theta_A, ok = side_angle(F, self.L1, self.L2, sign)

        if not ok.all():
            low = abs(self.L1 - self.L2)
            high = self.L1 + self.L2
            raise _unreachable("|AF|", np.hypot(F[..., 0], F[..., 1]), ~ok, low, high)

        AB = self.L1 * unit(theta_A)
        return np.stack([theta_A, angle_between(AB, F - AB)], axis=-1)

    def jacobian(self, theta: ArrayLike) -> Array:
        """Return d F / d (theta_A, theta_B) = (perp(AF), perp(BF)), perp(x, z) = (-z, x).

        Its determinant is L1 L2 sin(theta_B), so the straight and the folded leg are singular.

        Args:
            theta: (theta_A, theta_B) [rad], (..., 2).

        Returns:
            J [m/rad], (..., 2, 2): J[..., i, j] = d F_i / d theta_j.

        Raises:
            ArgumentError: A shape other than (..., 2), or angles that are not finite.
        """
        AB, BF = self._links(theta)
        return np.stack([perp(AB + BF), perp(BF)], axis=-1)

    def static_torques(self, theta: ArrayLike, force: ArrayLike, *, belt: bool = False) -> Array:
        """Return the motor torques that hold a foot force at rest, for links without weight.

        tau = -J^T F, the moments of the force about hip and knee:

            tau_A = -(AF x F),   tau_B = -(BF x F)

        tau_A acts between body and femur, tau_B between femur and tibia (motor in the knee). With
        `belt` the second motor sits on the body and turns the tibia through a belt or parallel
        bar: its angle is theta_A + theta_B and its torque tau_B; the hip's torque is tau_A - tau_B.

        Args:
            theta: (theta_A, theta_B) [rad], (..., 2).
            force: (x, z) that the world exerts on the foot [N], broadcasts with theta.
            belt: Whether both motors are on the body.

        Returns:
            (hip, knee) torques [N m], positive in the direction of the driven angle, (..., 2).

        Raises:
            ArgumentError: Shapes that do not broadcast, or numbers that are not finite.
        """
        AB, BF = self._links(theta)
        BF, F = broadcast(theta=BF, force=finite(as_pairs(force, "force"), "force"))
        tau_A = -cross(AB + BF, F)
        tau_B = -cross(BF, F)
        return np.stack([tau_A - tau_B if belt else tau_A, tau_B], axis=-1)

    def _links(self, theta: ArrayLike) -> tuple[Array, Array]:
        """Return AB and BF [m]."""
        t = finite(as_pairs(theta, "theta"), "theta")
        return self.L1 * unit(t[..., 0]), self.L2 * unit(t[..., 0] + t[..., 1])


@dataclass(frozen=True, slots=True)
class CrouchingLeg:
    """The symmetric leg that only crouches: equal links, and the hip straight above the foot.

    The foot stands still and the hip moves at height h above it. q1 is the femur's angle from
    straight down, positive with the knee forward, and q2 is the knee's angle:

        h = 2 l cos q1,   q2 = -2 q1,   -pi/2 <= q1 <= pi/2

    Stretched: h = 2 l, q1 = 0, singular. Fully crouched: h = 0, q1 = +-pi/2. As a `SerialLeg` of
    L1 = L2 = l: theta_A = q1 - pi/2, theta_B = q2.

    Attributes:
        l: Length of each link [m].
        knee: +1 forward, -1 backward: the sign of q1.

    See:
        Caron (scaron.info), "Kinematics of a symmetric leg"; there |q1| < pi/2.
    """

    l: float  # noqa: E741 - the letter of the published formula
    knee: int = 1

    def __post_init__(self) -> None:
        _check(self, "l")

    def forward(self, q1: ArrayLike) -> Array:
        """Return the hip's height h = 2 l cos q1 [m] at hip angles q1 [rad], (...) to (...).

        Raises:
            ArgumentError: Unless -pi/2 <= q1 <= pi/2.
        """
        return 2.0 * self.l * np.cos(_hip_angle(q1))

    def inverse(self, h: ArrayLike) -> Array:
        """Return (q1, q2) [rad], (..., 2), at heights h [m] of the hip above the foot, (...).

            q1 = knee arccos(h / 2 l),   q2 = -2 q1

        computed as atan2(sqrt((2 l - h) (2 l + h)), h), which keeps its digits near full stretch.

        Raises:
            UnreachableError: Unless 0 <= h <= 2 l; `.index` is the first bad height.
        """
        high = 2.0 * self.l
        height = _numbers(h, "h")
        ok = (height >= -ROUNDING * high) & (height <= (1.0 + ROUNDING) * high)
        if not ok.all():
            raise _unreachable("h", height, ~ok, 0.0, high)
        # The height was checked, so this cuts off rounding only.
        height = np.clip(height, 0.0, high)
        q1 = self.knee * np.arctan2(np.sqrt((high - height) * (high + height)), height)
        return np.stack([q1, -2.0 * q1], axis=-1)

    def jacobian(self, q1: ArrayLike) -> Array:
        """Return dh / dq1 = -2 l sin q1 [m/rad] at hip angles q1 [rad], (...) to (...).

        Raises:
            ArgumentError: Unless -pi/2 <= q1 <= pi/2.
        """
        return -2.0 * self.l * np.sin(_hip_angle(q1))

    def rates(self, q1: ArrayLike, h_dot: ArrayLike) -> Array:
        """Return the joint rates of a moving hip: q1_dot = -h_dot / (2 l sin q1).

        Args:
            q1: Hip angle [rad], (...).
            h_dot: Upward velocity of the hip [m/s], broadcasts with q1.

        Returns:
            (q1_dot, q2_dot) [rad/s], q2_dot = -2 q1_dot, (..., 2).

        Raises:
            SingularError: At full stretch, sin q1 = 0, the rate is infinite or undetermined.
            ArgumentError: Unless -pi/2 <= q1 <= pi/2 and h_dot is finite; shapes that differ.
        """
        v = finite(_numbers(h_dot, "h_dot"), "h_dot")
        q1, v = broadcast(q1=_hip_angle(q1), h_dot=v)
        stretched = ~(np.abs(np.sin(q1)) > SINGULAR)
        if stretched.any():
            index = first_index(stretched)
            raise SingularError(
                f"the leg is stretched: |sin q1| must be above {SINGULAR:.1e}{at(index)}", index
            )
        q1_dot = -v / (2.0 * self.l * np.sin(q1))
        return np.stack([q1_dot, -2.0 * q1_dot], axis=-1)

    def static_torques(self, q1: ArrayLike, load: ArrayLike, *, belt: bool = False) -> Array:
        """Return the motor torques that carry a load on the hip, for links without weight.

        The ground pushes the foot up with the load, (0, load), straight through the hip:

            tau_1 = 0,   tau_2 = load l sin q1

        With `belt` (see `SerialLeg.static_torques`) the hip's motor has to hold -tau_2 as well.

        Args:
            q1: Hip angle [rad], (...).
            load: Weight on the hip [N], broadcasts with q1.
            belt: Whether both motors are on the body.

        Returns:
            (tau_1, tau_2) [N m], positive in the direction of the driven angle, (..., 2).

        Raises:
            ArgumentError: Unless -pi/2 <= q1 <= pi/2 and the load is finite; shapes that differ.
        """
        W = finite(_numbers(load, "load"), "load")
        q1, W = broadcast(q1=_hip_angle(q1), load=W)
        tau_2 = W * self.l * np.sin(q1)
        return np.stack([-tau_2 if belt else np.zeros_like(tau_2), tau_2], axis=-1)


def _hip_angle(q1: ArrayLike) -> Array:
    angle = _numbers(q1, "q1")
    # Written so that NaN is beyond too.
    beyond = np.logical_not(np.abs(angle) <= 0.5 * np.pi)
    if beyond.any():
        got = float(angle[beyond].flat[0])
        where = at(first_index(beyond))
        raise ArgumentError(f"q1 must be in [-pi/2, pi/2] rad, got {got:g} rad{where}")
    return angle


def _numbers(values: ArrayLike, name: str) -> Array:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} must be numbers: {error}") from None


def _unreachable(what: str, values: Array, bad: Bools, low: float, high: float) -> UnreachableError:
    index = first_index(bad)
    count = f"{int(bad.sum())} of {bad.size} targets are" if index else "the target is"
    return UnreachableError(
        f"{count} out of reach: {what} must be in [{low:g}, {high:g}] m, "
        f"got {float(values[index]):g} m{at(index)}",
        index,
    )


def _check(leg: SerialLeg | CrouchingLeg, *lengths: str) -> None:
    for key in lengths:
        check_number(
            key, getattr(leg, key), "m", low=0.0, high=LONGEST, strict=True, error=GeometryError
        )
    if leg.knee not in (-1, 1):
        raise GeometryError(f"knee must be -1 or 1, got {leg.knee!r}")
