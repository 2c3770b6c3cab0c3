"""Closed-form poses of many legs at many foot positions, and how they move and load their motors.

The same equations as `kinematics.reach`, `kinematics.rates` and `dynamics.chain`, which are for one
leg, on arrays (designs, samples), and without angles: a link's direction is the vector
e = (cos, sin), which the law of cosines gives by a square root. With d = |r| and the two links
near and far of a side,

    N = d^2 + near^2 - far^2,   S = s sqrt(((near + far)^2 - d^2) (d^2 - (near - far)^2))
    e_near = (x N - z S, z N + x S) / (2 near d^2),   e_far = (r - near e_near) / far
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.design.evaluation.legs import Legs
from fivebar_sim.design.task.motions import Moving
from fivebar_sim.dynamics.chain import Chain, Pose
from fivebar_sim.dynamics.plane import Vector, cross


class Poses(NamedTuple):
    """Poses of n legs with their feet at N points; vectors are pairs of arrays (n, N).

    Where a foot is out of reach, `slack` is negative and the rest has no meaning.

    Attributes:
        e1, e2, e3, e4: Directions of L1..L4.
        to_F: Direction from B to F; e2 without an extension.
        F: The foot [m], hip frame.
        slack: Distance of F from the edge of side A's reach, or of C from that of side E's,
            whichever is less [m].
        sine_B, sine_D: Sines of the angles at B, between L1 and BF, and at D.
        sine_C: Sine of the angle at C, positive in the leg's own assembly mode.
    """

    e1: Vector
    e2: Vector
    e3: Vector
    e4: Vector
    to_F: Vector
    F: Vector
    slack: Array
    sine_B: Array
    sine_C: Array
    sine_D: Array

    @property
    def sine(self) -> Array:
        """The least of the three sines, (n, N)."""
        return np.minimum(np.minimum(self.sine_B, self.sine_D), self.sine_C)


class Rates(NamedTuple):
    """Rates [rad/s] and accelerations [rad/s^2] of the directions of L1..L4, each (n, N)."""

    w: tuple[Array, Array, Array, Array]
    alpha: tuple[Array, Array, Array, Array]


def solved(legs: Legs, x: Array, z: Array) -> Poses:
    """Return the poses that put the feet of legs at points [m], (1, N) or (n, N)."""
    E_x, E_z = legs.E
    along, across = legs.foot_offset
    rho = np.hypot(along, across)
    s_A, s_E = legs.mode
    A = side(x + E_x, z + E_z, legs.L1, rho, s_A)

    # From the direction of BF to that of BC: turned back by the angle between the two.
    c = along / rho
    s = across / rho
    e2 = A.far[0] * c + A.far[1] * s, A.far[1] * c - A.far[0] * s
    bare = legs.L6 == 0.0
    C = x, z
    if not bare.all():
        C_x = legs.L1 * A.near[0] + legs.L2 * e2[0] - E_x
        C_z = legs.L1 * A.near[1] + legs.L2 * e2[1] - E_z
        C = np.where(bare, x, C_x), np.where(bare, z, C_z)

    E = side(C[0] - E_x, C[1] - E_z, legs.L4, legs.L3, s_E)
    return Poses(
        e1=A.near,
        e2=e2,
        e3=E.far,
        e4=E.near,
        to_F=A.far,
        F=(x, z),
        slack=np.minimum(A.slack, E.slack),
        sine_B=A.sine,
        sine_C=legs.assembly * cross(e2, E.far),
        sine_D=E.sine,
    )


class Side(NamedTuple):
    """One side: directions of its links, its slack [m] and the sine at its knee."""

    near: Vector
    far: Vector
    slack: Array
    sine: Array


def side(x: Array, z: Array, near: Array, far: Array, s: Array) -> Side:
    """Return one side, whose chain spans the vector (x, z) from the motor [m]."""
    d2 = x * x + z * z
    least = np.abs(near - far)
    most = near + far
    N = d2 + (near - far) * most
    root = np.sqrt(np.maximum((most * most - d2) * (d2 - least * least), 0.0))
    S = s * root
    scale = 1.0 / (2.0 * near * d2)
    e_x = (x * N - z * S) * scale
    e_z = (z * N + x * S) * scale
    d = np.sqrt(d2)
    # A ring of equal links has no hole, and so no inner edge.
    inner = np.where(least > 0.0, d - least, np.inf)

    return Side(
        near=(e_x, e_z),
        far=((x - near * e_x) / far, (z - near * e_z) / far),
        slack=np.minimum(inner, most - d),
        sine=root / (2.0 * near * far),
    )


def rates(legs: Legs, p: Poses, moving: Moving) -> Rates:
    """Return how the links turn along a foot motion."""
    along, across = legs.foot_offset
    rho = np.hypot(along, across)
    v = moving.x_dot, moving.z_dot
    a = moving.x_ddot, moving.z_ddot
    w1, w2, a1, a2 = _turning(p.e1, p.to_F, legs.L1, rho, v, a)

    bare = legs.L6 == 0.0
    if not bare.all():
        # C is carried by L1 and L2, and is what side E has to follow.
        v_C = _velocity(p.e1, p.e2, legs.L1 * w1, legs.L2 * w2)
        a_C = _velocity(p.e1, p.e2, legs.L1 * a1, legs.L2 * a2)
        k1 = legs.L1 * w1 * w1
        k2 = legs.L2 * w2 * w2
        inward = k1 * p.e1[0] + k2 * p.e2[0], k1 * p.e1[1] + k2 * p.e2[1]
        v = np.where(bare, v[0], v_C[0]), np.where(bare, v[1], v_C[1])
        a = (
            np.where(bare, a[0], a_C[0] - inward[0]),
            np.where(bare, a[1], a_C[1] - inward[1]),
        )

    w4, w3, a4, a3 = _turning(p.e4, p.e3, legs.L4, legs.L3, v, a)
    return Rates((w1, w2, w3, w4), (a1, a2, a3, a4))


def _velocity(e1: Vector, e2: Vector, v1: Array, v2: Array) -> Vector:
    """Return perp(e1) v1 + perp(e2) v2."""
    return -e1[1] * v1 - e2[1] * v2, e1[0] * v1 + e2[0] * v2


def _turning(
    e1: Vector, e2: Vector, near: Array, far: Array, v: Vector, a: Vector
) -> tuple[Array, Array, Array, Array]:
    """Return the rates and the accelerations of a side's two links whose end moves.

    As `kinematics.rates._side_motion`, with r1 = near e1, r2 = far e2, s = e1 x e2:

        w1 = e2 . v / (near s),   w2 = -e1 . v / (far s)
        a1 = e2 . u / (near s),   a2 = -e1 . u / (far s),   u = a + r1 w1^2 + r2 w2^2
    """
    s = cross(e1, e2)
    to_near = 1.0 / (near * s)
    to_far = -1.0 / (far * s)
    w1 = (e2[0] * v[0] + e2[1] * v[1]) * to_near
    w2 = (e1[0] * v[0] + e1[1] * v[1]) * to_far
    # The centripetal part is known once the rates are: what is left is linear.
    k1 = near * w1 * w1
    k2 = far * w2 * w2
    u_x = a[0] + k1 * e1[0] + k2 * e2[0]
    u_z = a[1] + k1 * e1[1] + k2 * e2[1]
    a1 = (e2[0] * u_x + e2[1] * u_z) * to_near
    a2 = (e1[0] * u_x + e1[1] * u_z) * to_far
    return w1, w2, a1, a2


def torques(chain: Chain, pose: Pose, rates: Rates, force: Vector, friction: Array) -> Vector:
    """Return the motor torques (tau_A, tau_E) of a motion [N m], each (n, N).

    G^T (H psi_ddot + c - Q) - J^T F + friction sign(theta_dot)
    """
    t_A, t_E = chain.at_motors(pose, chain.link_torques(pose, rates.w, rates.alpha))
    f_A, f_E = chain.foot_torques(pose, force)
    w_A = rates.w[0]
    w_E = rates.w[3]
    return t_A - f_A + friction * np.sign(w_A), t_E - f_E + friction * np.sign(w_E)


class Slopes(NamedTuple):
    """The columns of the foot's Jacobian, d F / d theta [m/rad], each a pair (n, N)."""

    by_A: Vector
    by_E: Vector

    @property
    def determinant(self) -> Array:
        """Det J [m^2/rad^2], (n, N)."""
        return cross(self.by_A, self.by_E)

    @property
    def condition(self) -> Array:
        """Condition number, (n, N): k + 1/k = (|by_A|^2 + |by_E|^2) / |det J|."""
        x = self.by_A[0] ** 2 + self.by_A[1] ** 2 + self.by_E[0] ** 2 + self.by_E[1] ** 2
        w = x / np.abs(self.determinant)
        return 0.5 * (w + np.sqrt(np.maximum(w * w - 4.0, 0.0)))


def slopes(legs: Legs, p: Poses, pose: Pose) -> Slopes:
    """Return the foot's Jacobian: perp(AB) + a2 perp(BF), and b2 perp(BF)."""
    along, across = legs.foot_offset
    rho = np.hypot(along, across)
    BF = rho * p.to_F[0], rho * p.to_F[1]
    by_A = (
        -legs.L1 * p.e1[1] - pose.a2 * BF[1],
        legs.L1 * p.e1[0] + pose.a2 * BF[0],
    )
    return Slopes(by_A, (-pose.b2 * BF[1], pose.b2 * BF[0]))


def taken(p: Poses, rows: Bools) -> Poses:
    """Return the poses of some of the legs."""

    def some(each: Array) -> Array:
        return each if len(each) == 1 else each[rows]

    def both(v: Vector) -> Vector:
        return some(v[0]), some(v[1])

    return Poses(
        e1=both(p.e1),
        e2=both(p.e2),
        e3=both(p.e3),
        e4=both(p.e4),
        to_F=both(p.to_F),
        F=both(p.F),
        slack=some(p.slack),
        sine_B=some(p.sine_B),
        sine_C=some(p.sine_C),
        sine_D=some(p.sine_D),
    )
