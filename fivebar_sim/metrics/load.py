"""How the two motors share the load: torques, shares, work, and one motor against the other.

The torque is constant over a step, so its work is exactly the torque times the turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.arrays import (
    Array,
    Bools,
    at,
    first_index,
)
from fivebar_sim.checks import check_number
from fivebar_sim.dynamics import antagonism
from fivebar_sim.errors import ArgumentError, FiveBarError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.columns import MOTORS, by_motor, motors
from fivebar_sim.metrics.json_types import Motors
from fivebar_sim.metrics.sharing import (
    UNDEFINED,
    Bins,
    Opposing,
    Phase,
    Share,
    Sharing,
    Work,
    Works,
)

TINY = 1e-6
"""Torque or work up to this part of the window's largest counts as zero: it comes from rounding
of the setpoints and the softness of the loop, so its share would mean nothing."""

LARGEST = 1e9
"""Largest torque [N m] and angle [rad] that is accepted."""

BINS_MAX = 1000
"""Largest number of phase bins."""


class _Steps(NamedTuple):
    """Torques and works of every step of a window.

    Attributes:
        torque: (tau_A, tau_E) [N m], (N, 2).
        work: Work of each motor [J], (N, 2).
        against: Whether one motor drove and the other braked in each step, (N,).
        time: When each begins, from the window's start [s], (N,).
        peak: Largest |torque| of the window [N m].
    """

    torque: Array
    work: Array
    against: Bools
    time: Array
    peak: float

    def rows(self, which: NDArray[np.intp]) -> _Steps:
        """Return some of the steps of the window."""
        torque = _rows(self.torque, which)
        work = _rows(self.work, which)
        return _Steps(torque, work, self.against[which], self.time[which], self.peak)


class _Sums(NamedTuple):
    """Sums of torques over some steps, scaled by the largest so that no square underflows.

    Attributes:
        peak: Largest |torque| of them [N m].
        first: Sum of |tau / peak| of A and of E, (2,).
        second: Sum of (tau / peak)^2, (2,).
        steps: How many they are.
    """

    peak: float
    first: Array
    second: Array
    steps: int

    @classmethod
    def of(cls, tau: Array) -> _Sums:
        """Return the sums of torques (N, 2), N at least 1."""
        amount = np.abs(tau)
        peak = float(amount.max())
        if not peak > 0.0:
            return cls(peak, np.zeros(2), np.zeros(2), len(tau))
        part = amount / peak
        return cls(peak, part.sum(axis=0), (part**2).sum(axis=0), len(tau))

    @property
    def rms(self) -> Array:
        """Root of the mean square of each motor's torque [N m], (2,)."""
        return self.peak * np.sqrt(self.second / self.steps)

    def share(self, sums: Array, floor: float) -> float | None:
        """Return A's part of a pair of sums, or None if no torque is above `floor`."""
        if not self.peak > floor:
            return None
        A, E = sums.tolist()
        return A / (A + E)


def measure(
    torque: ArrayLike,
    theta: ArrayLike,
    timestep: float,
    *,
    stance: ArrayLike | None = None,
    phase: ArrayLike | None = None,
    bins: int = 8,
) -> dict[str, Any]:
    """Return how motors A and E shared the load over a window of N steps.

    With tau the torque of a motor, W = tau (theta after the step - theta before it), and sums over
    the steps:

        torque_rms = sqrt(mean tau^2),   torque_peak = max |tau|,   of A and of E
        share_A = sum |tau_A| / (sum |tau_A| + sum |tau_E|),   thermal_share_A the same of tau^2
        peak_ratio, rms_ratio = the larger of the two motors' / the smaller, so 1 is even
        work.A.positive = sum max(W_A, 0),   negative = sum min(W_A, 0),   net = their sum
        opposing: of the steps with W_A W_E < 0, one motor driving and the other braking,
            fraction = their part of all,   first = start of the first, from the window's [s],
            energy = sum min(|W_A|, |W_E|), which went from one motor to the other [J]

    Undefined values are None: a share where neither torque is above `TINY` of the window's peak, a
    ratio where the smaller one is not, `first` if no motor opposed, and everything over no steps.

    Args:
        torque: (tau_A, tau_E) of every step [N m], (N, 2), N at least 1.
        theta: (theta_A, theta_E) before the first step and after every one [rad], (N + 1, 2);
            continuous, not wrapped.
        timestep: [s].
        stance: Whether the foot stands in each step, (N,) bools: "stance" then has the same values
            over those steps alone.
        phase: Phase of every step in its gait cycle, in [0, 1), (N,): "phase" then has share_A and
            torque_rms of A and of E in each bin.
        bins: Number of bins; bin i is [i, i + 1) / bins.

    Raises:
        ArgumentError: Other shapes, numbers outside their range or not finite, no steps.
    """
    found = sharing(torque, theta, timestep, stance=stance, phase=phase, bins=bins)
    return msgspec.to_builtins(found)


