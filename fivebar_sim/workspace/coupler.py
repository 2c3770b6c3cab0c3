"""Coupler curves: the path of a point on the middle link of a four-bar, as dense polylines.

A curve is kept as its poses q of `FourBar`. A point between two neighbours is found on the chord in
q, and set onto G = 0 by Newton steps along dG/dq. The only special poses are the curve's double
points (both pivots, B and C in line), whereas a single angle as parameter has dead centres.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.workspace.four_bar import EXACT, FourBar
from fivebar_sim.workspace.roots import crossing, lowest

STEP = 0.04
"""Largest difference between neighbours: in both angles and in the direction of F's velocity [rad],
and in F over `FourBar.scale`."""

FLOOR = 1e-7
"""Neighbours closer than this in both angles [rad] are not split for a turn of the velocity."""

SPLITS = 60
"""Most halvings of a step in tracing: down to a float's last place."""


def spans(radius: float, base: float, low: float, high: float) -> list[tuple[float, float]]:
    """Return the angles x at which low <= |radius e^(i x) - base| <= high, as intervals.

    At a distance r the angle is, without loss of digits near 0 and pi,

        x = 2 atan2(sqrt(r^2 - (radius - base)^2), sqrt((radius + base)^2 - r^2))

    Returns:
        (start, stop) [rad], at most two, the one below the axis first; (-pi, pi) is a whole turn.
    """
    near = abs(radius - base)
    far = radius + base
    slack = EXACT * far
    if not (low <= far + slack and high >= near - slack):
        return []
    # A circle about the origin, or base 0: one distance for all angles.
    if near == far:
        return [(-np.pi, np.pi)]

    r = np.array([low, high])
    sine2 = (r - near) * (r + near)
    cosine2 = (far - r) * (far + r)
    halves = np.arctan2(np.sqrt(np.maximum(sine2, 0.0)), np.sqrt(np.maximum(cosine2, 0.0)))
    first, last = (2.0 * halves).tolist()
    # The two intervals, mirror images about the axis, meet at 0 or at pi: then they are one.
    if first == 0.0:
        return [(-last, last)]
    if last == np.pi:
        return [(first, 2.0 * np.pi - first)]

    return [(-last, -first), (first, last)]


def trace(bar: FourBar) -> list[Array]:
    """Return all poses of a four-bar as continuous polylines q (n, 2), closed but for whole turns.

    The crank is swept over its range, as x = middle - half cos t where that is less than a turn,
    with the coupler on one side of the line from B to the pivot for 0 < t < pi, then on the other.
    Where B can rest on the second pivot the coupler turns about it freely: a curve of its own.
    """
    rocker = float(bar.rocker)
    reach = (abs(bar.coupler - rocker), bar.coupler + rocker)
    tiny = EXACT * bar.scale
    whole = np.linspace(0.0, 2.0 * np.pi, round(2.0 * np.pi / STEP) + 2)

    # Without a coupler B and C are one pin, about which the foot turns.
    if bar.coupler <= tiny:
        ends = {x for x, y in spans(bar.crank, bar.base, *reach) if y - x < 2.0 * np.pi}
        return [np.stack([np.full_like(whole, x), whole], axis=-1) for x in sorted(ends)]

    curves: list[Array] = []
    for start, stop in spans(bar.crank, bar.base, *reach):
        if stop - start == 2.0 * np.pi:
            poses = [partial(_turning, bar, side) for side in (-1.0, 1.0)]
        else:
            poses = [partial(_swinging, bar, 0.5 * (start + stop), 0.5 * (stop - start))]
        curves += [piece for pose in poses for piece in _sample_poses(bar, pose)]

    # B rests on the second pivot: the coupler turns, and the crank's angle does not change.
    if abs(bar.crank - bar.base) <= tiny and abs(bar.coupler - rocker) <= tiny:
        curves.append(np.stack([np.zeros_like(whole), whole], axis=-1))
    return curves


def cut(bar: FourBar, q: Array, f: Callable[[Array], Array]) -> Array:
    """Return a polyline q (n, 2) with the poses inserted at which f changes its sign."""
    # Two roots within one segment leave no change of sign at its ends: split it first.
    q = _split_double_roots(bar, q, f)
    value = f(q)
    rows = np.flatnonzero(value[:-1] * value[1:] < 0.0)
    start = q[rows]
    dq = q[rows + 1] - q[rows]
    s = crossing(lambda s: f(bar.between(start, dq, s)), value[rows], value[rows + 1])

    return np.insert(q, rows + 1, bar.between(start, dq, s), axis=0)


