"""Angles from foot positions by the published half-angle route: the cross-check of `reach`.

In the drawing's frame, with the origin at A and x along AE, C is at (X, Y). That the knee
B = L1 (cos alpha, sin alpha) is L2 away from C says

    a cos alpha + b sin alpha = c,   a = 2 L1 X,  b = 2 L1 Y,  c = X^2 + Y^2 + L1^2 - L2^2

which is quadratic in t = tan(alpha / 2), (a + c) t^2 - 2 b t + (c - a) = 0:

    alpha = 2 atan((b + s_A r) / (a + c)),   r = sqrt(a^2 + b^2 - c^2)

The knee at E obeys the same with X - L5, L4, L3 for X, L1, L2, where a, b, c are called d, e, f:

    beta = 2 atan((e + s_E r) / (d + f)),   r = sqrt(d^2 + e^2 - f^2)
    d = 2 L4 (X - L5),  e = 2 L4 Y,  f = (X - L5)^2 + L4^2 + Y^2 - L3^2

Where the published form breaks, and what is done here:

- a + c = 0, where alpha of one knee is half a turn: its quotient is n / 0, so atan2 takes n and 0
  apart. The other knee's is 0 / 0, and near there b + s r loses its digits. The product of the
  roots, (c - a) / (a + c), gives it a second form:

      t = (c - a) / (b - s r)

  The squares of the two forms' lengths, (a + c)^2 + (b + s r)^2 and (c - a)^2 + (b - s r)^2, have
  the sum 4 (a^2 + b^2), so the longer is never short; it is the one taken, where a c + s b r >= 0
  the first.
- A sum of negative numerator and denominator would put atan2 / 2 beyond a quarter turn: the
  quotient's sign is given to the numerator, as atan does.
- Out of reach the root is of a negative number; published code then yields NaN, or 0. Here the
  reach is checked as in `kinematics.inverse`, which raises; at the edges rounding is cut at 0.
- C on A, with equal links: a = b = c = 0, any angle fits; theta is 0, as in `kinematics.inverse`.
- L1^2 - L2^2 is computed as (L1 - L2) (L1 + L2), exactly 0 for equal links: the rounding of the
  squares would be all of c where C is near A.

The published form has no L6 and no tilt. If L6 > 0, side A is solved to F with |BF| in place of L2,
which fixes C; then side E to C. A tilted leg is rotated into the drawing's frame first, and its
angles are rotated back.

Let u = (L1 + L2 + L5)^2 eps, the rounding of c. As cos(alpha - atan2(b, a)) is c / 2 L1 |AC| and
the sine of that angle s_A r / 2 L1 |AC|, the error of alpha is about u / r; at full stretch and on
the fold, where r = 0, about sqrt(u / L1 |AC|). The same holds for `kinematics.inverse`.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, Bools, as_pairs, at, first_index
from fivebar_sim.errors import ArgumentError, UnreachableError, unknown
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.closure import bases
from fivebar_sim.kinematics.planar import dot, turned, unit, wrap
from fivebar_sim.kinematics.reach import (
    foot_radius_and_angle,
    out_of_reach,
    reaches,
    solve,
    working_mode,
)

Range = tuple[float, float]

PUBLISHED_LIMITS: tuple[Range, Range] = ((np.pi / 4.0, np.pi), (0.0, np.pi / 4.0))
"""Joint limits [rad] by which the published controller picks its branch, for a leg that stands
upright (foot at z > 0): theta_A at least 45 deg, theta_E in 0..45 deg. It gives no upper limit for
theta_A; pi is the largest value of 2 atan."""

Rule = Literal["modes", "published"]
"""How `inverse_within` picks one of several modes within the limits."""

SLACK = 1e-12
"""Slack of joint limits [rad]: the rounding of an angle that is meant to lie on one."""


def half_angle(r: Array, near: float, far: float, s: int) -> tuple[Array, Bools]:
    """Return the motor angle of one side chain by the half-angle form, and where it reaches.

    Args:
        r: Vector from the motor to the chain's end (X, Y) [m], (..., 2).
        near: Link at the motor [m].
        far: Link beyond the knee [m].
        s: +1 or -1, the side's working mode.

    Returns:
        alpha [rad] in [-pi, pi], from the frame's x axis, (...); and where the chain reaches.
    """
    d2 = dot(r, r)
    a = 2.0 * near * r[..., 0]
    b = 2.0 * near * r[..., 1]
    c = d2 + (near - far) * (near + far)
    root = s * np.sqrt(np.maximum(a * a + b * b - c * c, 0.0))
    # Of the two equal quotients, take the one whose terms keep their digits (see above).
    first = a * c + b * root >= 0.0
    over, under = np.where(first, [b + root, a + c], [c - a, b - root])
    # The sign of the quotient goes to the numerator, so that atan2 / 2 stays within a quarter turn.
    alpha = 2.0 * np.arctan2(np.where(under < 0.0, -over, over), np.abs(under))
    return alpha, reaches(d2, near, far)


def principal(angle: Array) -> Array:
    """Return angles brought to (-pi, pi] by whole turns [rad]."""
    # Angles that are inside already keep their last bit; wrapping would round them.
    inside = (angle > -np.pi) & (angle <= np.pi)
    turned_back = wrap(angle)
    return np.where(inside, angle, np.where(turned_back <= -np.pi, np.pi, turned_back))


def _solve(leg: FiveBar, foot: Array, mode: Mode) -> tuple[Array, Bools]:
    """Return (theta_A, theta_E) of points, and where each side reaches, both (..., 2)."""
    rho, phi = foot_radius_and_angle(leg)
    # Squares of far points may overflow to inf, which is out of reach like any other.
    with np.errstate(over="ignore", invalid="ignore"):
        # From here on vectors are in the drawing's frame.
        AF = turned(foot - bases(leg)[0], -leg.tilt)
        alpha, ok_A = half_angle(AF, leg.L1, rho, mode[0])
        AC = AF
        if leg.L6 > 0.0:
            AB = leg.L1 * unit(alpha)
            AC = AB + (leg.L2 / rho) * turned(AF - AB, -phi)
        EC = AC - np.array([leg.L5, 0.0])
        beta, ok_E = half_angle(EC, leg.L4, leg.L3, mode[1])
        # A chain that ends on its motor fits at any angle; 0 by convention.
        on_motor = np.stack([dot(AF, AF), dot(EC, EC)], axis=-1) == 0.0
        theta = principal(np.stack([alpha, beta], axis=-1) + leg.tilt)

    return np.where(on_motor, 0.0, theta), np.stack([ok_A, ok_E], axis=-1)


def inverse_half_angle(leg: FiveBar, foot: ArrayLike, *, mode: Mode | None = None) -> Array:
    """Return the motor angles that put the foot F at given points, by the half-angle form.

    Arguments and results are those of `kinematics.inverse`; the top of this file has the method.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        mode: Working mode (s_A, s_E); None is the leg's own.

    Returns:
        (theta_A, theta_E) [rad] in (-pi, pi], (..., 2).

    Raises:
        UnreachableError: A side chain does not reach some point, as in `kinematics.inverse`;
            `.index` is the first such point.
        ArgumentError: Unknown mode, or a shape other than (..., 2).
    """
    mode = working_mode(leg, mode)
    foot = as_pairs(foot, "foot")
    theta, ok = _solve(leg, foot, mode)
    if not ok.all():
        raise out_of_reach(leg, foot, theta, ok)
    return theta


def inverse_within(
    leg: FiveBar, foot: ArrayLike, limits: ArrayLike, *, rule: Rule = "modes"
) -> Array:
    """Return the motor angles in the working mode whose angles are within joint limits.

    An angle counts as within its limits if whole turns bring it there, up to `SLACK`; the fewest
    turns are taken. If several modes fit, the rule decides:

        "modes"       the first in the order of `MODES`; the angles are exact
        "published"   as the published controller: alpha_1, the root with + (s_A = +1), where it is
                      within its limits, then beta_1 likewise, and each angle without its fraction
                      of a degree (towards 0), so that the foot is off by up to a degree's worth

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        limits: ((low_A, high_A), (low_E, high_E)) [rad], ends included; `PUBLISHED_LIMITS` are
            those of the published controller.
        rule: "modes" or "published".

    Returns:
        (theta_A, theta_E) [rad] within the limits, so perhaps beyond (-pi, pi], (..., 2). Those
        of "published" may lie below a limit that is no whole degree.

    Raises:
        UnreachableError: No mode reaches some point, or none of those that do is within the
            limits; the message names the limit, `.index` is the first such point.
        ArgumentError: The limits are not two finite ranges, foot has another shape, or unknown
            rule.
    """
    if rule not in get_args(Rule):
        raise ArgumentError(unknown("rule", str(rule), get_args(Rule)))
    foot = as_pairs(foot, "foot")
    low, high = _ends(limits)
    solved = [solve(leg, foot, mode) for mode in MODES]
    theta = np.stack([angles for angles, _ in solved], axis=-2)
    ok = np.stack([reached for _, reached in solved], axis=-2)
    reached = ok[..., 0] & ok[..., 1]
    somewhere = reached.any(axis=-1, keepdims=True)

    # Where no mode reaches, the leg's own tells why; points that some mode reaches are masked.
    if not somewhere.all():
        own = MODES.index(leg.mode)
        raise out_of_reach(leg, foot, theta[..., own, :], ok[..., own, :] | somewhere)

    # theta + 2 pi n is within the limits for the whole numbers n between these two, if any.
    fewest = np.ceil((low - SLACK - theta) / (2.0 * np.pi))
    most = np.floor((high + SLACK - theta) / (2.0 * np.pi))
    fits = (fewest <= most) & reached[..., None]
    within = fits[..., 0] & fits[..., 1]
    if not within.any(axis=-1).all():
        raise _beyond(foot, theta, fits, reached, (low, high))

    theta = theta + 2.0 * np.pi * np.clip(0.0, fewest, most)
    first = np.argmax(within, axis=-1)
    if rule == "published":
        # In MODES - comes before +: the last mode that fits has alpha_1, and beta_1, if it may.
        first = len(MODES) - 1 - np.argmax(within[..., ::-1], axis=-1)
    chosen = np.take_along_axis(theta, first[..., None, None], axis=-2)[..., 0, :]
    return chosen if rule == "modes" else _truncated(chosen)


def _truncated(theta: Array) -> Array:
    """Return angles without their fractions of a degree, towards 0 [rad]."""
    degrees = np.degrees(theta)
    # An angle that is meant to be a whole degree stays one, whatever its rounding.
    return np.radians(np.trunc(degrees + np.copysign(np.degrees(SLACK), degrees)))


def _ends(limits: ArrayLike) -> tuple[Array, Array]:
    """Return the low and the high ends of joint limits [rad], each (2,) in the order A, E."""
    ends = as_pairs(limits, "limits")
    legal = ends.shape == (2, 2) and np.isfinite(ends).all() and (ends[:, 0] <= ends[:, 1]).all()
    if not legal:
        raise ArgumentError(
            "limits must be ((low_A, high_A), (low_E, high_E)) [rad], finite, low <= high, got "
            f"{ends.tolist()}"
        )
    return ends[:, 0], ends[:, 1]


def _beyond(
    foot: Array, theta: Array, fits: Bools, reached: Bools, ends: tuple[Array, Array]
) -> UnreachableError:
    """Return the error for points that have no mode within the limits.

    It names the limit that no mode keeps; if each limit is kept by some mode, it names both.
    """
    bad = np.logical_not((fits[..., 0] & fits[..., 1]).any(axis=-1))
    index = first_index(bad)
    kept = fits[index].any(axis=0)
    each = []

    for side in (0, 1):
        if not kept[side] or kept.all():
            low = ends[0][side]
            high = ends[1][side]
            came = sorted({f"{angle:g}" for angle in theta[index][reached[index], side]}, key=float)
            each.append(
                f"theta_{'AE'[side]} must be in [{low:g}, {high:g}] rad "
                f"([{np.degrees(low):g}, {np.degrees(high):g}] deg), got {' or '.join(came)} rad"
            )

    count = f"{int(bad.sum())} of {bad.size} points are" if bad.ndim else "the point is"
    together = " in one mode" if kept.all() else ""
    x, z = foot[index]

    return UnreachableError(
        f"{count} beyond the joint limits in every working mode: {' and '.join(each)}{together}, "
        f"for the foot at ({x:g}, {z:g}) m{at(index)}",
        index,
    )
