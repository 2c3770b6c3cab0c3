"""Foot paths: the motor angles that follow one without a jump, and the singularities it meets.

Only the points of a path are looked at: what happens between them shows as a change of sign of a
distance, or as a step of the angles. Sample a path so finely that a step is small compared to the
distances (`singularity.Distances`) that it passes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.analysis.singularity import EDGE, Distances, distances_of, shorter_links
from fivebar_sim.arrays import Array, Bools, as_pairs, at
from fivebar_sim.checks import check_number
from fivebar_sim.errors import ArgumentError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.planar import wrap
from fivebar_sim.kinematics.reach import inverse, inverse_all, inverse_nearest, points_at

TIE = 1e-9
"""Squares of angles [rad^2] closer than this are equal: far above rounding, (30 urad)^2."""

STEP_MAX = 0.5
"""How far a motor may turn between two points of a followed path [rad]. A crank's full turn in 50
points has steps of 0.13 rad; a jump to another solution is mostly above 1 rad."""


class Followed(NamedTuple):
    """Motor angles that follow a foot path of N points.

    Attributes:
        theta: (theta_A, theta_E) [rad], continuous, so not kept within half a turn, (N, 2).
        mode: Working mode (s_A, s_E) of each point, (N, 2).
        changed: Every i where mode[i] differs from mode[i - 1], rising, (n,).
    """

    theta: Array
    mode: NDArray[np.int_]
    changed: NDArray[np.intp]


class Closest(NamedTuple):
    """How near a path comes to one kind of singularity.

    Attributes:
        distance: The distance nearest to zero of all points, with its sign [m].
        time: When the path reaches it [s].
        point: Index of that point of the path.
        crossing: When the path first meets the singularity [s]; inf if it never does. It is met at
            a point that is singular to rounding (sine at most `singularity.EDGE`), and between two
            points with distances of opposite signs, at t_1 + (t_2 - t_1) d_1 / (d_1 - d_2).
    """

    distance: float
    time: float
    point: int
    crossing: float


class PathReport(NamedTuple):
    """How near a foot path comes to each kind of singularity, and all distances, each (N,).

    A side's singularity is met where the foot touches the edge of the side's reach. There its two
    working modes are one, so only there can the mode change. Where `loop` is met, a leg that keeps
    its working mode is forced through an infinite J into the other assembly mode.
    """

    side_A: Closest
    side_E: Closest
    loop: Closest
    distances: Distances


def follow(
    leg: FiveBar, foot: ArrayLike, theta0: ArrayLike, *, step_max: float = STEP_MAX
) -> Followed:
    """Return angles along a foot path: at each point the solution, of four, nearest to the last.

    Nearest as in `kinematics.inverse_nearest`: least sum of squares of the wrapped differences. If
    solutions are equally near, the current working mode is kept. A path that touches the edge of
    reach may leave it in another mode; so may one that passes the edge within a step: then
    `changed` is not empty though no `crossing` is reported, and the points are too few.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (N, 2).
        theta0: (theta_A, theta_E) before the path [rad], (2,); the first point takes the solution
            nearest to it, however far.
        step_max: How far a motor may turn from one point to the next [rad].

    Returns:
        The angles, the working modes, and where they change.

    Raises:
        UnreachableError: Where there is no solution, or none within step_max of the last, so that
            no continuous motion follows the path; `.index` is the first such point.
        ArgumentError: A wrong shape, theta0 not finite, or unless step_max > 0.
    """
    path = _path(foot)
    start = as_pairs(theta0, "theta0")
    check_number("step_max", step_max, "rad", low=0.0, strict=True)
    if start.shape != (2,):
        raise ArgumentError(f"theta0 must have shape (2,), got {start.shape}")

    every = inverse_all(leg, path)
    lost = np.asarray(np.isnan(every[..., 0]).all(axis=-1))
    _refuse_lost(leg, path, lost, [leg.mode] * len(path))

    first = inverse_nearest(leg, path[0], start)
    row = _nearest_rows(first, every)
    chosen = every[np.arange(len(path)), row]
    theta = np.unwrap(np.concatenate([first[None], chosen]), axis=0)[1:]
    _refuse_jump(theta, step_max)
    mode = np.array(MODES)[row]
    changed = np.flatnonzero((mode[1:] != mode[:-1]).any(axis=-1)) + 1

    return Followed(theta, mode, changed)


def path_report(
    leg: FiveBar, foot: ArrayLike, time: ArrayLike, *, mode: Mode | ArrayLike | None = None
) -> PathReport:
    """Return how near a foot path comes to each kind of singularity, and when it first meets it.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (N, 2).
        time: Time of each point [s], rising, (N,).
        mode: Working mode (s_A, s_E), one or of each point (N, 2), as in `Followed`; None is the
            leg's own.

    Returns:
        The report; its distances are of shape (N,).

    Raises:
        UnreachableError: Where the foot is out of reach; `.index` is the first such point.
        ArgumentError: Unknown mode, a wrong shape, or times that are not finite and rising.
    """
    path = _path(foot)
    when = _rising(time, len(path))
    modes = _modes(leg.mode if mode is None else mode, len(path))
    row = [MODES.index(each) for each in modes]
    theta = inverse_all(leg, path)[np.arange(len(path)), row]
    _refuse_lost(leg, path, np.isnan(theta[:, 0]), modes)

    d = distances_of(leg, points_at(leg, path, theta))
    side_A, side_E, loop = (
        _closest(each, EDGE * shorter, when)
        for each, shorter in zip(d, shorter_links(leg), strict=True)
    )
    return PathReport(side_A, side_E, loop, d)


def _nearest_rows(first: Array, every: Array) -> list[int]:
    """Return which of four solutions (N, 4, 2) is nearest to the one chosen before, point by point.

    The best next solution is found for all four at once; the chain of choices is then a walk
    through a table.
    """
    # Costs between all modes of neighbouring points at once; only the walk is a loop.
    before = np.concatenate([np.broadcast_to(first, (1, 4, 2)), every[:-1]])
    cost = np.sum(wrap(every[:, None, :, :] - before[:, :, None, :]) ** 2, axis=-1)
    # Indices are (point, row before, row).
    cost = np.where(np.isnan(cost), np.inf, cost)
    same = np.arange(4)
    keep = cost[:, same, same] <= cost.min(axis=-1) + TIE
    table = np.where(keep, same, np.argmin(cost, axis=-1))
    # No mode is kept at the first point: there is no row before it.
    table[0] = np.argmin(cost[0, 0])
    rows = [0]
    for to in table.tolist():
        rows.append(to[rows[-1]])
    return rows[1:]


def _closest(distance: Array, zero: float, time: Array) -> Closest:
    """Return how near distances (N,) come to zero, and when first; at most `zero` [m] is zero."""
    i = int(np.argmin(np.abs(distance)))
    d_1 = distance[:-1]
    d_2 = distance[1:]
    # Linear between two points, where nothing else is known.
    k = np.flatnonzero(np.sign(d_1) * np.sign(d_2) < 0.0)
    between = time[k] + np.diff(time)[k] * d_1[k] / (d_1[k] - d_2[k])
    met = np.concatenate([time[np.abs(distance) <= zero], between])
    return Closest(float(distance[i]), float(time[i]), i, float(np.min(met, initial=np.inf)))


def _path(foot: ArrayLike) -> Array:
    path = as_pairs(foot, "foot")
    if path.ndim != 2 or not len(path):
        raise ArgumentError(f"foot must have shape (N, 2) with N above 0, got {path.shape}")
    return path


def _rising(time: ArrayLike, count: int) -> Array:
    try:
        when = np.asarray(time, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"time must be numbers of shape ({count},): {error}") from None
    if when.shape != (count,):
        raise ArgumentError(f"time must have shape ({count},), got {when.shape}")
    if not (np.isfinite(when).all() and np.all(np.diff(when) > 0.0)):
        raise ArgumentError("time must be finite and rising [s]")
    return when


def _modes(mode: Mode | ArrayLike, count: int) -> list[Mode]:
    """Return the working mode of each of `count` points."""
    given = np.asarray(mode)
    if given.shape not in ((2,), (count, 2)):
        raise ArgumentError(f"mode must have shape (2,) or ({count}, 2), got {given.shape}")
    modes = [(each[0], each[1]) for each in np.broadcast_to(given, (count, 2)).tolist()]
    for each in set(modes):
        if each not in MODES:
            raise ArgumentError(f"mode must be one of {MODES}, got {each!r}")
    return modes


def _refuse_lost(leg: FiveBar, path: Array, lost: Bools, modes: list[Mode]) -> None:
    """Raise for the first point that is out of reach, with the error of `inverse`."""
    for i in np.flatnonzero(lost)[:1].tolist():
        try:
            inverse(leg, path[i], modes[i])
        except UnreachableError as error:
            raise UnreachableError(f"{error}{at((i,))}", (i,)) from None


def _refuse_jump(theta: Array, step_max: float) -> None:
    step = np.abs(np.diff(theta, axis=0)).max(axis=-1, initial=0.0)
    for i in np.flatnonzero(~(step <= step_max))[:1].tolist():
        raise UnreachableError(
            f"no continuous motion follows the path: its nearest solutions must be within "
            f"{step_max:g} rad of each other, got a step of {step[i]:.3g} rad{at((i + 1,))}",
            (i + 1,),
        )
