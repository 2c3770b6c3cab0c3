"""Stretches of foot paths: where a path is between two of its points.

Between t and t + dt a coordinate is within dt^2 / 8 max |x''| of the line between its values at the
two ends. Each kind of path has its pieces, on which x'' is a polynomial of at most the third degree
or has a bound in closed form; a polynomial is within the hull of its Bernstein coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError
from fivebar_sim.paths import (
    Circle,
    Csv,
    Ellipse,
    FigureEight,
    FootPath,
    Gait,
    Hop,
    Line,
    Lines,
    Sine,
    Step,
)
from fivebar_sim.paths.gait import GRAVITY

NODES = np.array([0.125, 0.375, 0.625, 0.875])
"""Where within a piece x'' is looked at, as parts of it: off its ends, where x'' may jump."""

SAFE = 1e-9
"""Rounding of bounds of accelerations, relative to them."""

ROUNDING = 1e-12
"""Rounding of positions, relative to the farthest of them."""


class Piece(NamedTuple):
    """A part of a path.

    Attributes:
        start: Its first time [s], of the nominal path.
        stop: Its last.
        steepest: Bounds of |x''| and |z''| within [m/s^2], (2,).
    """

    start: float
    stop: float
    steepest: Array


def pieces(path: FootPath) -> list[Piece]:
    """Return the pieces that make up a path, one period of it if it repeats.

    Raises:
        ArgumentError: A kind of path of which no bounds are known.
    """
    for kind, known in KNOWN.items():
        if isinstance(path, kind):
            return known(path)
    name = path.__struct_config__.tag
    kinds = ", ".join(sorted(str(kind.__struct_config__.tag) for kind in KNOWN))
    raise ArgumentError(f'a path of kind "{name}" cannot be certified; these can: {kinds}')


def boxes(path: FootPath, start: Array, stop: Array, steepest: Array) -> tuple[Array, Array]:
    """Return boxes that surely hold the foot between times.

    Args:
        path: The path.
        start: First times [s], (n,).
        stop: Last times [s], (n,).
        steepest: Bounds of |x''|, |z''| between them [m/s^2], (n, 2).

    Returns:
        Least and greatest (x, z) [m], each (n, 2).
    """
    one = path.nominal(start).position
    other = path.nominal(stop).position
    bulge = 0.125 * (stop - start)[:, None] ** 2 * steepest * (1.0 + SAFE)
    bulge += ROUNDING * max(np.abs(one).max(), np.abs(other).max())
    return np.minimum(one, other) - bulge, np.maximum(one, other) + bulge


def _harmonic(path: FootPath, x: float, z: float) -> list[Piece]:
    assert path.period is not None
    w2 = (2.0 * math.pi / path.period) ** 2
    return [Piece(0.0, path.period, w2 * np.array([x, z]))]


def _ellipse(path: Ellipse) -> list[Piece]:
    return _harmonic(path, *path.radii)


def _circle(path: Circle) -> list[Piece]:
    return _harmonic(path, path.radius, path.radius)


def _eight(path: FigureEight) -> list[Piece]:
    return _harmonic(path, path.radii[0], 4.0 * path.radii[1])


def _line(path: Line) -> list[Piece]:
    return _polynomial(path, [0.0, 0.5 * path.period, path.period])


def _gait(path: Gait) -> list[Piece]:
    # The path begins in the middle of the stance, which its period cuts in two.
    half = 0.5 * path.duty
    cycle = [0.0, half, half + 0.5 * (1.0 - path.duty), 1.0 - half, 1.0]
    found = _polynomial(path, [each * path.period for each in cycle], running=path.running)
    if not path.running:
        return found
    # The hip's own: gravity in flight, and a half sine less gravity in stance.
    more = np.array([0.0, GRAVITY * (1.0 + 0.5 * math.pi / path.duty)])
    return [piece._replace(steepest=piece.steepest + more) for piece in found]


def _sine(path: Sine) -> list[Piece]:
    half = 0.5 * path.duty
    ends = [0.0, half, 1.0 - half, 1.0]
    found = []
    for k, height in enumerate((path.push, path.lift, path.push)):
        span = (path.duty, 1.0 - path.duty, path.duty)[k]
        steepest = np.array([0.0, height * (math.pi * path.frequency / span) ** 2])
        found.append(Piece(ends[k] * path.period, ends[k + 1] * path.period, steepest))
    return found


def _hop(path: Hop) -> list[Piece]:
    ends = [0.0, path.thrust, path.thrust + 0.5 * path.flight, path.thrust + path.flight, 1.0]
    return _polynomial(path, [each * path.period for each in ends])


def _step(path: Step) -> list[Piece]:
    return _polynomial(path, [0.0, 0.5 * path.seconds, path.seconds])


def _lines(path: Lines) -> list[Piece]:
    seconds = np.broadcast_to(path.seconds, len(path.points) - 1)
    return _polynomial(path, np.concatenate([[0.0], np.cumsum(seconds)]).tolist())


def _csv(path: Csv) -> list[Piece]:
    return _polynomial(path, path.knots.tolist())


def _polynomial(path: FootPath, ends: list[float], *, running: bool = False) -> list[Piece]:
    """Return pieces on which a path is a polynomial of at most the fifth degree."""
    if running:
        assert isinstance(path, Gait)
        import msgspec

        path = msgspec.structs.replace(path, running=False)
    # From the values at four points to Bernstein's coefficients, through those of 1, u, u^2, u^3.
    powers = np.linalg.inv(np.vander(NODES, 4, increasing=True))
    bernstein = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])
    found = []
    for start, stop in pairwise(ends):
        if stop > start:
            values = path.nominal(start + (stop - start) * NODES).acceleration
            hull = np.abs(bernstein @ (powers @ values)).max(axis=0)
            found.append(Piece(start, stop, hull * (1.0 + SAFE) + SAFE * np.abs(values).max()))
    return found


KNOWN: dict[type[FootPath], Callable[..., list[Piece]]] = {
    Circle: _circle,
    Csv: _csv,
    Ellipse: _ellipse,
    FigureEight: _eight,
    Gait: _gait,
    Hop: _hop,
    Line: _line,
    Lines: _lines,
    Sine: _sine,
    Step: _step,
}
"""The kinds of paths whose pieces are known."""
