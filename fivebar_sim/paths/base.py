"""What every foot path has: a ramp from rest, a range of times, and checked numbers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple, Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, at, first_index
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError

TIME_ROUNDING = 1e-9
"""Times may pass the end of a path by this fraction of it: the rounding of a long sum of steps."""


FARTHEST = 1e3
"""Upper end of coordinates [m]."""

FASTEST = 1e6
"""Upper end of frequencies [Hz]."""


class Sample(NamedTuple):
    """The foot at given times, in the hip frame (x, z); every array has shape (..., 2).

    Attributes:
        position: [m].
        velocity: [m/s].
        acceleration: [m/s^2].
    """

    position: Array
    velocity: Array
    acceleration: Array


class FootPath(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind"
):
    """A foot path p(t), begun from rest.

    A kind of path overrides `nominal`, the path at its own time, and `period` if it repeats, or
    `end` if it stops.

    Attributes:
        ramp: How long the path takes to reach its own speed, from rest [s]; 0 starts at speed.
    """

    ramp: float = 0.25

    def __post_init__(self) -> None:
        check_number("ramp", self.ramp, "s", low=0.0)

    @property
    def period(self) -> float | None:
        """Time after which the nominal path repeats [s], or None if it never does."""
        return None

    @property
    def end(self) -> float:
        """Last time at which the path is defined [s]; inf if it goes on for ever."""
        return math.inf

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the path at its own time, without the ramp.

        Args:
            time: [s], shape (...).

        Returns:
            Foot in the hip frame, shapes (..., 2).

        Raises:
            ArgumentError: Unless every time is in [0, end].
        """
        raise NotImplementedError

    def at(self, time: ArrayLike) -> Sample:
        """Return the path, eased from rest within the ramp.

        The nominal path p is run through at the phase time s(t), with T = ramp, tau = t / T:

            s / T = 6 tau^3 - 8 tau^4 + 3 tau^5   for t < T,   s = t   from then on
            position = p(s),   velocity = p' s',   acceleration = p'' s'^2 + p' s''

        s, s' and s'' are 0 at t = 0 and T, 1 and 0 at t = T. So the foot starts from rest, and
        from t = ramp on this is the nominal path at the same time t, not a delayed one. The price:
        within the ramp the speed peaks at s' = 1.512 times the nominal one, at tau = 0.6.

        Args:
            time: [s], shape (...).

        Returns:
            Foot in the hip frame, shapes (..., 2).

        Raises:
            ArgumentError: Unless every time is in [0, end].
        """
        s, s_dot, s_ddot = (rate[..., None] for rate in eased(self._times(time), self.ramp))
        p = self.nominal(s[..., 0])
        return Sample(
            position=p.position,
            velocity=p.velocity * s_dot,
            acceleration=p.acceleration * s_dot**2 + p.velocity * s_ddot,
        )

    def resolve(self, folder: Path) -> Self:
        """Return the path with its files read and checked; names are relative to folder.

        Raises:
            ConfigError: A file that cannot be read or says something illegal.
        """
        del folder  # only the kinds that read a file need it
        return self

    def _times(self, time: ArrayLike) -> Array:
        """Return times as an array [s], those past the end by rounding set to the end."""
        try:
            t = np.asarray(time, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ArgumentError(f"time must be numbers [s]: {error}") from None
        bad = ~((t >= 0.0) & (t <= self.end * (1.0 + TIME_ROUNDING)) & (t < math.inf))
        if bad.any():
            i = first_index(bad)
            limits = "[0, inf)" if self.end == math.inf else f"[0, {self.end:.9g}]"
            raise ArgumentError(f"time must be in {limits} s, got {float(t[i])!r} s{at(i)}")
        return np.minimum(t, self.end)


def eased(time: Array, ramp: float) -> tuple[Array, Array, Array]:
    """Return the phase time s [s] of `FootPath.at` with its rates s' and s'' [1/s].

        s = T (6 tau^3 - 8 tau^4 + 3 tau^5),   s' = 18 tau^2 - 32 tau^3 + 15 tau^4,
        s'' = (36 tau - 96 tau^2 + 60 tau^3) / T,   tau = t / T   for t < T = ramp

    Args:
        time: t >= 0 [s], any shape.
        ramp: T >= 0 [s].
    """
    if ramp == 0.0:
        return time, np.ones_like(time), np.zeros_like(time)
    tau = np.minimum(time, ramp) / ramp
    s = np.where(time < ramp, ramp * tau**3 * (6.0 - 8.0 * tau + 3.0 * tau**2), time)
    s_dot = tau**2 * (18.0 - 32.0 * tau + 15.0 * tau**2)
    s_ddot = tau * (36.0 - 96.0 * tau + 60.0 * tau**2) / ramp
    return s, s_dot, s_ddot


def check_pair(path: FootPath, key: str, unit: str, *, positive: bool = False) -> None:
    """Raise unless a path's key is a pair of numbers; keep it as a tuple of floats.

    Raises:
        ArgumentError: With a message that starts with the key.
    """
    pair = getattr(path, key)
    if not (isinstance(pair, (tuple, list)) and len(pair) == 2):
        raise ArgumentError(f"{key} must be two numbers [{unit}], got {pair!r}")
    for index, value in enumerate(pair):
        low = 0.0 if positive else -FARTHEST
        check_number(f"{key}[{index}]", value, unit, low=low, high=FARTHEST, strict=positive)
    msgspec.structs.force_setattr(path, key, tuple(map(float, pair)))
