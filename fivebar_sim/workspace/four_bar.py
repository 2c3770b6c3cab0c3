"""A four-bar with a foot on its coupler, in the complex plane.

The crank's pivot is the origin and the rocker's pivot is at `base` on the real axis. With theta the
crank's direction, k the coupler's angle from the crank:

    B = crank e^(i theta)
    C = B + coupler e^(i (theta + k))
    F = B + offset e^(i (theta + k))

and a pose q = (theta, k) closes the four-bar where

    G(q) = (|C - base|^2 - rocker^2) / 2 = 0,   dG/dq = (base C_y, -Im conj(C - base) (C - B))
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array

Complex = NDArray[np.complex128]

EXACT = 1e-12
"""Lengths that differ by less, relative to `FourBar.scale`, are equal."""


class FourBar(NamedTuple):
    """A four-bar with a foot on its coupler; lengths in m, above zero but for `base` and `offset`.

    Attributes:
        crank: From the origin to B.
        coupler: From B to C; 0 where B and C are one pin.
        rocker: From the second pivot to C; one for all poses, or one each, (n,).
        base: From the origin to the second pivot.
        offset: F from B, in the frame of the coupler.
    """

    crank: float
    coupler: float
    rocker: float | Array
    base: float
    offset: complex

    @property
    def scale(self) -> float:
        """Length to which tolerances are relative [m]."""
        return self.crank + max(self.coupler, abs(self.offset))

    def joints(self, q: Array) -> tuple[Complex, Complex, Complex]:
        """Return B, C and F of poses (..., 2), each (...)."""
        B = self.crank * turn(q[..., 0])
        along = turn(q[..., 0] + q[..., 1])
        return B, B + self.coupler * along, B + self.offset * along

    def gradient(self, q: Array) -> tuple[Array, Array]:
        """Return G [m^2], (...), and dG/dq, (..., 2)."""
        B, C, _ = self.joints(q)
        gap, slope_0, slope_1 = self._gap(B, C)
        return gap, np.stack([slope_0, slope_1], axis=-1)

    def _gap(self, B: Complex, C: Complex) -> tuple[Array, Array, Array]:
        """Return G and its derivatives by each of the two angles."""
        r = C - self.base
        size = np.abs(r)
        # Factored: the difference of squares would lose the digits that Newton needs.
        gap = 0.5 * (size - self.rocker) * (size + self.rocker)
        return gap, self.base * C.imag, -(np.conj(r) * (C - B)).imag

    def between(self, q: Array, dq: Array, s: Array) -> Array:
        """Return the poses of the curve at fractions s of the chords from q to q + dq."""
        rounding = np.finfo(float).eps * self.scale**2
        # Each angle on its own: most calls are of few poses, and joining them takes longest.
        q_0 = q[..., 0] + s * dq[..., 0]
        q_1 = q[..., 1] + s * dq[..., 1]

        # Newton squares the relative gap, at first 1e-3: three steps reach rounding.
        for _ in range(3):
            B = self.crank * turn(q_0)
            gap, slope_0, slope_1 = self._gap(B, B + self.coupler * turn(q_0 + q_1))
            square = slope_0**2 + slope_1**2
            # A pose that is on the curve to rounding stays: a step there would only add noise.
            off = (np.abs(gap) > rounding) & (square > 0.0)
            step = np.where(off, gap / np.where(off, square, 1.0), 0.0)
            q_0 = q_0 - step * slope_0
            q_1 = q_1 - step * slope_1

        return np.stack([q_0, q_1], axis=-1)

    def velocity(self, q: Array, dq: Array) -> Complex:
        """Return dF per radian along the curve, in the direction of the chord dq [m], (...)."""
        return self.foot(q, dq)[1]

    def foot(self, q: Array, dq: Array) -> tuple[Complex, Complex]:
        """Return F and its `velocity` in the direction of the chord dq [m], each (...)."""
        B, C, F = self.joints(q)
        _, slope_0, slope_1 = self._gap(B, C)
        tangent = np.stack([-slope_1, slope_0], axis=-1)
        # At a double point dG/dq is 0 and has no direction: the chord stands in for it.
        steep = _norm2(tangent) > (EXACT * self.scale**2) ** 2
        tangent = np.where(steep[..., None], tangent, dq)
        length = np.sqrt(_norm2(tangent))
        sense = np.where((tangent * dq).sum(axis=-1) < 0.0, -1.0, 1.0)
        t = tangent * (sense / np.where(length > 0.0, length, 1.0))[..., None]
        return F, 1j * (F * t[..., 0] + (F - B) * t[..., 1])

    def other_elbow(self, q: Array) -> Complex:
        """Return where C is if the foot stays and crank and coupler bend the other way, (...).

        With w = F e^(-i theta): theta' = theta + 2 arg w, and offset e^(i k) becomes its mirror
        image. Where F is on the origin the image is C itself.
        """
        w = self.crank + self.offset * np.exp(1j * q[..., 1])
        # w / conj(w) = e^(2 i arg w), without an angle that wraps.
        spin = np.where(w == 0.0, 1.0, w) / np.conj(np.where(w == 0.0, 1.0, w))
        mirrored = np.conj(self.offset) * np.exp(-1j * q[..., 1]) / self.offset
        return np.exp(1j * q[..., 0]) * spin * (self.crank + self.coupler * mirrored)


def turn(angle: Array) -> Complex:
    """Return e^(i angle)."""
    return np.exp(1j * angle)


def _norm2(v: Array) -> Array:
    return v[..., 0] ** 2 + v[..., 1] ** 2
