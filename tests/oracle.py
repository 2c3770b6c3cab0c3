"""The five-bar leg from first principles: what proves the package and MuJoCo, and imports neither.

Absolute link angles psi = (psi1, psi2, psi3, psi4), from +x anticlockwise towards +z; the loop is
closed by multipliers, not by elimination. Inside, a vector of the leg plane is a complex number
x + 1j z. Every point is a base plus arms r_k, each turning with one angle psi_k:

    p = base + sum r_k,   p_dot = sum 1j r_k psi_dot_k
    p_ddot = sum (1j r_k psi_ddot_k - r_k psi_dot_k^2)
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dgesv  # pyright: ignore[reportAttributeAccessIssue]

Array = NDArray[np.float64]
Floats = Sequence[float]
Arms = tuple[tuple[int, complex], ...]


@dataclass(frozen=True, slots=True)
class Leg:
    """A leg as plain numbers; planar vectors are complex, four-tuples are in the order L1..L4.

    Attributes:
        lengths: |AB|, |BC|, |DC|, |ED|, |AE| [m].
        tilt: Angle of AE from +x [rad].
        mass: [kg].
        com: Centres of mass, along + 1j across [m], from A, B, D, E in the links' own frames.
        inertia: About those centres [kg m^2].
        foot_offset: F from B in the frame of L2, along + 1j across [m].
        armature: Rotor inertia on psi1 and on psi4 [kg m^2].
        gravity: x + 1j z [m/s^2].
        mode: (s_A, s_E): theta = alpha + s beta, alpha the direction to F from A and to C from E.
        assembly: Sign of BDx BCz - BDz BCx.
    """

    lengths: tuple[float, ...]
    tilt: float
    mass: tuple[float, ...]
    com: tuple[complex, ...]
    inertia: tuple[float, ...]
    foot_offset: complex
    armature: float
    gravity: complex
    mode: tuple[int, int]
    assembly: int

    @classmethod
    def of(cls, spec: Any) -> Leg:
        """Return the leg of any object that has the attributes of `FiveBar`."""
        return cls(
            lengths=(spec.L1, spec.L2, spec.L3, spec.L4, spec.L5),
            tilt=spec.tilt,
            mass=tuple(link.mass for link in spec.links),
            com=tuple(complex(*link.com) for link in spec.links),
            inertia=tuple(link.inertia for link in spec.links),
            foot_offset=complex(*spec.foot_offset),
            armature=spec.armature,
            gravity=complex(*spec.gravity),
            mode=tuple(spec.mode),
            assembly=spec.assembly,
        )

    motors: tuple[complex, complex] = field(init=False, repr=False, compare=False)
    """A and E [m], half of L5 to either side of the origin."""

    turning: tuple[float, ...] = field(init=False, repr=False, compare=False)
    """m |c|^2 + I of each link about the joint it hangs from [kg m^2]."""

    def __post_init__(self) -> None:
        half = cmath.rect(0.5 * self.lengths[4], self.tilt)
        links = zip(self.inertia, self.mass, self.com, strict=True)
        turning = tuple(i + m * (c.real * c.real + c.imag * c.imag) for i, m, c in links)
        object.__setattr__(self, "motors", (-half, half))
        object.__setattr__(self, "turning", turning)


def crossing(centre: complex, radius: float, other: complex, reach: float, side: int) -> complex:
    """Return the point at `radius` from `centre` and `reach` from `other`, to one side.

    With d = |other - centre|, u the unit vector along it, a = (d^2 + radius^2 - reach^2) / 2d:

        centre + u (a + 1j side h),   h = sqrt(radius^2 - a^2)

    Raises:
        ValueError: Unless |radius - reach| <= d <= radius + reach and d > 0.
    """
    d = abs(other - centre)
    low = abs(radius - reach)
    high = radius + reach
    if not (low <= d <= high and d > 0.0):
        raise ValueError(f"the circles never cross: d must be in [{low:g}, {high:g}] m, got {d:g}")
    a = (d * d + radius * radius - reach * reach) / (2.0 * d)
    h = math.sqrt(max(radius * radius - a * a, 0.0))  # d was checked: only rounding is below zero
    return centre + (other - centre) / d * complex(a, side * h)


def pose(leg: Leg, foot: complex) -> list[float]:
    """Return psi [rad] in (-pi, pi] with the foot at x + 1j z [m]; out of reach as `crossing`."""
    L1, L2, L3, L4, _ = leg.lengths
    A, E = leg.motors
    B = crossing(A, L1, foot, abs(leg.foot_offset), leg.mode[0])
    along = (foot - B) / leg.foot_offset  # the frame of L2: as long as 1, to rounding
    C = B + L2 * along
    D = crossing(E, L4, C, L3, leg.mode[1])
    return [cmath.phase(v) for v in (B - A, along, C - D, D - E)]


def closed(leg: Leg, psi1: float, psi4: float) -> list[float]:
    """Return psi [rad] with the loop closed in the leg's assembly; an open one as `crossing`."""
    L1, L2, L3, L4, _ = leg.lengths
    A, E = leg.motors
    B = A + cmath.rect(L1, psi1)
    D = E + cmath.rect(L4, psi4)
    C = crossing(B, L2, D, L3, leg.assembly)
    return [psi1, cmath.phase(C - B), cmath.phase(C - D), psi4]


