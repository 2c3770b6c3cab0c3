"""The base of all foot paths: a ramp from rest, a range of times, and checked numbers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from fivebar_sim.arrays import Array, at, first_index
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError
from fivebar_sim.geometry import FiveBar

TIME_ROUNDING = 1e-9
"""Times may pass the end of a path by this fraction of it: the rounding of a long sum of steps."""

FARTHEST = 1e3
"""Upper end of coordinates [m]."""

FASTEST = 1e6
"""Upper end of frequencies [Hz]."""

LONGEST = 1e6
"""Upper end of durations [s]: eleven days."""

Pair = tuple[float, float]


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
    """A foot path p(t) that starts from rest.

    A kind of path overrides `nominal`, the path at its own time, and `period` if it repeats, `span`
    if it stops, or `moves` if it ends in a hold.

    Attributes:
        needs_ground: Whether the path makes no sense without a ground under the foot.
        ramp: How long the path takes to reach its own speed, from rest [s]; from then on it is half
            a ramp late, see `at`. With 0 it starts at speed, and on time.
        outside: What to do with targets out of reach: "refuse" the path, or go to the "nearest"
            reachable point; see `motion.plan`.
    """

    needs_ground: ClassVar[bool] = False

    ramp: float = 0.25
    outside: Literal["refuse", "nearest"] = "refuse"

    def __post_init__(self) -> None:
        check_number("ramp", self.ramp, "s", low=0.0)

    @property
    def period(self) -> float | None:
        """Time after which the nominal path repeats [s], or None if it never does."""
        return None

    @property
    def span(self) -> float:
        """How long the path is defined at its own time [s]; inf if it goes on for ever."""
        return math.inf

    @property
    def moves(self) -> float:
        """How long the foot moves at the path's own time [s]; inf if it is never held."""
        return math.inf

    @property
    def jumps(self) -> bool:
        """Whether the target jumps from place to place: its rates say nothing of the torque."""
        return False

    @property
    def end(self) -> float:
        """Last time at which the path is defined, span + ramp / 2 [s]; may be inf."""
        return self.span + 0.5 * self.ramp

    @property
    def rest(self) -> float:
        """Time from which the foot is held for ever, moves + ramp / 2 [s]; may be inf."""
        return self.moves + 0.5 * self.ramp

    def nominal(self, time: ArrayLike) -> Sample:
        """Return the path at its own time, without the ramp.

        Args:
            time: [s], shape (...).

        Returns:
            Foot in the hip frame, shapes (..., 2).

        Raises:
            ArgumentError: Unless every time is in [0, span].
        """
        raise NotImplementedError

    def at(self, time: ArrayLike) -> Sample:
        """Return the path, eased from rest within the ramp.

        The nominal path p is followed at its own time s(t), with T = ramp, tau = t / T:

            s' = 10 tau^3 - 15 tau^4 + 6 tau^5   for t < T,   s = t - T / 2   from then on
            position = p(s),   velocity = p' s',   acceleration = p'' s'^2 + p' s''

        s' rises from 0 at t = 0 to 1 at t = T, s'' is 0 at both. So the foot starts from rest and
        is never faster than on the nominal path; the acceleration of the ramp, up to 1.9 |p'| / T,
        is less than the path's own if the ramp is half a period or more. The price: from t = ramp
        on the path is half a ramp late.

        Args:
            time: [s], shape (...).

        Returns:
            Foot in the hip frame, shapes (..., 2).

        Raises:
            ArgumentError: Unless every time is in [0, end].
        """
        t = times(time, self.end)
        s, s_dot, s_ddot = (rate[..., None] for rate in ease(t, self.ramp))
        # Chain rule: the path is a curve that is followed at its own time s(t).
        p = self.nominal(s[..., 0])
        return Sample(
            position=p.position,
            velocity=p.velocity * s_dot,
            acceleration=p.acceleration * s_dot**2 + p.velocity * s_ddot,
        )

    def cycle(self, time: ArrayLike) -> Array:
        """Return how far the path is within its period, with the ramp of `at`.

        Args:
            time: [s], shape (...).

        Returns:
            s / period, wrapped into [0, 1), shape (...).

        Raises:
            ArgumentError: A path that does not repeat, or times outside [0, inf).
        """
        if self.period is None:
            raise ArgumentError("a path that does not repeat has no cycle")
        return np.mod(ease(times(time, self.end), self.ramp)[0] / self.period, 1.0)

    def resolve(self, folder: Path) -> Self:
        """Return the path with its files read and checked; names are relative to folder.

        Raises:
            ConfigError: A file that cannot be read or holds an illegal value.
        """
        del folder  # only the kinds that read a file need it
        return self

    def of_leg(self, leg: FiveBar) -> Self:
        """Return the path for a leg; only motor angles give each leg another foot path."""
        del leg
        return self

    def _times(self, time: ArrayLike) -> Array:
        """Return times of the nominal path [s]; a time past its span by rounding is set to it."""
        return times(time, self.span)


