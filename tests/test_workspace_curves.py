"""The curves of the workspace's picture: its boundary, and the singular curves in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from extended_legs import any_leg, around, length, narrow

from fivebar_sim import workspace
from fivebar_sim.analysis import singularity
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.planar import unit
from fivebar_sim.workspace.coupler import cut, trace
from fivebar_sim.workspace.four_bar import FourBar
from fivebar_sim.workspace.region import AnyMode

BENT = FiveBar(0.05, 0.04, 0.035, 0.07, 0.09, 0.02, 0.5, 0.3)
MINITAUR = FiveBar.load("minitaur")
EITHER: list[AnyMode] = ["any", (-1, 1), (1, 1)]  # both elbows of side A, and each alone

# law


@pytest.mark.parametrize("mode", EITHER)
def test_boundary_points_are_of_both_sides_and_wherever_nearest_goes(mode: AnyMode) -> None:
    rng = np.random.default_rng(8)
    stretched = replace(BENT, L6=0.5)
    for leg in (BENT, MINITAUR, any_leg(rng), narrow(rng), stretched, replace(BENT, L6=0.0)):
        pieces = workspace.boundary(leg, mode=mode)
        b = np.concatenate(pieces)
        start = np.concatenate([x[:-1] for x in pieces])
        chord = np.concatenate([np.diff(x, axis=0) for x in pieces])
        step = length(chord)
        assert step.max() < 0.04 * leg.size
        away = np.abs(workspace.distance(leg, np.concatenate([start + 0.5 * chord, b]), mode=mode))
        bulge = away[: len(start)]
        assert (bulge < 0.006 * step + 1e-12 * leg.size).all()  # a turn of 0.04: its eighth
        assert away[len(start) :].max() < 1e-13 * leg.size
        ring = b[::4, None] + 1e-6 * leg.size * unit(np.linspace(0.0, 6.0, 24))
        near = workspace.reachable(leg, ring, mode=mode)
        assert not near.all(axis=1).any()
        # of one elbow alone, no more than a thin horn at the end of an arc
        assert near.any(axis=1).mean() > (0.98 if mode != "any" else 1.0 - 1e-9)
        p = around(leg, rng, 60)
        q = workspace.nearest(leg, p[~workspace.reachable(leg, p, mode=mode)], mode=mode)
        along = ((q[:, None] - start) * chord).sum(-1) / step**2
        on = start + np.clip(along, 0.0, 1.0)[..., None] * chord
        to_chord = length(q[:, None] - on).min(axis=1)
        assert to_chord.max() < 1e-3 * leg.size  # the bulge of a step of 0.04: its eighth squared


# oracle


@pytest.mark.parametrize("L6", [0.0, 0.02])
@pytest.mark.parametrize("mode", MODES)
def test_singular_curves_are_where_the_loop_flips(L6: float, mode: Mode) -> None:
    """All their points are singular, and wherever `loop` changes its sign there is a curve."""
    equal = FiveBar(0.05, 0.06, 0.06, 0.045, 0.04, L6, 0.5, 0.3)
    for leg in (replace(BENT, L6=L6), equal):
        curves = np.concatenate(workspace.singular_curves(leg, mode=mode))
        sound = workspace.reachable(leg, curves, mode=mode)
        assert sound.mean() > 0.98  # not the ends, on the edge of reach to rounding
        loop = singularity.distances_at(leg, curves[sound], mode=mode).loop
        # the motors of a foot near the edge are off by the square root of rounding
        assert np.abs(loop).max() < 1e-6 * leg.size
        line = np.linspace(-1.1, 1.1, 101) * leg.size
        grid = np.stack(np.meshgrid(line, line), axis=-1)
        inside = workspace.reachable(leg, grid, mode=mode)
        loop = np.full(inside.shape, np.nan)
        loop[inside] = singularity.distances_at(leg, grid[inside], mode=mode).loop
        flips = grid[:, 1:][loop[:, 1:] * loop[:, :-1] < 0.0]
        to_curve = length(flips[:, None] - curves).min(axis=1)
        assert len(flips) > 20
        assert (to_curve < 0.05 * leg.size).mean() > 0.999
        assert (to_curve < 0.025 * leg.size).mean() > 0.9


# edge


def test_equal_coaxial_legs_are_singular_everywhere_in_modes_of_equal_signs() -> None:
    assert workspace.singular_curves(MINITAUR, mode=(1, 1)) == []
    assert (
        workspace.singular_curves(MINITAUR, mode=(-1, 1)) == []
    )  # where it only folds at the edges


def test_cut_finds_two_roots_between_two_poses() -> None:
    bar = FourBar(0.03, 0.06, 0.05, 0.045, 0.08 + 0.01j)  # its crank turns round
    q = trace(bar)[0]
    for k in (0, len(q) // 3, len(q) - 2):
        middle = bar.between(q[k], q[k + 1] - q[k], np.array(0.4))[0]
        found = cut(bar, q, lambda q, at=middle: (q[..., 0] - at) ** 2 - 1e-8)[:, 0]
        for root in (middle - 1e-4, middle + 1e-4):
            assert np.abs(found - root).min() < 1e-12