def assembly_of(leg: Leg, psi: Floats) -> int:
    """Return the sign of BDx BCz - BDz BCx."""
    L1, L2, _, L4, _ = leg.lengths
    A, E = leg.motors
    BD = E + cmath.rect(L4, psi[3]) - A - cmath.rect(L1, psi[0])
    return 1 if (BD.conjugate() * cmath.rect(L2, psi[1])).imag > 0.0 else -1


def loop(leg: Leg, psi: Floats) -> tuple[complex, Arms]:
    """Return base and arms of the loop gap, C reached through B minus C reached through D [m]."""
    L1, L2, L3, L4, _ = leg.lengths
    one, two, three, four = psi
    A, E = leg.motors
    return A - E, (
        (0, cmath.rect(L1, one)),
        (1, cmath.rect(L2, two)),
        (2, cmath.rect(-L3, three)),
        (3, cmath.rect(-L4, four)),
    )


def foot(leg: Leg, psi: Floats) -> tuple[complex, Arms]:
    """Return base and arms of the foot F [m]."""
    arms = (0, cmath.rect(leg.lengths[0], psi[0])), (1, leg.foot_offset * cmath.rect(1.0, psi[1]))
    return leg.motors[0], arms


def centres(leg: Leg, psi: Floats) -> list[tuple[complex, Arms]]:
    """Return base and arms of the four centres of mass [m]."""
    e1, e2, e3, e4 = (cmath.rect(1.0, angle) for angle in psi)
    c1, c2, c3, c4 = leg.com
    A, E = leg.motors
    return [
        (A, ((0, c1 * e1),)),
        (A, ((0, leg.lengths[0] * e1), (1, c2 * e2))),
        (E, ((3, leg.lengths[3] * e4), (2, c3 * e3))),
        (E, ((3, c4 * e4),)),
    ]


def position(point: tuple[complex, Arms]) -> complex:
    """Return base + sum r_k [m]."""
    return point[0] + sum(r for _, r in point[1])


def velocity(arms: Arms, rates: Floats) -> complex:
    """Return sum 1j r_k psi_dot_k [m/s]; of psi_ddot: the part of p_ddot that is linear in it."""
    return sum((1j * r * rates[k] for k, r in arms), 0j)


def centripetal(arms: Arms, rates: Floats) -> complex:
    """Return -sum r_k psi_dot_k^2 [m/s^2], what p_ddot is when psi_ddot = 0."""
    total = 0j
    for k, r in arms:
        total -= r * (rates[k] * rates[k])
    return total


def jacobian(arms: Arms) -> list[list[float]]:
    """Return d p / d psi [m], rows x and z, four columns."""
    x = [0.0] * 4
    z = [0.0] * 4
    for k, r in arms:
        # 1j r
        x[k] = -r.imag
        z[k] = r.real
    return [x, z]