class Cyclic(FootPath, frozen=True):
    """A path that repeats with a frequency.

    Attributes:
        frequency: [Hz].
    """

    frequency: float

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("frequency", self.frequency, "Hz", low=0.0, high=FASTEST, strict=True)

    @property
    def period(self) -> float:
        """1 / frequency [s]."""
        return 1.0 / self.frequency


def times(time: ArrayLike, end: float) -> Array:
    """Return times as an array [s]; a time past the end by rounding is set to the end.

    Args:
        time: [s], shape (...).
        end: Last legal time [s]; may be inf.

    Raises:
        ArgumentError: Unless every time is a finite number in [0, end].
    """
    try:
        t = np.asarray(time, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"time must be numbers [s]: {error}") from None
    # Written so that NaN is bad too.
    bad = ~((t >= 0.0) & (t <= end * (1.0 + TIME_ROUNDING)) & (t < math.inf))
    if bad.any():
        i = first_index(bad)
        limits = "[0, inf)" if end == math.inf else f"[0, {end:.9g}]"
        raise ArgumentError(f"time must be in {limits} s, got {float(t[i])!r} s{at(i)}")
    return np.minimum(t, end)


def ease(time: Array, ramp: float) -> tuple[Array, Array, Array]:
    """Return the path's own time s [s] of `FootPath.at` with its rates s' and s'' [1/s].

        s = T (5/2 tau^4 - 3 tau^5 + tau^6),   s' = 10 tau^3 - 15 tau^4 + 6 tau^5,
        s'' = 30 tau^2 (1 - tau)^2 / T,   tau = t / T   for t < T = ramp;   s = t - T / 2 after it

    Args:
        time: t >= 0 [s], any shape.
        ramp: T >= 0 [s].
    """
    # tau would be 0 / 0.
    if ramp == 0.0:
        return time, np.ones_like(time), np.zeros_like(time)
    tau = np.minimum(time, ramp) / ramp
    s = np.where(time < ramp, ramp * tau**4 * (2.5 - 3.0 * tau + tau**2), time - 0.5 * ramp)
    s_dot = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
    s_ddot = 30.0 * tau**2 * (1.0 - tau) ** 2 / ramp
    return s, s_dot, s_ddot


def check_ramp(path: FootPath) -> None:
    """Raise unless the ramp ends before the path's own motion does.

    Raises:
        ArgumentError: Unless ramp <= moves.
    """
    if not path.ramp <= path.moves:
        raise ArgumentError(
            f"ramp must be in [0, {path.moves:g}] s, the time that the path moves, got "
            f"{path.ramp:g} s"
        )


def check_pair(
    spec: msgspec.Struct, key: str, unit: str, *, high: float = FARTHEST, positive: bool = False
) -> None:
    """Raise unless a key of a frozen Struct is a pair of numbers; keep it as a tuple of floats.

    Args:
        spec: The Struct with the key.
        key: Name of the key; messages start with it.
        unit: Unit of both numbers, for messages.
        high: Upper end of their size.
        positive: Whether both must be above 0.

    Raises:
        ArgumentError: Not two numbers, or one out of range.
    """
    pair = pair_of(key, getattr(spec, key), unit, high=high, positive=positive)
    # A Struct made in Python keeps what it is given, lists and integers too; this one is frozen.
    msgspec.structs.force_setattr(spec, key, pair)


def pair_of(
    key: str, pair: object, unit: str, *, high: float = FARTHEST, positive: bool = False
) -> Pair:
    """Return a pair of numbers as a tuple of floats; see `check_pair`."""
    if not (isinstance(pair, (tuple, list)) and len(pair) == 2):
        raise ArgumentError(f"{key} must be two numbers [{unit}], got {pair!r}")
    low = 0.0 if positive else -high
    for index, value in enumerate(pair):
        check_number(f"{key}[{index}]", value, unit, low=low, high=high, strict=positive)
    return float(pair[0]), float(pair[1])
