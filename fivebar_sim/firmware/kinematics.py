"""Angles and positions as the firmware finds them: the same bits as `firmware/fivebar_leg.c`.

Every function returns its results with the status of each, and NaN where that is not OK. Legs,
points and signs are arrays that broadcast: one leg and many points, or a leg for each point.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.arrays import Bools
from fivebar_sim.firmware.elementary import (
    LARGEST_ANGLE,
    Real,
    cross,
    direction,
    is_finite,
    magnitude,
    multiply,
    numbers,
    square_root,
    unit,
    within_turn,
)
from fivebar_sim.firmware.leg import Chain, Leg
from fivebar_sim.firmware.status import Status, Statuses, first_of, then
from fivebar_sim.geometry import MODES

ON_MOTOR = 1e-30
"""|r|^2 up to which a chain ends on its motor [m^2]: far below any rounding of a position."""


class Joints(NamedTuple):
    """The joints of closed poses [m], each (..., 2): `fivebar_points`."""

    B: Real
    C: Real
    D: Real
    F: Real


class Loop(NamedTuple):
    """The vectors of closed poses [m], each (..., 2)."""

    AB: Real
    ED: Real
    BD: Real
    BC: Real


def inverse(leg: Leg, foot: ArrayLike, s_A: ArrayLike, s_E: ArrayLike) -> tuple[Real, Statuses]:
    """Return (theta_A, theta_E) [rad] in (-pi, pi], (..., 2), and statuses: `fivebar_inverse`.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        s_A: Working mode of side A, -1 or +1, (...).
        s_E: That of side E.
    """
    F = _reals(leg, foot)
    signs_A = np.asarray(s_A)
    signs_E = np.asarray(s_E)
    wrong = first_of(
        (~is_finite(F), Status.NOT_FINITE),
        (~(_is_sign(signs_A) & _is_sign(signs_E)), Status.BAD_ARGUMENT),
    )
    with np.errstate(all="ignore"):
        e_A, e_E, status = cranks(leg, F, signs_A, signs_E)
        theta = np.stack(
            [direction(e_A[..., 1], e_A[..., 0]), direction(e_E[..., 1], e_E[..., 0])], axis=-1
        )

    return _only(theta, then(wrong, status))


def inverse_all(leg: Leg, foot: ArrayLike) -> tuple[Real, Statuses]:
    """Return the angles of all four working modes, (..., 4, 2), and their statuses, (..., 4).

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
    """
    each = [inverse(leg, foot, s_A, s_E) for s_A, s_E in MODES]
    theta = np.stack([angles for angles, _ in each], axis=-2)
    return theta, np.stack([status for _, status in each], axis=-1)


def inverse_nearest(leg: Leg, foot: ArrayLike, now: ArrayLike) -> tuple[Real, Statuses]:
    """Return the solution nearest to the present angles, continuous with them, and statuses.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        now: Present (theta_A, theta_E) [rad], (..., 2).
    """
    here = _reals(leg, now)
    every, each = inverse_all(leg, foot)
    wrong = check_angles(here)
    own = (np.where(leg.s_A > 0, 2, 0) + np.where(leg.s_E > 0, 1, 0)) * np.ones_like(each[..., 0])
    reached = each == Status.OK
    none = np.take_along_axis(each, own[..., None].astype(np.intp), axis=-1)[..., 0]
    status = np.where(reached.any(axis=-1), np.int32(Status.OK), none)
    good = (wrong == Status.OK)[..., None, None] & reached[..., None]
    kind = here.dtype.type
    # Angles that mean nothing must not spoil the reduction of the others.
    step = within_turn(np.where(good, every - here[..., None, :], kind(0.0)))
    cost = step[..., 0] * step[..., 0] + step[..., 1] * step[..., 1]
    best = np.argmin(np.where(reached, cost, kind(np.inf)), axis=-1)
    chosen = np.take_along_axis(step, best[..., None, None], axis=-2)[..., 0, :]
    return _only(here + chosen, then(wrong, status))


def reaches(leg: Leg, foot: ArrayLike, s_A: ArrayLike = 0) -> Statuses:
    """Return whether the foot can be put there: OK or UNREACHABLE, (...): `fivebar_reaches`.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        s_A: Working mode of side A; 0 asks for any.
    """
    F = _reals(leg, foot)
    signs = np.asarray(s_A)
    with np.errstate(all="ignore"):
        one = np.ones_like(signs)
        minus = cranks(leg, F, -one, one)[2] == Status.OK
        plus = cranks(leg, F, one, one)[2] == Status.OK
    held = ((signs != 1) & minus) | ((signs != -1) & plus)

    return first_of(
        (~is_finite(F), Status.NOT_FINITE),
        (~((signs == 0) | _is_sign(signs)), Status.BAD_ARGUMENT),
        (~held, Status.UNREACHABLE),
    )


def cranks(leg: Leg, F: Real, s_A: NDArray[Any], s_E: NDArray[Any]) -> tuple[Real, Real, Statuses]:
    """Return the directions of both cranks, of any length above 0, and statuses.

    Args:
        leg: The leg.
        F: The foot [m], (..., 2).
        s_A: Working mode of side A, (...).
        s_E: That of side E.
    """
    two = F.dtype.type(2.0)
    zero = F.dtype.type(0.0)
    AF = F - leg.A
    e_A, d2, status_A = _crank(leg.to_foot, AF, s_A)
    # E is at -A.
    EF = F + leg.A

    on_motor = d2 < F.dtype.type(ON_MOTOR)
    AB_x = np.where(on_motor, leg.L1, e_A[..., 0] / (two * d2))
    AB_z = np.where(on_motor, zero, e_A[..., 1] / (two * d2))
    AB = np.stack([AB_x, AB_z], axis=-1)
    BC = multiply(leg.back, AF - AB)
    extended = np.asarray(leg.L6 > 0.0)[..., None]
    EC = np.where(extended, (AB + BC) + two * leg.A, EF)

    e_E, _, status_E = _crank(leg.to_C, EC, s_E)
    return e_A, e_E, then(status_A, status_E)


def forward(leg: Leg, theta: ArrayLike, assembly: ArrayLike) -> tuple[Real, Statuses]:
    """Return the foot [m], (..., 2), and statuses: `fivebar_forward`.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: -1 or +1, (...).
    """
    points, status = joints(leg, theta, assembly)
    return points.F, status


def joints(leg: Leg, theta: ArrayLike, assembly: ArrayLike) -> tuple[Joints, Statuses]:
    """Return all joints of closed poses, and statuses: `fivebar_joints`."""
    with np.errstate(all="ignore"):
        p, status = close_loop(leg, _reals(leg, theta), np.asarray(assembly))
        B = leg.A + p.AB
        every = (B, B + p.BC, p.ED - leg.A, B + multiply(leg.foot, p.BC))
    return Joints(*(_only(point, status)[0] for point in every)), status


def knees(leg: Leg, theta: ArrayLike) -> tuple[Real, Real, Statuses]:
    """Return the knees B and D [m], each (..., 2), and statuses: `fivebar_knees`."""
    angles = _reals(leg, theta)
    status = check_angles(angles)
    kept = _kept(angles, status)
    B = leg.A + unit(kept[..., 0]) * leg.L1[..., None]
    D = unit(kept[..., 1]) * leg.L4[..., None] - leg.A
    return _only(B, status)[0], _only(D, status)[0], status


def close_loop(leg: Leg, theta: Real, assembly: NDArray[Any]) -> tuple[Loop, Statuses]:
    """Return the vectors of closed poses; C is the crossing of the circles about B and D."""
    kind = theta.dtype.type
    wrong = then(check_angles(theta), first_of((~_is_sign(assembly), Status.BAD_ARGUMENT)))
    kept = _kept(theta, wrong)
    AB = unit(kept[..., 0]) * leg.L1[..., None]
    ED = unit(kept[..., 1]) * leg.L4[..., None]
    # AE is -2 A.
    BD = (ED - AB) - kind(2.0) * leg.A
    x = BD[..., 0]
    z = BD[..., 1]
    d2 = x * x + z * z
    loop = leg.knee_knee
    closed = _spans(loop, d2) & (d2 > leg.apart2)
    q = (loop.high - d2) * (d2 - loop.low)
    along = (d2 + loop.product) / (kind(2.0) * d2)
    across = square_root(q) / (kind(2.0) * d2)
    across = assembly.astype(theta.dtype) * across
    BC = np.stack([along * x - across * z, along * z + across * x], axis=-1)
    return Loop(AB, ED, BD, BC), then(wrong, first_of((~closed, Status.LOOP_OPEN)))


def jacobian(leg: Leg, theta: ArrayLike, assembly: ArrayLike) -> tuple[Real, Statuses]:
    """Return d foot / d theta [m/rad], (..., 2, 2), and statuses: `fivebar_jacobian`."""
    with np.errstate(all="ignore"):
        p, status = close_loop(leg, _reals(leg, theta), np.asarray(assembly))
        kind = p.BC.dtype.type
        DC = p.BC - p.BD
        m = cross(p.BC, DC)
        least = kind(numbers(p.BC).singular) * (leg.L2 * leg.L3)
        status = then(status, first_of((~(magnitude(m) > least), Status.SINGULAR)))

        turn = cross(p.AB, p.BC) / m
        dC = np.stack([turn * DC[..., 1], -(turn * DC[..., 0])], axis=-1)
        dB = np.stack([-p.AB[..., 1], p.AB[..., 0]], axis=-1)
        rest = np.stack([kind(1.0) - leg.foot[..., 0], -leg.foot[..., 1]], axis=-1)
        by_A = multiply(leg.foot, dC) + multiply(rest, dB)

        turn = cross(p.ED, DC) / m
        dC = np.stack([-(turn * p.BC[..., 1]), turn * p.BC[..., 0]], axis=-1)
        J = np.stack([by_A, multiply(leg.foot, dC)], axis=-1)
    return np.where((status == Status.OK)[..., None, None], J, kind(np.nan)), status


def torque(
    leg: Leg, theta: ArrayLike, assembly: ArrayLike, force: ArrayLike
) -> tuple[Real, Statuses]:
    """Return the motor torques that hold a foot force, -J^T force [N m], and statuses.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: -1 or +1, (...).
        force: Of the world on the foot [N], (..., 2).
    """
    f = _reals(leg, force)
    J, status = jacobian(leg, theta, assembly)
    status = then(first_of((~is_finite(f), Status.NOT_FINITE)), status)
    with np.errstate(all="ignore"):
        tau = -(J[..., 0, :] * f[..., 0, None] + J[..., 1, :] * f[..., 1, None])
    return _only(tau, status)


def _crank(chain: Chain, r: Real, s: NDArray[Any]) -> tuple[Real, Real, Statuses]:
    """Return the direction of the link at the motor, |r|^2, and statuses."""
    kind = r.dtype.type
    x = r[..., 0]
    z = r[..., 1]
    d2 = x * x + z * z
    n = d2 + chain.product
    p = (chain.high - d2) * (d2 - chain.low)
    root = s.astype(r.dtype) * square_root(p)
    on_motor = d2 < kind(ON_MOTOR)
    e_x = np.where(on_motor, kind(1.0), x * n - z * root)
    e_z = np.where(on_motor, kind(0.0), z * n + x * root)
    status = first_of((~_spans(chain, d2), Status.UNREACHABLE))

    return np.stack([e_x, e_z], axis=-1), d2, status


def _spans(chain: Chain, d2: Real) -> Bools:
    return (d2 >= chain.least) & (d2 <= chain.most)


def _is_sign(s: NDArray[Any]) -> Bools:
    return (s == 1) | (s == -1)


def check_angles(theta: Real) -> Statuses:
    """Return NOT_FINITE or OUT_OF_LIMITS where angles (..., 2) are not usable."""
    return first_of(
        (~is_finite(theta), Status.NOT_FINITE),
        (~(magnitude(theta) <= LARGEST_ANGLE).all(axis=-1), Status.OUT_OF_LIMITS),
    )


def _kept(theta: Real, status: Statuses) -> Real:
    """Return angles with 0 where their status is not OK: they must not spoil the arithmetic."""
    return np.where((status == Status.OK)[..., None], theta, theta.dtype.type(0.0))


def _reals(leg: Leg, values: ArrayLike) -> Real:
    """Return values in the arithmetic of a leg."""
    return np.asarray(values, dtype=leg.L1.dtype)


def _only(values: Real, status: Statuses) -> tuple[Real, Statuses]:
    """Return vectors (..., 2) with NaN where the status is not OK, and the statuses."""
    good = (status == Status.OK)[..., None]
    return np.where(good, values, values.dtype.type(np.nan)), status