def _split_double_roots(bar: FourBar, q: Array, f: Callable[[Array], Array]) -> Array:
    """Return a polyline with a pose inserted between any two roots of f on one segment.

    At both ends of such a segment f has the same sign. The other sign is searched for where f is as
    close to zero as it changes from one pose to the next.
    """
    value = f(q)
    step = np.abs(np.diff(value))

    # Beside an extreme of f its own step is small, so those of both neighbours count.
    around = step + np.append(step[1:], 0.0) + np.insert(step[:-1], 0, 0.0)
    sign = np.sign(value[:-1])
    near = (sign == np.sign(value[1:])) & (np.minimum(*np.abs([value[:-1], value[1:]])) <= around)
    rows = np.flatnonzero(near)
    if not rows.size:
        return q

    start = q[rows]
    dq = q[rows + 1] - q[rows]
    s = lowest(lambda s: sign[rows] * f(bar.between(start, dq, s)), len(rows))
    found = bar.between(start, dq, s)
    # Only where f goes through zero and comes back; elsewhere it just came near.
    keep = sign[rows] * f(found) < 0.0

    return np.insert(q, rows[keep] + 1, found[keep], axis=0)


def runs(q: Array, chosen: Bools) -> list[Array]:
    """Return the pieces of a polyline whose segments (n - 1,) are chosen; a closed one may wrap."""
    # Compared as directions, since a whole turn of the crank adds 2 pi.
    closed = np.allclose(np.exp(1j * q[0]), np.exp(1j * q[-1]), rtol=0, atol=1e-9)
    if closed and not chosen.all() and chosen[0] and chosen[-1]:
        # Start in a gap, so that no piece is cut in two at the seam.
        first = int(np.argmin(chosen))
        whole = q[-1] - q[0]
        q = np.concatenate([q[first:-1], q[: first + 1] + whole])
        chosen = np.roll(chosen, -first)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    return [q[start : stop + 1] for start, stop in edges.reshape(-1, 2)]


def _turning(bar: FourBar, side: float, t: Array) -> Array:
    return _on_side(bar, t, np.full_like(t, side))


def _swinging(bar: FourBar, middle: float, half: float, t: Array) -> Array:
    return _on_side(bar, middle - half * np.cos(t), np.where(t < np.pi, 1.0, -1.0))


def _on_side(bar: FourBar, theta: Array, side: Array) -> Array:
    """Return the poses of crank angles, with C left (+1) or right (-1) of the line B to base."""
    B = bar.crank * np.exp(1j * theta)
    r = bar.base - B
    d2 = np.abs(r) ** 2
    K = bar.coupler
    R = bar.rocker
    along = d2 + (K - R) * (K + R)
    across = np.sqrt(np.maximum(((K + R) ** 2 - d2) * (d2 - (K - R) ** 2), 0.0))
    k = np.unwrap(np.angle(r * (along + 1j * side * across) * np.exp(-1j * theta)))
    return np.stack([theta, k], axis=-1)


def _sample_poses(bar: FourBar, pose: Callable[[Array], Array]) -> list[Array]:
    """Return the poses of 0 <= t <= 2 pi, so dense that neighbours are within `STEP`.

    The polyline is cut at jumps, which no halving of t fills.
    """
    t = np.linspace(0.0, 2.0 * np.pi, 65)
    q = pose(t)
    for _ in range(SPLITS):
        wide = np.flatnonzero(_coarse(bar, q) & (np.diff(t) > 1e-14))
        if not wide.size:
            break
        t = np.insert(t, wide + 1, 0.5 * (t[wide] + t[wide + 1]))
        q = pose(t)
    jumps = np.flatnonzero((np.abs(np.diff(q, axis=0)) > 2.0 * STEP).any(axis=-1)) + 1
    return [q[a:b] for a, b in pairwise([0, *jumps.tolist(), len(q)])]


def _coarse(bar: FourBar, q: Array) -> Bools:
    """Return which neighbours are too far apart: in angle, in place, in F's direction, in C'."""
    dq = np.diff(q, axis=0)
    F = bar.joints(q)[2]
    other = bar.other_elbow(q)
    before = bar.velocity(q[:-1], dq)
    after = bar.velocity(q[1:], dq)
    turn = np.abs(np.angle(after * np.conj(before)))
    far = np.maximum(np.abs(np.diff(F)), np.abs(np.diff(other))) > STEP * bar.scale
    angle = np.abs(dq).max(axis=-1)
    return (angle > STEP) | ((far | (turn > STEP)) & (angle > FLOOR))
