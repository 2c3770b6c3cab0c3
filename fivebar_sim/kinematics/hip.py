r"""The leg in space: a third angle, phi, turns the planar mechanism about a hip axis.

Body frame: origin on the hip's axis, x forward, y left, z up. At phi = 0 the leg plane is parallel
to x-z, and the origin O of the leg's own frame (midway between A and E) lies at

    SideStep   turned about x (abduction)    O = (0, across, along)
    Steering   turned about z, the vertical  O = (along, across, 0)

`across` is the distance of the leg plane from the axis, `along` that of O within the plane.
phi is right-handed about the axis: side-step swings a hanging foot to the left (+y), steering
turns the leg's x axis to the left. The foot, at r from the axis, has the stretched coordinate

    u = z_leg + along (SideStep),  x_leg + along (Steering),   u^2 = r^2 - across^2
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, Bools, as_vectors, at, finite, first_index
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, GeometryError, UnreachableError
from fivebar_sim.geometry import LONGEST, FiveBar, Mode
from fivebar_sim.kinematics.closure import ROUNDING
from fivebar_sim.kinematics.planar import direction


@dataclass(frozen=True, slots=True)
class SideStep:
    """A leg whose plane turns about the body's forward axis x.

    Attributes:
        leg: The planar leg.
        across: y of O at phi = 0 [m]: the offset of abduction, positive on a left leg.
        along: z of O at phi = 0 [m].
        side: Hip solution that `inverse` returns: -1 foot below the axis, +1 above it.
    """

    leg: FiveBar
    across: float = 0.0
    along: float = 0.0
    side: int = -1

    def __post_init__(self) -> None:
        _check(self)

    @property
    def origin(self) -> tuple[float, float, float]:
        """O at phi = 0 [m], body frame."""
        return 0.0, self.across, self.along


@dataclass(frozen=True, slots=True)
class Steering:
    """A leg whose plane turns about the body's vertical axis z.

    Attributes:
        leg: The planar leg.
        across: y of O at phi = 0 [m], off the leg plane.
        along: x of O at phi = 0 [m], in the leg plane.
        side: Hip solution that `inverse` returns: +1 foot in front of the axis, -1 behind it.
    """

    leg: FiveBar
    across: float = 0.0
    along: float = 0.0
    side: int = 1

    def __post_init__(self) -> None:
        _check(self)

    @property
    def origin(self) -> tuple[float, float, float]:
        """O at phi = 0 [m], body frame."""
        return self.along, self.across, 0.0


Hip = SideStep | Steering


class InPlane(NamedTuple):
    """The hip angle [rad] in (-pi, pi], (...), and the foot F in the leg's frame [m], (..., 2)."""

    phi: Array
    foot: Array


def forward(hip: Hip, theta3: ArrayLike, *, assembly: int | None = None) -> Array:
    """Return the foot in the body frame.

    With (x, z) = `kinematics.forward`, c = cos phi, s = sin phi:

        SideStep:  F = (x, across c - u s, across s + u c),   u = along + z
        Steering:  F = (u c - across s, u s + across c, z),   u = along + x

    Args:
        hip: The leg and its hip.
        theta3: (phi, theta_A, theta_E) [rad], (..., 3).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        F [m], body frame, (..., 3).

    Raises:
        LoopOpenError: The links do not meet; `.index` is the first such pose.
        ArgumentError: A shape other than (..., 3), or angles that are not finite.
    """
    phi, theta = _split(theta3)
    F = _in_space(kinematics.forward(hip.leg, theta, assembly)) + hip.origin
    return _turn(hip, F, phi)