def sharing(
    torque: ArrayLike,
    theta: ArrayLike,
    timestep: float,
    *,
    stance: ArrayLike | None = None,
    phase: ArrayLike | None = None,
    bins: int = 8,
) -> Sharing:
    """Return what `measure` does, with a type: the arguments and errors are the same."""
    steps = _steps(torque, theta, timestep)
    rows = len(steps.torque)
    # All steps of the window first: their peak decides what counts as zero in any part of it.
    found = Sharing(**msgspec.structs.asdict(_over(steps)))

    if stance is not None:
        chosen = _mask(stance, rows)
        part = _over(steps.rows(np.flatnonzero(chosen))) if chosen.any() else UNDEFINED
        found = msgspec.structs.replace(found, stance=part)

    if phase is not None:
        found = msgspec.structs.replace(found, phase=_histogram(steps, phase, bins))

    return found


def moving_share(torque: Array, half: int) -> tuple[Array, Bools]:
    """Return A's part of the absolute torque impulse in a moving window, where there is load.

        share_A = sum |tau_A| / (sum |tau_A| + sum |tau_E|),   over rows k - half ... k + half

    The window is cut off at both ends of the record.

    Args:
        torque: (tau_A, tau_E) [N m], (N, 2).
        half: Rows on each side of the window's centre.

    Returns:
        share_A in [0, 1] of the rows under load, (n,), and which rows those are, (N,): those in
        whose window a torque passes `TINY` of the largest of all rows, as for `share_A`.
    """
    amount = np.abs(torque)
    above = amount > TINY * amount.max()
    real = above[:, 0] | above[:, 1]
    k = np.arange(len(torque))
    low = np.maximum(k - half, 0)
    high = np.minimum(k + half + 1, len(torque))

    # Differences of running sums: the cost does not depend on the window's width.
    so_far = np.concatenate([np.zeros((1, 2)), np.cumsum(amount, axis=0)])
    impulse = so_far[high] - so_far[low]
    counted = np.concatenate([[0], np.cumsum(real)])
    loaded = counted[high] > counted[low]
    return impulse[loaded, 0] / impulse[loaded].sum(axis=1), loaded


def serial(leg: FiveBar, record: Mapping[str, Array], window: slice) -> antagonism.Price:
    """Return heat and gear friction as multiples of a serial leg's; see `dynamics.antagonism`.

    All None where there is no serial leg to compare with.
    """
    pairs = [motors(record, name)[window] for name in ("theta", "theta_dot", "torque")]
    try:
        return antagonism.price(leg, *pairs)
    except FiveBarError:
        # It does not reach, or the leg has left its branch.
        return antagonism.Price(None, None, None)


def _steps(torque: ArrayLike, theta: ArrayLike, timestep: float) -> _Steps:
    """Return the steps of a window, checked."""
    check_number("timestep", timestep, "s", low=0.0, high=LARGEST, strict=True)
    tau = _pairs(torque, "torque", "N m")
    angles = _pairs(theta, "theta", "rad")
    if not len(tau):
        raise ArgumentError("torque must have at least one row, got none")
    if len(angles) != len(tau) + 1:
        raise ArgumentError(
            f"theta must have one row more than torque, before and after every step: shape "
            f"{(len(tau) + 1, 2)}, got {angles.shape}"
        )

    work = tau * np.diff(angles, axis=0)
    time = float(timestep) * np.arange(len(tau), dtype=np.float64)
    return _Steps(tau, work, _against(work), time, float(np.abs(tau).max()))


