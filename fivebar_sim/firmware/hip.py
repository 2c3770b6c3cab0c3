"""Side-step and steering as the firmware finds them: the same bits as `firmware/fivebar_leg.c`.

The geometry is that of `kinematics.hip`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.firmware.elementary import (
    Real,
    direction,
    is_finite,
    magnitude,
    numbers,
    square_root,
    unit,
)
from fivebar_sim.firmware.kinematics import check_angles, forward, inverse
from fivebar_sim.firmware.leg import Leg
from fivebar_sim.firmware.status import Status, Statuses, first_of, then


class Hip(NamedTuple):
    """`fivebar_hip`.

    Attributes:
        steering: Whether it turns about z; otherwise, as a side-step, about x.
        side: -1 or +1, on which side of the axis the leg stretches.
        across: Of the leg plane from the axis [m].
        along: Of the leg's origin within the plane [m].
    """

    steering: bool
    side: int
    across: float
    along: float


def hip_inverse(
    leg: Leg, hip: Hip, foot: ArrayLike, s_A: ArrayLike, s_E: ArrayLike
) -> tuple[Real, Statuses]:
    """Return (phi, theta_A, theta_E) [rad], (..., 3), and statuses: `fivebar_hip_inverse`.

    Args:
        leg: The leg.
        hip: Its hip.
        foot: F [m], body frame, (..., 3).
        s_A: Working mode of side A, -1 or +1, (...).
        s_E: That of side E.
    """
    F = np.asarray(foot, dtype=leg.L1.dtype)
    kind = F.dtype.type
    across = kind(hip.across)
    along = kind(hip.along)
    x, y, z = np.moveaxis(F, -1, 0)
    w = across if hip.steering else -across
    p = x if hip.steering else z
    q = y if hip.steering else -y
    with np.errstate(all="ignore"):
        r2 = p * p + q * q
        r = square_root(r2)
        u2 = (r - magnitude(w)) * (r + magnitude(w))
        within = ~(u2 >= (kind(-8.0) * kind(numbers(F).epsilon)) * (w * w))
        u = kind(hip.side) * square_root(u2)
        planar = np.stack([u - along, z] if hip.steering else [x, u - along], axis=-1)
        theta, later = inverse(leg, planar, s_A, s_E)
        phi = direction(q * u - p * w, p * u + q * w)

    status = first_of(
        (~is_finite(F), Status.NOT_FINITE),
        (np.isinf(r2), Status.UNREACHABLE),
        (within, Status.UNREACHABLE),
    )
    status = then(_check(hip, status), then(status, later))
    # An argument that is not finite is told before a hip that is not one.
    status = np.where(is_finite(F), status, np.int32(Status.NOT_FINITE))
    angles = np.concatenate([phi[..., None], theta], axis=-1)
    return np.where((status == Status.OK)[..., None], angles, kind(np.nan)), status


def hip_forward(
    leg: Leg, hip: Hip, angles: ArrayLike, assembly: ArrayLike
) -> tuple[Real, Statuses]:
    """Return the foot [m], body frame, (..., 3), and statuses: `fivebar_hip_forward`.

    Args:
        leg: The leg.
        hip: Its hip.
        angles: (phi, theta_A, theta_E) [rad], (..., 3).
        assembly: -1 or +1, (...).
    """
    a = np.asarray(angles, dtype=leg.L1.dtype)
    kind = a.dtype.type
    across = kind(hip.across)
    along = kind(hip.along)
    phi = a[..., 0]
    status = check_angles(np.stack([phi, np.zeros_like(phi)], axis=-1))
    planar, later = forward(leg, a[..., 1:], assembly)
    status = then(_check(hip, status), then(status, later))
    good = status == Status.OK
    e = unit(np.where(good, phi, kind(0.0)))
    c = e[..., 0]
    s = e[..., 1]
    x = planar[..., 0]
    z = planar[..., 1]
    if hip.steering:
        u = along + x
        F = np.stack([u * c - across * s, u * s + across * c, z], axis=-1)
    else:
        u = along + z
        F = np.stack([x, across * c - u * s, across * s + u * c], axis=-1)

    return np.where(good[..., None], F, kind(np.nan)), status


def _check(hip: Hip, like: Statuses) -> Statuses:
    """Return the status of a hip, in the shape of others."""
    finite = np.isfinite([hip.across, hip.along]).all()
    every = np.ones_like(like, dtype=bool)
    return first_of(
        (every & ~finite, Status.NOT_FINITE),
        (every & (hip.side not in (-1, 1)), Status.BAD_ARGUMENT),
    )