def leg_plane(hip: Hip, foot: ArrayLike, side: ArrayLike | None = None) -> InPlane:
    """Return the hip angle and the foot in the leg plane for given points.

        SideStep:  u = side sqrt(y^2 + z^2 - across^2),   F = (x, u - along)
                   phi = atan2(z, y) - atan2(u, across)
        Steering:  u = side sqrt(x^2 + y^2 - across^2),   F = (u - along, z)
                   phi = atan2(y, x) - atan2(across, u)

    where each difference is computed by a single atan2. On the axis (only if across = 0) any phi
    fits; it is 0 by convention. As u goes to 0, the error of phi grows as eps across / u; the foot
    stays exact.

    Args:
        hip: The leg and its hip.
        foot: F [m], body frame, (..., 3).
        side: Sign of u, +1 or -1, (...); None is the hip's own.

    Raises:
        UnreachableError: The foot is not finite, or nearer to the axis than |across|.
        ArgumentError: A shape other than (..., 3), or an unknown side.

    See:
        Sen, Bakircioglu, Kalyoncu 2017 (IJSTR 6, 9): the side-step in other axes. The third angle,
        published as tan(z / y), must read atan2(z, y), which is phi - pi/2 with the foot below and
        no offset: a ratio loses the quadrant.
    """
    foot = as_vectors(foot, "foot", 3)
    phi, planar, ok = _turn_back(hip, foot, side)
    if not ok.all():
        raise _within_cylinder(hip, foot, ok)
    return InPlane(phi, planar)


def inverse(
    hip: Hip, foot: ArrayLike, *, mode: Mode | None = None, side: ArrayLike | None = None
) -> Array:
    """Return the angles that put the foot at given points: `leg_plane`, then the planar inverse.

    Args:
        hip: The leg and its hip.
        foot: F [m], body frame, (..., 3).
        mode: Working mode (s_A, s_E); None is the leg's own.
        side: +1 or -1, (...), on which side of the axis the leg stretches; None is the hip's own.

    Returns:
        (phi, theta_A, theta_E) [rad], each in (-pi, pi], (..., 3).

    Raises:
        UnreachableError: The foot is nearer to the axis than |across|, or out of the leg's reach;
            `.index` is the first such point.
        ArgumentError: Unknown mode or side, or a shape other than (..., 3).
    """
    foot = as_vectors(foot, "foot", 3)
    phi, planar, ok = _turn_back(hip, foot, side)
    try:
        theta = kinematics.inverse(hip.leg, planar, mode)
    except UnreachableError as error:
        # Points within the hip's cylinder went in as NaN, which the planar leg does not reach.
        if not ok[error.index]:
            raise _within_cylinder(hip, foot, ok) from None
        raise UnreachableError(f"in the leg plane {error}", error.index) from None
    return np.concatenate([phi[..., None], theta], axis=-1)


def jacobian(hip: Hip, theta3: ArrayLike, *, assembly: int | None = None) -> Array:
    """Return d foot / d (phi, theta_A, theta_E).

    The first column is axis x F, the others are those of the planar Jacobian, turned by phi:

        SideStep:  d F / d phi = (0, -z, y),   det J = u det J_leg
        Steering:  d F / d phi = (-y, x, 0),   det J = -u det J_leg

    so the hip adds the singularity u = 0, where phi cannot move the foot out of the leg plane.

    Args:
        hip: The leg and its hip.
        theta3: (phi, theta_A, theta_E) [rad], (..., 3).
        assembly: +1 or -1; None is the leg's own.

    Returns:
        J [m/rad], body frame, (..., 3, 3): J[..., i, j] = d F_i / d theta3_j.

    Raises:
        LoopOpenError: The links do not meet.
        SingularError: B, C and D are in line, so the foot's velocity is infinite.
        ArgumentError: A shape other than (..., 3), or angles that are not finite.
    """
    phi, theta = _split(theta3)
    J = kinematics.jacobian(hip.leg, theta, assembly)
    F = _axis_up(hip, forward(hip, theta3, assembly=assembly))
    by_phi = _axis_up(hip, np.stack([-F[..., 1], F[..., 0], np.zeros(phi.shape)], axis=-1))
    by_A, by_E = (_turn(hip, _in_space(J[..., k]), phi) for k in (0, 1))
    return np.stack([by_phi, by_A, by_E], axis=-1)