def mass_matrix(leg: Leg, psi: Floats) -> list[list[float]]:
    """Return M = sum (m J^T J + I) + armature [kg m^2] of the open tree; J of the centres.

    Two arms of one centre meet at the angle between their links; an arm meets itself at none.
    """
    L1, _, _, L4, _ = leg.lengths
    _, m2, m3, _ = leg.mass
    _, c2, c3, _ = leg.com
    own = leg.turning
    left = m2 * L1 * (c2 * cmath.rect(1.0, psi[1] - psi[0])).real
    right = m3 * L4 * (c3 * cmath.rect(1.0, psi[2] - psi[3])).real
    return [
        [own[0] + m2 * L1 * L1 + leg.armature, left, 0.0, 0.0],
        [left, own[1], 0.0, 0.0],
        [0.0, 0.0, own[2], right],
        [0.0, 0.0, right, own[3] + m3 * L4 * L4 + leg.armature],
    ]


def bias(leg: Leg, psi: Floats, psi_dot: Floats, foot_force: complex = 0j) -> list[float]:
    """Return h = sum m J^T (J_dot psi_dot - g) - J_F^T F [N m] of the open tree, four numbers."""
    e1, e2, e3, e4 = [cmath.rect(1.0, angle) for angle in psi]
    w1, w2, w3, w4 = [rate * rate for rate in psi_dot]
    m1, m2, m3, m4 = leg.mass
    c1, c2, c3, c4 = leg.com
    c1 *= e1
    c2 *= e2
    c3 *= e3
    c4 *= e4
    B = leg.lengths[0] * e1
    D = leg.lengths[3] * e4
    g = leg.gravity
    f1 = m1 * (-c1 * w1 - g)
    f2 = m2 * (-B * w1 - c2 * w2 - g)
    f3 = m3 * (-D * w4 - c3 * w3 - g)
    f4 = m4 * (-c4 * w4 - g)
    # (1j r) . f of every arm: the imaginary part of r* f
    return [
        (c1.conjugate() * f1 + B.conjugate() * (f2 - foot_force)).imag,
        (c2.conjugate() * f2 - (leg.foot_offset * e2).conjugate() * foot_force).imag,
        (c3.conjugate() * f3).imag,
        (c4.conjugate() * f4 + D.conjugate() * f3).imag,
    ]


def energy(leg: Leg, psi: Floats, psi_dot: Floats) -> float:
    """Return kinetic and potential energy [J], without the mass matrix.

    sum m |p_dot|^2 / 2 + I psi_dot^2 / 2 - m g . p, and armature psi_dot^2 / 2 of both rotors
    """
    total = 0.5 * leg.armature * (psi_dot[0] ** 2 + psi_dot[3] ** 2)
    for i, point in enumerate(centres(leg, psi)):
        lift = (leg.gravity.conjugate() * position(point)).real
        total += leg.mass[i] * (0.5 * abs(velocity(point[1], psi_dot)) ** 2 - lift)
        total += 0.5 * leg.inertia[i] * psi_dot[i] ** 2
    return total


def solve(K: ArrayLike, right: ArrayLike) -> list[float]:
    """Return x of K x = right.

    NumPy's own way to the LAPACK routine takes three times as long.

    Raises:
        ZeroDivisionError: K is singular.
    """
    *_, x, singular = dgesv(K, right)
    if singular:
        raise ZeroDivisionError("the equations of motion are singular")
    return x.tolist()


def forward_dynamics(
    leg: Leg, psi: Floats, psi_dot: Floats, tau: Floats = (0.0, 0.0), foot_force: complex = 0j
) -> tuple[list[float], complex]:
    """Return psi_ddot [rad/s^2] and the force lambda [N] that L3 exerts on L2 at C.

        [M  -G^T] [psi_ddot]   [(tau_A, 0, 0, tau_E) - h]
        [G    0 ] [lambda  ] = [-G_dot psi_dot          ],   G = d gap / d psi

    Args:
        leg: The leg.
        psi: Floats [rad] that close the loop.
        psi_dot: Their rates [rad/s], which keep it closed.
        tau: Motor torques (tau_A, tau_E) [N m], positive towards growing angle.
        foot_force: What the world does to the foot, x + 1j z [N].
    """
    arms = loop(leg, psi)[1]
    G_x, G_z = jacobian(arms)
    one, two, three, four = mass_matrix(leg, psi)
    K = [
        [*one, -G_x[0], -G_z[0]],
        [*two, -G_x[1], -G_z[1]],
        [*three, -G_x[2], -G_z[2]],
        [*four, -G_x[3], -G_z[3]],
        [*G_x, 0.0, 0.0],
        [*G_z, 0.0, 0.0],
    ]
    h1, h2, h3, h4 = bias(leg, psi, psi_dot, foot_force)
    drift = centripetal(arms, psi_dot)
    right = [tau[0] - h1, -h2, -h3, tau[1] - h4, -drift.real, -drift.imag]
    *psi_ddot, x, z = solve(K, right)
    return psi_ddot, complex(x, z)