def _over(steps: _Steps) -> Share:
    """Return the measures over steps, of which there is at least one."""
    work = steps.work
    against = steps.against
    floor = TINY * steps.peak
    sums = _Sums.of(steps.torque)
    rms = sums.rms
    peak = np.abs(steps.torque).max(axis=0)
    # Positive work is driving, negative braking; their sum would hide both.
    given = np.maximum(work, 0.0).sum(axis=0)
    taken = np.minimum(work, 0.0).sum(axis=0)

    works = [
        Work(positive=gain, negative=loss, net=gain + loss)
        for gain, loss in zip(given.tolist(), taken.tolist(), strict=True)
    ]
    return Share(
        torque_rms=_named(rms),
        torque_peak=_named(peak),
        share_A=sums.share(sums.first, floor),
        thermal_share_A=sums.share(sums.second, floor),
        peak_ratio=_ratio(peak, floor),
        rms_ratio=_ratio(rms, floor),
        work=Works(**dict(zip(MOTORS, works, strict=True))),
        opposing=Opposing(
            fraction=float(against.mean()),
            first=float(steps.time[np.argmax(against)]) if against.any() else None,
            energy=float(np.minimum(*np.abs(work).T)[against].sum()),
        ),
    )


def _histogram(steps: _Steps, phase: ArrayLike, bins: int) -> Phase:
    """Return share_A and torque_rms in bins of the gait phase, a list of each."""
    if not isinstance(bins, (int, np.integer)) or not 1 <= bins <= BINS_MAX:
        raise ArgumentError(f"bins must be a whole number in [1, {BINS_MAX}], got {bins!r}")

    shape = (len(steps.torque),)
    cycle = _numbers(phase, "phase")
    if cycle.shape != shape:
        raise ArgumentError(f"phase must have shape {shape}, got {cycle.shape}")

    bad = ~((cycle >= 0.0) & (cycle < 1.0))
    if bad.any():
        i = first_index(bad)
        raise ArgumentError(f"phase must be in [0, 1), got {float(cycle[i])!r}{at(i)}")

    # Always below bins: even the float before 1 does not round up to it.
    bin_of = (cycle * bins).astype(np.int16)
    # Sorted once, each bin's steps in their order, instead of a mask for each.
    order = np.argsort(bin_of, kind="stable")
    ends = np.cumsum(np.bincount(bin_of, minlength=bins))
    parts = np.split(_rows(steps.torque, order), ends[:-1])
    sums = [_Sums.of(part) if len(part) else None for part in parts]
    rms = [Motors(A=None, E=None) if each is None else _named(each.rms) for each in sums]
    floor = TINY * steps.peak

    return Phase(
        share_A=[None if each is None else each.share(each.first, floor) for each in sums],
        torque_rms=Bins(A=[each.A for each in rms], E=[each.E for each in rms]),
    )


def _against(work: Array) -> Bools:
    """Return in which steps one motor gives work and the other takes it, both more than `TINY`."""
    # Both must be real work: next to nothing has a sign too.
    amount = np.abs(work)
    real = amount > TINY * amount.max()
    return real[:, 0] & real[:, 1] & (np.signbit(work[:, 0]) != np.signbit(work[:, 1]))


def _ratio(pair: Array, floor: float) -> float | None:
    """Return the larger of a pair over the smaller, or None if that is at most `floor`."""
    small, large = sorted(pair.tolist())
    return large / small if small > floor else None


def _named(pair: Array) -> Motors:
    return Motors(**by_motor(pair))


def _rows(pairs: Array, which: NDArray[np.intp]) -> Array:
    """Return some rows of (N, 2), column by column in memory again."""
    return pairs.T.take(which, axis=1).T


def _numbers(values: ArrayLike, name: str) -> Array:
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} must be numbers: {error}") from None


def _pairs(values: ArrayLike, name: str, unit: str) -> Array:
    """Return numbers of shape (N, 2), none beyond `LARGEST`."""
    # Column by column in memory: NumPy sums rows of two a hundred times as slowly.
    pairs = np.asfortranarray(_numbers(values, name))
    if pairs.ndim != 2 or pairs.shape[1] != len(MOTORS):
        raise ArgumentError(f"{name} must have shape (N, 2), got {pairs.shape}")
    bad = np.logical_not(np.abs(pairs) <= LARGEST)
    if bad.any():
        i = first_index(bad)
        most = f"{LARGEST:g}"
        raise ArgumentError(
            f"{name} must be in [-{most}, {most}] {unit}, got {float(pairs[i])!r}{at(i)}"
        )
    return pairs


def _mask(values: ArrayLike, rows: int) -> Bools:
    try:
        mask = np.asarray(values)
    except ValueError as error:
        raise ArgumentError(f"stance must be bools of shape ({rows},): {error}") from None
    if mask.dtype != np.bool_ or mask.shape != (rows,):
        raise ArgumentError(
            f"stance must be bools of shape ({rows},), got {mask.dtype} of shape {mask.shape}"
        )
    return mask
