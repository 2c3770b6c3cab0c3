"""The closed chain in the two motor angles, with the knees and C eliminated in closed form.

psi_k is the direction of link k from +x, e_k = (cos psi_k, sin psi_k): e1 along AB, e2 along BC,
e3 along DC, e4 along ED. So psi_1 = theta_A, psi_4 = theta_E, and the loop
A + L1 e1 + L2 e2 = E + L4 e4 + L3 e3 gives, crossed with e3 and with e2,

    psi_2_dot = a2 theta_dot_A + b2 theta_dot_E,   a2 = -L1 e1 x e3 / (L2 e2 x e3)
                                                   b2 =  L4 e4 x e3 / (L2 e2 x e3)
    psi_3_dot = a3 theta_dot_A + b3 theta_dot_E,   a3 = -L1 e1 x e2 / (L3 e2 x e3)
                                                   b3 =  L4 e4 x e2 / (L3 e2 x e3)

With these as rows 2 and 3 of G (rows 1 and 4 are the identity's), psi_dot = G theta_dot, and the
open tree's mass matrix H (links 1, 2 and links 4, 3), its centripetal torques c and weight Q,

    M = G^T H G,   bias = G^T (H g + c - Q),   psi_ddot = G theta_ddot + g

Everything here works on separate coordinates (x, z), arrays of shape (...) or single floats, for
speed: the integrator of one leg calls it a hundred thousand times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, total
from fivebar_sim.checks import check_number
from fivebar_sim.dynamics.plane import Four, Scalar, Vector, cross, dot, placed, weigh
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import HEAVIEST, FiveBar
from fivebar_sim.kinematics.rates import SINGULAR
from fivebar_sim.links import Link, combined


class Pose(NamedTuple):
    """A pose: directions (x, z) of L1..L4, and how the motors turn L2 and L3 if the loop is closed.

    Attributes:
        e1: Along AB.
        e2: Along BC.
        e3: Along DC.
        e4: Along ED.
        a2: d psi_2 / d theta_A.
        b2: d psi_2 / d theta_E.
        a3: d psi_3 / d theta_A.
        b3: d psi_3 / d theta_E.
    """

    e1: Vector
    e2: Vector
    e3: Vector
    e4: Vector
    a2: Scalar = math.nan
    b2: Scalar = math.nan
    a3: Scalar = math.nan
    b3: Scalar = math.nan

    def links(self, rows: slice) -> Pose:
        """Return the directions of some of many poses (N,), without how the motors turn them."""
        return Pose(*((x[rows], z[rows]) for x, z in self[:4]))


@dataclass(frozen=True, slots=True)
class Chain:
    """A leg's constants; moments of mass are sums of m times (along, across) in a link's frame.

    Attributes:
        leg: The leg; or many legs, whose attributes are arrays, as those of the chain are then.
        assembly: +1 or -1.
        I1: Inertia about A of L1, L2's mass at B, and A's rotor [kg m^2].
        I2: Inertia of L2 about B [kg m^2].
        I3: Inertia of L3 about D [kg m^2].
        I4: Inertia about E of L4, L3's mass at D, and E's rotor [kg m^2].
        S1: Moment of mass of L1 about A, and of L2's mass at B [kg m].
        S2: Moment of mass of L2 about B [kg m].
        S3: Moment of mass of L3 about D [kg m].
        S4: Moment of mass of L4 about E, and of L3's mass at D [kg m].
        AE: Vector from A to E [m].
        hung: Moment of mass about O of side A's masses at A and side E's at E, hip frame [kg m].
    """

    leg: Any
    assembly: Scalar
    I1: Scalar
    I2: Scalar
    I3: Scalar
    I4: Scalar
    S1: Vector
    S2: Vector
    S3: Vector
    S4: Vector
    AE: Vector
    hung: Vector

    @classmethod
    def of(cls, leg: FiveBar, assembly: int | None, payload: float) -> Chain:
        """Return the constants of a leg with a point mass at the foot.

        Args:
            leg: The leg.
            assembly: +1 or -1; None is the leg's own.
            payload: Point mass at F [kg].

        Raises:
            ArgumentError: Unknown assembly, or a payload that is not finite or negative.
        """
        sign = leg.assembly if assembly is None else assembly
        if sign not in (-1, 1):
            raise ArgumentError(f"assembly must be -1 or 1, got {assembly!r}")

        check_number("payload", payload, "kg", low=0.0, high=HEAVIEST)
        x, z = kinematics.bases(leg)[1].tolist()
        return cls.assembled(leg, sign, leg.links, (x, z), payload)

    @classmethod
    def assembled(
        cls,
        leg: Any,
        assembly: Scalar,
        links: tuple[Link, Link, Link, Link],
        E: Vector,
        payload: Scalar,
    ) -> Chain:
        """Return the constants of a leg, or of many legs at once, given their links and E [m]."""
        one, two, three, four = links
        # The foot is part of L2, and so is the payload.
        two = combined(two, Link(payload, leg.foot_offset, 0.0))
        x, z = E
        # E = -A, so that the moments of the masses hung there differ in sign only.
        right = three.mass + four.mass - one.mass - two.mass

        return cls(
            leg=leg,
            assembly=assembly,
            I1=about_joint(one) + two.mass * leg.L1**2 + leg.armature,
            I2=about_joint(two),
            I3=about_joint(three),
            I4=about_joint(four) + three.mass * leg.L4**2 + leg.armature,
            S1=(one.mass * one.com[0] + two.mass * leg.L1, one.mass * one.com[1]),
            S2=(two.mass * two.com[0], two.mass * two.com[1]),
            S3=(three.mass * three.com[0], three.mass * three.com[1]),
            S4=(four.mass * four.com[0] + three.mass * leg.L4, four.mass * four.com[1]),
            AE=(2.0 * x, 2.0 * z),
            hung=(right * x, right * z),
        )

    def pose(self, theta_A: Scalar, theta_E: Scalar) -> Pose:
        """Return the closed pose of motor angles [rad].

        C as in `kinematics.closure.loop_joint`. With d = |BD| the sine of the angle at C is
        sqrt(((L2 + L3)^2 - d^2) (d^2 - (L2 - L3)^2)) / 2 L2 L3, checked before any division.

        Raises:
            LoopOpenError: The links do not meet.
            SingularError: B, C and D are in line.
        """
        # NumPy's functions take twenty times as long for one number as those of math.
        maths: Any = math if isinstance(theta_A, float) else np
        e1 = maths.cos(theta_A), maths.sin(theta_A)
        e4 = maths.cos(theta_E), maths.sin(theta_E)
        return self._pose(e1, e4, theta_A, theta_E)

    def pose_of_one(self, theta: Array) -> Pose:
        """Return what `pose` does of one pose (1, 2) among possibly many [rad], as plain numbers.

        They have the bits that `pose` gives of arrays, whose cosines are NumPy's.
        """
        theta_A = theta[:, 0]
        theta_E = theta[:, 1]
        e1 = np.cos(theta_A).item(), np.sin(theta_A).item()
        e4 = np.cos(theta_E).item(), np.sin(theta_E).item()
        return self._pose(e1, e4, theta_A, theta_E)

    def _pose(self, e1: Vector, e4: Vector, theta_A: Scalar, theta_E: Scalar) -> Pose:
        """Return the closed pose of the directions of L1 and L4; errors name the angles."""
        leg = self.leg
        L1 = leg.L1
        L2 = leg.L2
        L3 = leg.L3
        L4 = leg.L4
        # BD = (x, z).
        x = self.AE[0] + L4 * e4[0] - L1 * e1[0]
        z = self.AE[1] + L4 * e4[1] - L1 * e1[1]
        d2 = x * x + z * z
        # The square of four times the area of the triangle BCD (Heron), 0 where it is flat.
        area = ((L2 + L3) ** 2 - d2) * (d2 - (L2 - L3) ** 2)

        regular = area > (2.0 * L2 * L3 * SINGULAR) ** 2
        if regular is not True and not np.all(regular):
            self._check_regular(theta_A, theta_E)

        along = (d2 + (L2 - L3) * (L2 + L3)) / (2.0 * d2)
        root = math.sqrt(area) if isinstance(area, float) else np.sqrt(area)
        across = self.assembly * root / (2.0 * d2)
        # From BD to BC by rotating and scaling, so that L2 and L3 need no trigonometry.
        BC = along * x - across * z, along * z + across * x
        e2 = BC[0] / L2, BC[1] / L2

        return self.coupled(e1, e2, ((BC[0] - x) / L3, (BC[1] - z) / L3), e4)

    def check_pose(self, theta_A: Scalar, theta_E: Scalar) -> None:
        """Raise what `pose` raises of motor angles [rad], where nobody needs the pose yet."""
        self.pose(theta_A, theta_E)

    def _check_regular(self, theta_A: Scalar, theta_E: Scalar) -> None:
        """Raise what is wrong with motor angles [rad], and where: `kinematics.jacobian` knows."""
        kinematics.jacobian(self.leg, np.stack([theta_A, theta_E], axis=-1), self.assembly)

    def coupled(self, e1: Vector, e2: Vector, e3: Vector, e4: Vector) -> Pose:
        """Return the pose of the links' directions; e2 and e3 must not be in line.

        G spans the null space of the gap's Jacobian, so it also holds where the loop is open.
        """
        L1 = self.leg.L1
        L2 = self.leg.L2
        L3 = self.leg.L3
        L4 = self.leg.L4
        s = cross(e2, e3)
        a2 = -L1 * cross(e1, e3) / (L2 * s)
        b2 = L4 * cross(e4, e3) / (L2 * s)
        a3 = -L1 * cross(e1, e2) / (L3 * s)
        b3 = L4 * cross(e4, e2) / (L3 * s)
        return Pose(e1, e2, e3, e4, a2, b2, a3, b3)

    def couplings(self, p: Pose) -> Vector:
        """Return H12 = L1 e1 . r2 and H43 = L4 e4 . r3 [kg m^2], r_k from `moments`."""
        return self._coupled_by(p, placed(p.e2, self.S2), placed(p.e3, self.S3))

    def _coupled_by(self, p: Pose, r2: Vector, r3: Vector) -> Vector:
        """Return the `couplings` of moments that are known already."""
        return self.leg.L1 * dot(p.e1, r2), self.leg.L4 * dot(p.e4, r3)

    def mass(self, p: Pose) -> tuple[Scalar, Scalar, Scalar]:
        """Return M_AA, M_AE, M_EE [kg m^2] of M = G^T H G."""
        H12, H43 = self.couplings(p)
        I2 = self.I2
        I3 = self.I3
        return (
            self.I1 + 2.0 * H12 * p.a2 + I2 * p.a2 * p.a2 + I3 * p.a3 * p.a3,
            H12 * p.b2 + I2 * p.a2 * p.b2 + I3 * p.a3 * p.b3 + H43 * p.a3,
            self.I4 + 2.0 * H43 * p.b3 + I3 * p.b3 * p.b3 + I2 * p.b2 * p.b2,
        )

    def link_torques(self, p: Pose, w: Four, alpha: Four) -> Four:
        """Return H psi_ddot + c - Q of links 1..4 [N m] for any rates w and accelerations alpha.

        H = I on the diagonal, with H12 and H43 off it
        c1 = -X12 w2^2,  c2 = X12 w1^2,   X12 = L1 e1 x r2    (4, 3 likewise)
        Q_k = r_k x gravity
        """
        w1, w2, w3, w4 = w
        gravity = self.leg.gravity
        r = self.moments(p)
        r1, r2, r3, r4 = r
        H12, H43 = self._coupled_by(p, r2, r3)
        X12, X43 = self.turning(p, r)

        return (
            self.I1 * alpha[0] + H12 * alpha[1] - X12 * w2 * w2 - cross(r1, gravity),
            H12 * alpha[0] + self.I2 * alpha[1] + X12 * w1 * w1 - cross(r2, gravity),
            H43 * alpha[3] + self.I3 * alpha[2] + X43 * w4 * w4 - cross(r3, gravity),
            self.I4 * alpha[3] + H43 * alpha[2] - X43 * w3 * w3 - cross(r4, gravity),
        )

    def turning(self, p: Pose, r: tuple[Vector, Vector, Vector, Vector]) -> Vector:
        """Return X12 and X43 of `link_torques` [kg m^2], given the pose's `moments`."""
        return self.leg.L1 * cross(p.e1, r[1]), self.leg.L4 * cross(p.e4, r[2])

    def at_motors(self, p: Pose, t: Four) -> Vector:
        """Return the motor torques G^T t [N m] of link torques t."""
        # G moves the chain with the loop closed, so the force in C does no work and drops out.
        return t[0] + p.a2 * t[1] + p.a3 * t[2], t[3] + p.b2 * t[1] + p.b3 * t[2]

    def bias(self, p: Pose, w1: Scalar, w4: Scalar) -> Vector:
        """Return G^T (H g + c - Q) [N m] at motor rates w1 and w4 [rad/s].

        g2 = k . e3 / (L2 e2 x e3),   g3 = k . e2 / (L3 e2 x e3)
        k = L1 w1^2 e1 + L2 w2^2 e2 - L4 w4^2 e4 - L3 w3^2 e3
        """
        leg = self.leg
        w2 = p.a2 * w1 + p.b2 * w4
        w3 = p.a3 * w1 + p.b3 * w4
        # With constant motor rates the loop still accelerates L2 and L3, by g2 and g3.
        k1 = leg.L1 * w1 * w1
        k2 = leg.L2 * w2 * w2
        k3 = leg.L3 * w3 * w3
        k4 = leg.L4 * w4 * w4
        k = (
            k1 * p.e1[0] + k2 * p.e2[0] - k4 * p.e4[0] - k3 * p.e3[0],
            k1 * p.e1[1] + k2 * p.e2[1] - k4 * p.e4[1] - k3 * p.e3[1],
        )
        s = cross(p.e2, p.e3)
        g2 = dot(k, p.e3) / (leg.L2 * s)
        g3 = dot(k, p.e2) / (leg.L3 * s)

        return self.at_motors(p, self.link_torques(p, (w1, w2, w3, w4), (0.0, g2, g3, 0.0)))

    def moments(self, p: Pose) -> tuple[Vector, Vector, Vector, Vector]:
        """Return r1..r4, the moments of mass S1..S4 in the hip frame [kg m]."""
        r1 = placed(p.e1, self.S1)
        r2 = placed(p.e2, self.S2)
        return r1, r2, placed(p.e3, self.S3), placed(p.e4, self.S4)

    def foot_torques(self, p: Pose, force: Vector) -> Vector:
        """Return J^T F [N m] of a foot force [N]; the foot moves with the turns of L1 and L2.

        (J^T F)_A = AB x F + a2 BF x F,   (J^T F)_E = b2 BF x F
        """
        # Virtual work: each motor takes the torque on L2 about B as much as it turns L2.
        about_B = cross(placed(p.e2, self.leg.foot_offset), force)
        return self.leg.L1 * cross(p.e1, force) + p.a2 * about_B, p.b2 * about_B

    def accelerations(self, p: Pose, w: Vector, tau: Vector, force: Vector | None) -> Vector:
        """Return theta_ddot [rad/s^2] = M^-1 (tau - bias + J^T F)."""
        M_AA, M_AE, M_EE = self.mass(p)
        h_A, h_E = self.bias(p, *w)
        f_A, f_E = (0.0, 0.0) if force is None else self.foot_torques(p, force)
        t_A = tau[0] - h_A + f_A
        t_E = tau[1] - h_E + f_E
        # Cramer's rule: accurate enough for a positive definite 2 x 2 matrix, and it saves a LAPACK
        # call in every step.
        det = M_AA * M_EE - M_AE * M_AE
        return (M_EE * t_A - M_AE * t_E) / det, (M_AA * t_E - M_AE * t_A) / det

    def energies(self, p: Pose, w: Four, r: tuple[Vector, Vector, Vector, Vector]) -> Vector:
        """Return the kinetic and the potential energy, zero at O [J]; the loop may be open.

        psi_dot^T H psi_dot / 2,   -gravity . (moments of mass about O)

        Args:
            p: The pose.
            w: Rates of the links [rad/s].
            r: Its `moments`.
        """
        w1, w2, w3, w4 = w
        H12, H43 = self._coupled_by(p, r[1], r[2])
        turning = self.I1 * w1 * w1 + self.I2 * w2 * w2 + self.I3 * w3 * w3 + self.I4 * w4 * w4
        lift = total(weigh(moment, self.leg.gravity) for moment in (self.hung, *r))
        return 0.5 * turning + H12 * w1 * w2 + H43 * w4 * w3, -lift


# A controller asks for the same leg at every control step, and a run for every metric. Typed, since
# 1.0 == True.
@lru_cache(maxsize=256, typed=True)
def kept(leg: FiveBar, assembly: int | None, payload: float) -> Chain:
    """Return the constants of a leg as `Chain.of` does, worked out once."""
    return Chain.of(leg, assembly, payload)


def about_joint(link: Link) -> Scalar:
    """Return the inertia of a link about its inner joint [kg m^2]: I + m |com|^2."""
    return link.inertia + link.mass * (link.com[0] ** 2 + link.com[1] ** 2)
