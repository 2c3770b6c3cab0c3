"""Cubic splines through points in time: twice smooth, in NumPy alone; and lines and steps instead.

A piece of the spline between two knots is the cubic with the points and the slopes there. Equal
second derivatives on both sides of each inner knot give one equation for three slopes,

    h[i] s[i-1] + 2 (h[i-1] + h[i]) s[i] + h[i-1] s[i+1] = 3 (h[i] m[i-1] + h[i-1] m[i])

with the length h[i] of piece i and its mean slope m[i]. The two ends are closed periodically, or
"not-a-knot": the first two pieces are one cubic, and so are the last two.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from fivebar_sim.arrays import Array


class Spline(NamedTuple):
    """A cubic spline of points with any number of coordinates.

    Attributes:
        knots: Times of the points, growing [s], (n,).
        powers: Factors of 1, h, h^2 and h^3, h being the time since a piece began, (4, n-1, d).
    """

    knots: Array
    powers: Array

    @classmethod
    def through(cls, time: Array, point: Array, *, periodic: bool = False) -> Self:
        """Return the spline through points.

        Two points that are not periodic give a line, three a parabola.

        Args:
            time: Growing [s], (n,), at least 2; periodic: at least 3.
            point: (n, d); periodic: the last one is the first.
            periodic: Whether both derivatives are the same at both ends; else "not-a-knot".
        """
        length = np.diff(time)[:, np.newaxis]
        mean = np.diff(point, axis=0) / length
        slope = _periodic_slopes(length, mean) if periodic else _slopes(length, mean)

        start = slope[:-1]
        # The slopes of a piece less those of the straight line between its points.
        bend = (start + slope[1:] - 2.0 * mean) / length
        square = (mean - start) / length - bend
        return cls(time, np.stack([point[:-1], start, square, bend / length]))

    @classmethod
    def straight(cls, time: Array, point: Array) -> Self:
        """Return the straight lines from point to point, whose slope jumps at the points.

        Args:
            time: Growing [s], (n,), at least 2.
            point: (n, d).
        """
        mean = np.diff(point, axis=0) / np.diff(time)[:, np.newaxis]
        none = np.zeros_like(mean)
        return cls(time, np.stack([point[:-1], mean, none, none]))

    @classmethod
    def steps(cls, time: Array, point: Array) -> Self:
        """Return the points held until the next one comes; the last piece has no end.

        Args:
            time: Growing [s], (n,).
            point: (n, d).
        """
        none = np.zeros_like(point)
        return cls(np.append(time, np.inf), np.stack([point, none, none, none]))

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """Return the points and their first two derivatives at times of any shape.

        Before the first knot and after the last the outer pieces go on.
        """
        piece = np.searchsorted(self.knots, time, side="right") - 1
        piece = np.clip(piece, 0, len(self.knots) - 2)
        h = (time - self.knots[piece])[..., np.newaxis]

        c0, c1, c2, c3 = self.powers[:, piece]
        position = c0 + h * (c1 + h * (c2 + h * c3))
        velocity = c1 + h * (2.0 * c2 + h * (3.0 * c3))
        return position, velocity, 2.0 * c2 + h * (6.0 * c3)


def _slopes(length: Array, mean: Array) -> Array:
    """Return the slopes at all knots of a spline that ends not-a-knot."""
    if len(length) == 1:
        return np.concatenate([mean, mean])

    first = _end_row(length, mean)
    last = _end_row(length[::-1], mean[::-1])
    inner = _inner_rows(length[:-1], length[1:], mean[:-1], mean[1:])
    return _solve_tridiagonal(
        np.concatenate([inner.lower, last.upper]),
        np.concatenate([first.diagonal, inner.diagonal, last.diagonal]),
        np.concatenate([first.upper, inner.upper]),
        np.concatenate([first.right, inner.right, last.right]),
    )


def _periodic_slopes(length: Array, mean: Array) -> Array:
    """Return the slopes at all knots of a spline that repeats, the first once more at the end.

    The last unknown slope s[-1] stands in the first and in the last of the other equations: it goes
    to the right side, and the others are their solution without it, plus s[-1] times that of it.
    """
    rows = _inner_rows(np.roll(length, 1), length, np.roll(mean, 1, axis=0), mean)
    of_last = np.zeros_like(length[:-1])
    of_last[0] -= rows.lower[0]
    of_last[-1] -= rows.upper[-2]
    solved = _solve_tridiagonal(
        rows.lower[1:-1],
        rows.diagonal[:-1],
        rows.upper[:-2],
        np.concatenate([rows.right[:-1], of_last], axis=1),
    )
    without = solved[:, :-1]
    of_last = solved[:, -1:]

    below = rows.lower[-1]
    above = rows.upper[-1]
    last = (rows.right[-1] - below * without[-1] - above * without[0]) / (
        rows.diagonal[-1] + below * of_last[-1] + above * of_last[0]
    )
    slopes = without + of_last * last
    return np.concatenate([slopes, [last], slopes[:1]])


class _Rows(NamedTuple):
    """Equations of the slopes: the factors of the one before, of its own and of the one after."""

    lower: Array
    diagonal: Array
    upper: Array
    right: Array


def _inner_rows(before: Array, after: Array, mean_before: Array, mean_after: Array) -> _Rows:
    """Return the equations of the knots between pieces of given lengths and mean slopes."""
    right = 3.0 * (after * mean_before + before * mean_after)
    return _Rows(after, 2.0 * (before + after), before, right)


def _end_row(length: Array, mean: Array) -> _Rows:
    """Return the equation of the first slope; all pieces turned round give that of the last."""
    if len(length) == 2:
        # Both ends ask the same of two pieces. A parabola is the simplest curve that fits it.
        one = np.ones((1, 1))
        return _Rows(one, one, one, 2.0 * mean[:1])

    outer = length[:1]
    inner = length[1:2]
    both = outer + inner
    right = ((outer + 2.0 * both) * inner * mean[:1] + outer**2 * mean[1:2]) / both
    return _Rows(both, inner, both, right)


def _solve_tridiagonal(lower: Array, diagonal: Array, upper: Array, right: Array) -> Array:
    """Return the solution of a tridiagonal system, by elimination downwards and back up.

    The equations of slopes need no exchange of rows: no pivot comes near 0.

    Args:
        lower: Below the diagonal, (n-1, 1).
        diagonal: (n, 1).
        upper: Above the diagonal, (n-1, 1).
        right: Any number of right sides, (n, d).
    """
    # Plain numbers: row by row, arithmetic on NumPy's takes many times as long.
    below = lower[:, 0].tolist()
    pivot = diagonal[:, 0].tolist()
    above = upper[:, 0].tolist()
    columns = right.T.tolist()
    for k in range(1, len(pivot)):
        factor = below[k - 1] / pivot[k - 1]
        pivot[k] -= factor * above[k - 1]
        for column in columns:
            column[k] -= factor * column[k - 1]

    for column in columns:
        column[-1] /= pivot[-1]
        for k in range(len(pivot) - 2, -1, -1):
            column[k] = (column[k] - above[k] * column[k + 1]) / pivot[k]
    return np.array(columns).T
