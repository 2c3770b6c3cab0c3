"""Aspects: the connected regions of poses between the singularities.

Inside an aspect no distance of `singularity.Distances` changes its sign: (s_A, s_E, assembly) is
the same triple throughout. But one triple may have several aspects, for instance if the workspace
has two parts, so connected regions are searched for in an atlas of the poses (theta_A, psi_2,
theta_E, psi_3), the directions of L1..L4. Each of its three charts is a grid over all of two
angles, in two sheets:

    theta_A, theta_E    sheet: sign(BD x BC)    folds where B, C, D are in line
    theta_A, psi_2      sheet: sign(EC x ED)    folds where E, D, C are in line
    theta_E, psi_3      sheet: sign(AC x AB)    folds where A, B, C are in line

Near its fold a chart's nodes are far apart in the two other angles; another chart is dense there.
Two poses of one triple are linked if one is a corner of the other's cell, in the same chart or in
another. The resolution is thus 2 pi / cells in the chart's two angles:

    a neck thinner than a cell may separate what is connected;
    a gap or a strip of another triple between two nodes may be skipped;
    a region of fewer than `FEW` nodes gets no number.

If in doubt, use a finer grid. Of 60 random legs 54 had the same number of aspects on grids of 3 and
of 1.5 deg; each of the others had one region more or less, of under 60 nodes of 1.5 deg.

See: Chablat and Wenger 1998, "Working modes and aspects in fully parallel manipulators", IEEE ICRA
(arXiv 0707.2006), for the notion.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.analysis.singularity import distances_of, signs
from fivebar_sim.arrays import Array, Bools, as_pairs, at, first_index
from fivebar_sim.errors import ArgumentError, SingularError
from fivebar_sim.geometry import FiveBar, Mode
from fivebar_sim.kinematics.closure import Points, bases, chain_points, closed_points
from fivebar_sim.kinematics.planar import cross, unit, wrap
from fivebar_sim.kinematics.reach import inverse, points_at, side_angle

Ints = NDArray[np.int_]

CELLS = 120
"""Cells of a grid along each angle: 3 deg each."""

FEW = 12
"""A part of fewer nodes is taken for a sliver that the grid has torn off: it gets number 0. On
random legs torn slivers had up to 12 nodes of 3 deg, and they vanished on a finer grid."""

CHARTS = ((0, 2), (0, 1), (2, 3))
"""The two of the four angles over which each chart is a grid."""

NAMES = np.array([9, 3, 1])
"""Times a triple: one number for it, in the order of triples and 0 where there is none."""


class Aspect(NamedTuple):
    """The aspects of poses, each (...); two poses share one if all four agree, part not 0.

    Attributes:
        s_A: Working mode of side A, -1 or +1.
        s_E: Working mode of side E.
        assembly: Assembly mode.
        part: Number of the aspect among those of the triple, from 1 for the one with most nodes;
            0 where the grid is too coarse to tell.
    """

    s_A: Ints
    s_E: Ints
    assembly: Ints
    part: Ints


class _Atlas(NamedTuple):
    """All nodes of a leg's charts: chart, sheet and the two indices make one flat number.

    Attributes:
        q: Directions (theta_A, psi_2, theta_E, psi_3) [rad], (6 n^2, 4).
        triple: Signs, with zeros where there is no pose or a singular one, (6 n^2, 3).
        part: Number of the aspect, 0 where a sign is 0 or the part has few nodes, (6 n^2,).
    """

    q: Array
    triple: Ints
    part: Ints


def aspect(
    leg: FiveBar, theta: ArrayLike, *, assembly: int | None = None, cells: int = CELLS
) -> Aspect:
    """Return the aspects of closed poses.

    Args:
        leg: The leg.
        theta: (theta_A, theta_E) [rad], (..., 2).
        assembly: +1 or -1; None is the leg's own.
        cells: Grid cells along each angle; the cost grows with the square.

    Raises:
        LoopOpenError: Where the links do not meet.
        SingularError: Where the pose is singular to rounding: it belongs to no aspect.
        ArgumentError: A wrong shape or assembly mode, or unless cells is a whole number above 2.
    """
    return _aspect(leg, closed_points(leg, theta, assembly=assembly), cells)


def aspect_at(
    leg: FiveBar, foot: ArrayLike, *, mode: Mode | None = None, cells: int = CELLS
) -> Aspect:
    """Return the aspects of the poses that put F at given points.

    Args:
        leg: The leg.
        foot: F [m], hip frame, (..., 2).
        mode: Working mode (s_A, s_E); None is the leg's own.
        cells: Grid cells along each angle.

    Raises:
        UnreachableError: Where the foot is out of reach.
        SingularError: Where the pose is singular to rounding: it belongs to no aspect.
        ArgumentError: A wrong shape or working mode, or unless cells is a whole number above 2.
    """
    foot = as_pairs(foot, "foot")
    return _aspect(leg, points_at(leg, foot, inverse(leg, foot, mode)), cells)


def same_aspect(
    leg: FiveBar, p: ArrayLike, q: ArrayLike, *, mode: Mode | None = None, cells: int = CELLS
) -> Bools:
    """Return where the foot gets from p to q in one working mode without meeting a singularity.

    True: a chain of poses of one triple was found, each linked to the next. False: no such chain
    was found, which proves nothing if a neck may be thinner than a cell.

    Args:
        leg: The leg.
        p: F [m], hip frame, (..., 2).
        q: F [m], hip frame, broadcasts with p.
        mode: Working mode (s_A, s_E); None is the leg's own.
        cells: Grid cells along each angle.

    Raises:
        UnreachableError, SingularError, ArgumentError: As `aspect_at`, for p or for q; and for
            shapes that do not broadcast.
    """
    p = as_pairs(p, "p")
    q = as_pairs(q, "q")
    try:
        np.broadcast_shapes(p.shape, q.shape)
    except ValueError:
        raise ArgumentError(f"p and q must broadcast, got shapes {p.shape} and {q.shape}") from None
    one, other = (aspect_at(leg, foot, mode=mode, cells=cells) for foot in (p, q))
    same_sign = one.assembly == other.assembly
    return np.asarray(same_sign & (one.part == other.part) & (one.part > 0))


def all_aspects(leg: FiveBar, *, cells: int = CELLS) -> Aspect:
    """Return all aspects of a leg that the grids show, of all modes, each once, shape (n,).

    Raises:
        ArgumentError: Unless cells is a whole number above 2.
    """
    atlas = _atlas(leg, cells)
    nodes = np.flatnonzero(atlas.part)
    part = atlas.part[nodes]
    # One number for an aspect, in the order of its four: NumPy is slow to compare rows.
    name = (atlas.triple @ NAMES)[nodes] * (part.max(initial=0) + 1) + part
    _, first = np.unique(name, return_index=True)
    each = nodes[first]
    s_A, s_E, assembly = atlas.triple[each].T
    return Aspect(s_A, s_E, assembly, atlas.part[each])


def _aspect(leg: FiveBar, points: Points, cells: int) -> Aspect:
    d = distances_of(leg, points)
    triple = signs(leg, d)
    singular = np.asarray((triple == 0).any(axis=-1))
    if singular.any():
        index = first_index(singular)
        came = ", ".join(f"{name} {each[index]:.1e} m" for name, each in d._asdict().items())
        raise SingularError(
            f"a singular pose belongs to no aspect: its distances must not be 0 m, got "
            f"{came}{at(index)}",
            index,
        )

    atlas = _atlas(leg, cells)
    q = _directions(leg, points)
    near = _corners(q, _sheets(leg, points), cells)
    gap = np.abs(wrap(atlas.q[near] - q[..., None, :])).max(axis=-1)

    # Nodes of another triple lie beyond a fold; the nearest of the rest decides.
    linked = (atlas.triple[near] == triple[..., None, :]).all(axis=-1)
    best = np.argmin(np.where(linked, gap, np.inf), axis=-1)[..., None]
    part = np.where(linked.any(axis=-1), np.take_along_axis(atlas.part[near], best, -1)[..., 0], 0)

    return Aspect(triple[..., 0], triple[..., 1], triple[..., 2], part)


def _atlas(leg: FiveBar, cells: int) -> _Atlas:
    if isinstance(cells, bool) or not isinstance(cells, int) or cells < 3:
        raise ArgumentError(f"cells must be a whole number above 2, got {cells!r}")
    return _draw_atlas(leg, cells)


# Cached: a leg is asked again and again, and its atlas is the same each time.
@lru_cache(maxsize=8)
def _draw_atlas(leg: FiveBar, cells: int) -> _Atlas:
    """Return the atlas of a leg."""
    charts = [_chart(leg, chart, s, cells) for chart in range(3) for s in (-1, 1)]
    q = np.concatenate([each for each, _ in charts])
    closed = np.concatenate([ok for _, ok in charts])
    knees = q.copy()
    knees[:, 1::2] -= q[:, ::2]  # relative to L1 and L4
    points = chain_points(leg, knees)
    triple = signs(leg, distances_of(leg, points))
    # No pose and a singular pose alike belong to no aspect, so nothing links to them.
    triple[~closed | (triple == 0).any(axis=-1)] = 0

    corners = _corners(q, _sheets(leg, points), cells)
    # Every node is linked with the corners of its own cells in all three charts.
    one = np.broadcast_to(np.arange(len(q))[:, None], corners.shape)
    # One number for a triple: a million links are compared.
    name = triple @ NAMES
    joined = (name[:, None] != 0) & (name[:, None] == name[corners])

    return _Atlas(q, triple, _number_parts(name, _roots(len(q), one[joined], corners[joined])))


def _chart(leg: FiveBar, chart: int, s: int, cells: int) -> tuple[Array, Bools]:
    """Return the directions (n^2, 4) of one sheet's nodes, and where the loop closes, (n^2,)."""
    angle = 2.0 * np.pi / cells * (np.arange(cells, dtype=np.float64) + 0.5) - np.pi
    first = np.repeat(angle, cells)
    second = np.tile(angle, cells)
    A, E = bases(leg)

    if chart == 0:
        B = A + leg.L1 * unit(first)
        D = E + leg.L4 * unit(second)
        # B, C, D are a chain of two links like a leg's side, with C as its knee.
        psi_2, ok = side_angle(D - B, leg.L2, leg.L3, s)
        C = B + leg.L2 * unit(psi_2)
        return np.stack([first, psi_2, second, _direction(C - D)], axis=-1), ok

    side_A = (A, leg.L1, leg.L2)
    side_E = (E, leg.L4, leg.L3)
    one, other = (side_A, side_E) if chart == 1 else (side_E, side_A)
    C = one[0] + one[1] * unit(first) + one[2] * unit(second)
    third, ok = side_angle(C - other[0], other[1], other[2], s)
    fourth = _direction(C - other[0] - other[1] * unit(third))
    # Both charts give the angles in the one order of the atlas.
    order = (first, second, third, fourth) if chart == 1 else (third, fourth, first, second)

    return np.stack(order, axis=-1), ok