def angles_of(
    leg: Leg, p: complex, v: complex, a: complex
) -> tuple[list[float], list[float], list[float]]:
    """Return psi, psi_dot, psi_ddot of one foot motion, given as x + 1j z; see `motion`."""
    psi = pose(leg, p)
    arms = foot(leg, psi)[1]
    loop_arms = loop(leg, psi)[1]
    J = jacobian(arms) + jacobian(loop_arms)
    psi_dot = solve(J, [v.real, v.imag, 0.0, 0.0])
    rest = a - centripetal(arms, psi_dot)
    gap = -centripetal(loop_arms, psi_dot)
    psi_ddot = solve(J, [rest.real, rest.imag, gap.real, gap.imag])
    return psi, psi_dot, psi_ddot


def torques(leg: Leg, p: complex, v: complex, a: complex, foot_force: complex = 0j) -> list[float]:
    """Return [tau_A, tau_E] [N m] of one motion and force, as x + 1j z; see `inverse_dynamics`."""
    return torques_of(leg, *angles_of(leg, p, v, a), foot_force)


def torques_of(
    leg: Leg, psi: Floats, psi_dot: Floats, psi_ddot: Floats, foot_force: complex = 0j
) -> list[float]:
    """Return what `torques` does, of a motion given by its angles, as `angles_of` returns them."""
    G_x, G_z = jacobian(loop(leg, psi)[1])
    need = np.dot(mass_matrix(leg, psi), psi_ddot) + bias(leg, psi, psi_dot, foot_force)
    K = np.transpose([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], G_x, G_z])
    return solve(K, need)[:2]


def motion(leg: Leg, p: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
    """Return psi, psi_dot, psi_ddot of a foot motion, from the linear equations of foot and loop.

        [J_F]            [v]    [J_F]             [a - J_F_dot psi_dot]
        [G  ] psi_dot =  [0],   [G  ] psi_ddot =  [  - G_dot psi_dot  ]

    Args:
        leg: The leg.
        p: Foot [m] in the hip frame, shape (..., 2).
        v: Its velocity [m/s], shape (..., 2).
        a: Its acceleration [m/s^2], shape (..., 2).

    Returns:
        Floats [rad] in (-pi, pi], rates [rad/s], accelerations [rad/s^2], shape (..., 4) each.
    """
    rows = _each(lambda *pva: angles_of(leg, *pva), p, v, a)
    psi, psi_dot, psi_ddot = np.moveaxis(rows, -2, 0)
    return psi, psi_dot, psi_ddot


def inverse_dynamics(
    leg: Leg, p: ArrayLike, v: ArrayLike, a: ArrayLike, foot_force: ArrayLike = 0.0
) -> Array:
    """Return the motor torques (tau_A, tau_E) [N m] of a foot motion, shape (..., 2).

        M psi_ddot + h = (tau_A, 0, 0, tau_E) + G^T lambda,   solved for tau and lambda

    Args:
        leg: The leg.
        p: Foot [m] in the hip frame, shape (..., 2).
        v: Its velocity [m/s], shape (..., 2).
        a: Its acceleration [m/s^2], shape (..., 2).
        foot_force: What the world does to the foot [N], shape (2,) or (..., 2).
    """
    return _each(lambda *pvaf: torques(leg, *pvaf), p, v, a, foot_force)


def _each(f: Callable[..., Any], *pairs: ArrayLike) -> Array:
    """Return f of every row of arrays of shape (..., 2), broadcast, as complex numbers."""
    arrays = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in pairs))
    rows = np.stack(arrays, axis=-2).reshape(-1, len(pairs), 2).tolist()
    results = np.array([f(*(complex(x, z) for x, z in row)) for row in rows])
    return results.reshape(arrays[0].shape[:-1] + results.shape[1:])
