"""Coupler curves as one set of samples, and their points nearest to given points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array
from fivebar_sim.workspace.four_bar import Complex, FourBar
from fivebar_sim.workspace.roots import crossing

Rows = NDArray[np.intp]


class Curves(NamedTuple):
    """The boundary's coupler curves: poses one after the other, and the segments between them.

    Attributes:
        F: Feet of the poses [m], (n,).
        first: Pose at which each segment starts; it ends at the next, (m,).
        q: The poses (theta_A, theta_B) at which segments start [rad], (m, 2).
        dq: Difference to the next pose [rad], (m, 2).
        rocker: |EC| of each segment [m], (m,).
        leave: Velocity of F at the segment's start, per radian along the curve [m], (m,).
        arrive: The same at its end [m], (m,).
        ends: Start and stop in F of each connected piece, (k, 2).
    """

    F: Complex
    first: NDArray[np.intp]
    q: Array
    dq: Array
    rocker: Array
    leave: Complex
    arrive: Complex
    ends: NDArray[np.intp]


def gather(pieces: list[tuple[FourBar, Array]]) -> Curves:
    """Return polylines of poses as one set of samples."""
    count = np.array([len(q) for _, q in pieces], dtype=np.intp)
    stop = np.cumsum(count)
    ends = np.stack([stop - count, stop], axis=-1)
    # The last pose of each piece starts no segment.
    first = np.delete(np.arange(int(count.sum())), stop - 1)
    # A workspace may have no coupler curve: concatenate needs at least one array.
    empty = np.zeros((0, 2))
    q = np.concatenate([empty, *(q[:-1] for _, q in pieces)])
    dq = np.concatenate([empty, *(np.diff(q, axis=0) for _, q in pieces)])
    rocker = np.concatenate([np.zeros(0), *(np.full(len(q) - 1, bar.rocker) for bar, q in pieces)])
    none = np.zeros(0, dtype=np.complex128)
    F = np.concatenate([none, *(bar.joints(q)[2] for bar, q in pieces)])
    leave = np.concatenate([none, *(bar.velocity(q[:-1], np.diff(q, axis=0)) for bar, q in pieces)])
    arrive = np.concatenate([none, *(bar.velocity(q[1:], np.diff(q, axis=0)) for bar, q in pieces)])

    return Curves(F, first, q, dq, rocker, leave, arrive, ends)


def nearest_on(curves: Curves, bar: FourBar, p: Complex) -> tuple[Rows, Complex, Complex]:
    """Return the points of the curves at which |p - F| is least, and the nearest poses.

    |p - F| has a minimum within a segment if (p - F) . dF changes from above 0 to below. Segments
    that cannot come nearer than the nearest pose are left out: no point of a segment is farther
    from both ends than half of its arc, which `STEP` keeps within 1.02 times the chord.

    Args:
        curves: The curves.
        bar: Their four-bar; the rocker is taken from the curves.
        p: Points [m], (n,).

    Returns:
        owner: Index of the p that a minimum is for, (m,).
        F: The minimum [m], (m,).
        pose: For each p the nearest F of the sampled poses [m], (n,).
    """
    pose, owner, segment = _near_segments(curves, p)
    start = curves.F[curves.first[segment]]
    stop = curves.F[curves.first[segment] + 1]
    from_start = _along(p[owner] - start, curves.leave[segment])
    from_end = _along(p[owner] - stop, curves.arrive[segment])

    # Only a segment that the foot enters towards p and leaves away from it has a minimum inside.
    turns = (from_start > 0.0) & (from_end < 0.0)
    owner = owner[turns]
    segment = segment[turns]
    q = curves.q[segment]
    dq = curves.dq[segment]
    at = p[owner]
    bar = bar._replace(rocker=curves.rocker[segment])

    def slope(s: Array) -> Array:
        F, velocity = bar.foot(bar.between(q, dq, s), dq)
        return _along(at - F, velocity)

    s = crossing(slope, from_start[turns], from_end[turns])
    return owner, bar.joints(bar.between(q, dq, s))[2], curves.F[pose]


def _near_segments(curves: Curves, p: Complex) -> tuple[Rows, Rows, Rows]:
    """Return the nearest pose of each p, and the segments that may come nearer still.

    Returns:
        pose: Row of the nearest of the sampled poses, (n,).
        owner: Index of the p that a segment is for, (m,).
        segment: The segment's row, (m,).
    """
    d = np.abs(p[:, None] - curves.F)
    pose = d.argmin(axis=1)
    least = d[np.arange(len(p)), pose][:, None]
    # Half of the arc, from the chord; see `nearest_on`.
    first = curves.first
    half = 0.51 * np.abs(curves.F[first + 1] - curves.F[first])
    # A segment that is equally near to rounding stays in.
    most = least * (1.0 + 1e-12)

    # No end of a segment that may is farther: most are left out before their own half is asked.
    near = d <= (most + half.max(initial=0.0)) * (1.0 + 1e-12)
    owner, segment = np.nonzero(near[:, first] | near[:, first + 1])
    ends = first[segment]
    reach = np.minimum(d[owner, ends], d[owner, ends + 1]) - half[segment]
    may = reach <= most[owner, 0]
    return pose, owner[may], segment[may]


def _along(v: Complex, direction: Complex) -> Array:
    return (np.conj(v) * direction).real