def _direction(v: Array) -> Array:
    return np.arctan2(v[..., 1], v[..., 0])


def _directions(leg: FiveBar, p: Points) -> Array:
    """Return (theta_A, psi_2, theta_E, psi_3) [rad] of poses, (..., 4)."""
    A, E = bases(leg)
    links = (p.B - A, p.C_left - p.B, p.D - E, p.C_right - p.D)
    return np.stack([_direction(link) for link in links], axis=-1)


def _sheets(leg: FiveBar, p: Points) -> Ints:
    """Return the sheet, 0 or 1, on which poses are in each chart, (..., 3)."""
    A, E = bases(leg)
    C = p.C_left
    of = (cross(p.D - p.B, C - p.B), cross(C - E, p.D - E), cross(C - A, p.B - A))
    return (np.stack(of, axis=-1) > 0.0).astype(int)


def _corners(q: Array, sheet: Ints, cells: int) -> Ints:
    """Return the flat numbers of the nodes around poses, four in each of the charts, (..., 12)."""
    # A node itself is the least corner of its cell, so 1e-9 of a cell keeps rounding from it.
    low = np.floor((q + np.pi) / (2.0 * np.pi / cells) - 0.5 + 1e-9).astype(int)
    flat = []
    for k, (i, j) in enumerate(CHARTS):
        grid = 2 * k + sheet[..., k]
        for up, right in np.ndindex(2, 2):
            # The grid closes after a turn.
            row = (low[..., i] + up) % cells
            column = (low[..., j] + right) % cells
            flat.append((grid * cells + row) * cells + column)

    return np.stack(flat, axis=-1)