def _turn_back(hip: Hip, foot: Array, side: ArrayLike | None) -> tuple[Array, Array, Bools]:
    """Return phi (...), the planar foot (..., 2), and where they exist; the foot is NaN elsewhere.

    With the axis as z (see `_axis_up`), F = (p, q, .) and O = (., w, .):

        u = side sqrt((r - |w|) (r + |w|)),   phi = atan2(q u - p w, p u + q w)
    """
    sign = _sides(hip.side if side is None else side, foot.shape[:-1])
    F = _axis_up(hip, foot)
    w = float(_axis_up(hip, np.array(hip.origin))[1])
    p = F[..., 0]
    q = F[..., 1]

    # Far points may overflow to inf, which is as far out of reach.
    with np.errstate(over="ignore", invalid="ignore"):
        r = np.hypot(p, q)
        # Factored: a difference of two squares would lose digits.
        u2 = (r - abs(w)) * (r + abs(w))
        ok = np.asarray((u2 >= -ROUNDING * w * w) & np.isfinite(foot).all(axis=-1))
        u = sign * np.sqrt(np.where(ok, np.maximum(u2, 0.0), np.nan))
        phi = direction(q * u - p * w, p * u + q * w)

    # Turned back by phi, the foot is at (u, w, .) from the axis; the leg's frame begins at O.
    back = _axis_up(hip, np.stack([u, np.full(u.shape, w), F[..., 2]], axis=-1)) - hip.origin
    return phi, back[..., ::2], ok


def _axis_up(hip: Hip, v: Array) -> Array:
    """Return body vectors with the hip's axis as z: for a side-step (z, -y, x), its own inverse."""
    if isinstance(hip, Steering):
        return v
    return np.stack([v[..., 2], -v[..., 1], v[..., 0]], axis=-1)


def _turn(hip: Hip, v: Array, phi: Array) -> Array:
    """Return body vectors (..., 3) turned by phi (...) about the hip's axis."""
    p, q, r = np.moveaxis(_axis_up(hip, v), -1, 0)
    c = np.cos(phi)
    s = np.sin(phi)
    return _axis_up(hip, np.stack([p * c - q * s, p * s + q * c, r], axis=-1))


def _in_space(v: Array) -> Array:
    """Return leg plane vectors (x, z) as (x, 0, z)."""
    return np.stack([v[..., 0], np.zeros(v.shape[:-1]), v[..., 1]], axis=-1)


def _within_cylinder(hip: Hip, foot: Array, ok: Bools) -> UnreachableError:
    index = first_index(np.logical_not(ok))
    F = foot[index]
    r = math.hypot(*_axis_up(hip, F)[:2].tolist())
    count = f"{int((~ok).sum())} of {ok.size} points are" if index else "the point is"
    return UnreachableError(
        f"{count} out of the hip's reach: the foot must be finite and at least "
        f"{abs(hip.across):g} m from the hip's axis, got {r:g} m for the foot at "
        f"({F[0]:g}, {F[1]:g}, {F[2]:g}) m{at(index)}",
        index,
    )


def _sides(side: ArrayLike, batch: tuple[int, ...]) -> Array:
    try:
        sign = np.broadcast_to(np.asarray(side, dtype=np.float64), batch)
    except (TypeError, ValueError):
        sign = np.zeros(1)
    if not (np.abs(sign) == 1.0).all():
        raise ArgumentError(f"side must be -1 or 1, of shape {batch} or less, got {side!r}")
    return sign


def _split(theta3: ArrayLike) -> tuple[Array, Array]:
    angles = finite(as_vectors(theta3, "theta3", 3), "theta3")
    return angles[..., 0], angles[..., 1:]


def _check(hip: Hip) -> None:
    for key in ("across", "along"):
        value = getattr(hip, key)
        check_number(key, value, "m", low=-LONGEST, high=LONGEST, error=GeometryError)
    if hip.side not in (-1, 1):
        raise GeometryError(f"side must be -1 or 1, got {hip.side!r}")
