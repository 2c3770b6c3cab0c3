"""Foot paths with a formula: ellipse, circle, line and figure of eight, all periodic."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array
from fivebar_sim.checks import check_number
from fivebar_sim.paths.base import FARTHEST, Cyclic, Pair, Sample, check_pair


class _Harmonic(Cyclic, frozen=True):
    """A path of sines and cosines."""

    @property
    def omega(self) -> float:
        """Angular frequency w = 2 pi frequency [rad/s]."""
        return 2.0 * math.pi * self.frequency


class Ellipse(_Harmonic, frozen=True, tag="ellipse"):
    """An upright ellipse, from its lowest point towards +x; see `nominal`.

    Attributes:
        centre: (cx, cz) [m].
        radii: (rx, rz) [m].
    """

    centre: Pair
    radii: Pair

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pair(self, "centre", "m")
        check_pair(self, "radii", "m", positive=True)

    def nominal(self, time: ArrayLike) -> Sample:
        """Return x = cx + rx sin(wt), z = cz - rz cos(wt) and its rates; see `FootPath.nominal`."""
        return _orbit(self.centre, self.radii, self.omega, self._times(time))


class Circle(_Harmonic, frozen=True, tag="circle"):
    """A circle, from its lowest point towards +x; see `nominal`.

    Attributes:
        centre: (cx, cz) [m].
        radius: r [m].
    """

    centre: Pair
    radius: float

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pair(self, "centre", "m")
        check_number("radius", self.radius, "m", low=0.0, high=FARTHEST, strict=True)

    def nominal(self, time: ArrayLike) -> Sample:
        """Return x = cx + r sin(wt), z = cz - r cos(wt) and its rates; see `FootPath.nominal`."""
        return _orbit(self.centre, (self.radius, self.radius), self.omega, self._times(time))


class Line(Cyclic, frozen=True, tag="line"):
    """A straight line there and back, at rest at both ends; see `nominal`.

    Attributes:
        start: (x, z) [m], at t = 0.
        stop: (x, z) [m], half a period later; equal to start it holds the foot there.
    """

    start: Pair
    stop: Pair

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pair(self, "start", "m")
        check_pair(self, "stop", "m")

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the minimum-jerk line and its rates; see `FootPath.nominal`.

            p = start + (stop - start) h(tau),   h = 10 tau^3 - 15 tau^4 + 6 tau^5

        tau runs from 0 to 1 in the first half of each period and back in the second, at a rate of
        +-2 frequency; h' = h'' = 0 at both ends, so the turns are smooth.
        """
        cycle = np.mod(self._times(time) * self.frequency, 1.0)[..., None]
        tau = np.where(cycle < 0.5, 2.0 * cycle, 2.0 - 2.0 * cycle)
        tau_dot = np.where(cycle < 0.5, 2.0, -2.0) * self.frequency
        h = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
        dh = 30.0 * tau**2 * (1.0 - tau) ** 2
        ddh = 60.0 * tau * (1.0 - tau) * (1.0 - 2.0 * tau)
        start = np.array(self.start)
        stop = np.array(self.stop)
        span = stop - start
        # Measured from the nearer end, so that both ends are met to the last bit.
        position = np.where(tau < 0.5, start + span * h, stop - span * (1.0 - h))

        return Sample(position, span * dh * tau_dot, span * ddh * tau_dot**2)


class FigureEight(_Harmonic, frozen=True, tag="figure-eight"):
    """A lying eight, 2 rx wide and 2 rz high, from its crossing towards +x, +z; see `nominal`.

    Attributes:
        centre: (cx, cz) [m], the crossing.
        radii: (rx, rz) [m].
    """

    centre: Pair
    radii: Pair

    def __post_init__(self) -> None:
        super().__post_init__()
        check_pair(self, "centre", "m")
        check_pair(self, "radii", "m", positive=True)

    def nominal(self, time: ArrayLike) -> Sample:
        """Return x = cx + rx sin(wt), z = cz + rz sin(2wt), with rates; see `FootPath.nominal`."""
        cx, cz = self.centre
        rx, rz = self.radii
        w = self.omega
        phase = w * self._times(time)
        sin = np.sin(phase)
        cos = np.cos(phase)
        sin2 = np.sin(2 * phase)
        cos2 = np.cos(2 * phase)

        return Sample(
            position=np.stack([cx + rx * sin, cz + rz * sin2], axis=-1),
            velocity=w * np.stack([rx * cos, 2.0 * rz * cos2], axis=-1),
            acceleration=w**2 * np.stack([-rx * sin, -4.0 * rz * sin2], axis=-1),
        )


def _orbit(centre: Pair, radii: Pair, w: float, time: Array) -> Sample:
    """Return x = cx + rx sin(wt), z = cz - rz cos(wt) with its rates."""
    cx, cz = centre
    rx, rz = radii
    sin = np.sin(w * time)
    cos = np.cos(w * time)
    return Sample(
        position=np.stack([cx + rx * sin, cz - rz * cos], axis=-1),
        velocity=w * np.stack([rx * cos, rz * sin], axis=-1),
        acceleration=w**2 * np.stack([-rx * sin, rz * cos], axis=-1),
    )