def _roots(count: int, one: Ints, other: Ints) -> Ints:
    """Return the least node of each node's connected part, (count,).

    Each node starts as its own root. Along every link the greater root is attached to the lesser,
    and paths are shortened to their roots, until both ends of every link have the same root.
    """
    root = np.arange(count)
    while len(one):
        # Union-find of all links at once: a pass in NumPy, not a loop over 86,400 nodes.
        ends = root[one], root[other]
        np.minimum.at(root, np.maximum(*ends), np.minimum(*ends))
        # Halving the paths until every one ends at its root.
        while (longer := root[root] != root).any():
            root[longer] = root[root[longer]]
        differ = root[one] != root[other]
        one = one[differ]
        other = other[differ]
    return root


def _number_parts(name: Ints, root: Ints) -> Ints:
    """Return each node's part among those of its triple: 1 for the largest, 0 for a sliver.

    Args:
        name: The number of each node's triple; 0 for none.
        root: The least node of each node's connected part.
    """
    part = np.zeros(len(root), dtype=int)
    for same in np.unique(name[name != 0]):
        here = np.flatnonzero(name == same)
        _, which, count = np.unique(root[here], return_inverse=True, return_counts=True)
        # The rank of each part by size; "stable", so that equal parts keep their order.
        rank = np.argsort(np.argsort(-count, kind="stable")) + 1
        part[here] = np.where(count >= FEW, rank, 0)[which]
    return part
