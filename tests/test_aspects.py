"""Aspects: against walks, against another chart's components, and legs whose parts are known."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from poses import BATCHES, RIGHT, RIGID, sample

from fivebar_sim import kinematics
from fivebar_sim.analysis import aspects
from fivebar_sim.analysis.aspects import Aspect, all_aspects, aspect, aspect_at, same_aspect
from fivebar_sim.analysis.singularity import distances_at, distances_of, signs
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, LoopOpenError, SingularError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.planar import unit
from fivebar_sim.kinematics.reach import points_at

CLASSIC = FiveBar()
COAXIAL = FiveBar(0.112, 0.199, 0.199, 0.112, 0.0, 0.0325)
TWO_PARTS = FiveBar(0.1, 0.012, 0.013, 0.1, 0.1)  # narrow rings: cross above and below AE only


def assemblies(leg: FiveBar, foot: Array, mode: Mode, every: Array | None = None) -> Array:
    """Return the assembly mode of each foot position, 0 where out of reach or singular.

    Args:
        leg: The leg.
        foot: Foot positions.
        mode: A working mode.
        every: Their angles in all modes, if they are known already.
    """
    every = kinematics.inverse_all(leg, foot) if every is None else every
    theta = every[..., MODES.index(mode), :]
    ok = np.isfinite(theta[..., 0])
    triple = signs(leg, distances_of(leg, points_at(leg, foot[ok], theta[ok])))
    found = np.zeros(foot.shape[:-1], dtype=int)
    found[ok] = triple[:, 2] * np.abs(triple).min(axis=-1)
    return found


# law


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("assembly", [-1, 1])
@pytest.mark.parametrize("mode", MODES)
def test_foot_and_angles_name_one_aspect(batch: tuple[int, ...], mode: Mode, assembly: int) -> None:
    foot, theta = sample(RIGID, batch, mode, assembly)
    one = aspect_at(RIGID, foot, mode=mode)
    other = aspect(RIGID, theta, assembly=assembly)
    for each, again in zip(one, other, strict=True):
        np.testing.assert_array_equal(each, again)
        assert np.shape(each) == batch
    np.testing.assert_array_equal(one.s_A, mode[0])
    np.testing.assert_array_equal(one.s_E, mode[1])
    np.testing.assert_array_equal(one.assembly, assembly)
    assert (np.asarray(one.part) > 0).all()


@pytest.mark.parametrize("leg", [CLASSIC, RIGID, COAXIAL])
def test_a_walk_that_meets_no_singularity_stays_in_its_aspect(
    leg: FiveBar, rng: np.random.Generator
) -> None:
    ends = rng.uniform(-1.0, 1.0, (2, 200, 1, 2)) * leg.size
    walks = ends[0] + (ends[1] - ends[0]) * np.linspace(0.0, 1.0, 60)[:, None]
    stayed = 0
    every = kinematics.inverse_all(leg, walks)
    for mode in MODES:
        found = assemblies(leg, walks, mode, every)
        clear = (found == found[:, :1]).all(axis=1) & (found[:, 0] != 0)
        p = walks[clear, 0]
        q = walks[clear, -1]
        if clear.any():
            # too near a singularity for the grid: no number, so no aspect is said to be shared
            told = (aspect_at(leg, p, mode=mode).part > 0) & (aspect_at(leg, q, mode=mode).part > 0)
            assert told.mean() > 0.99
            assert same_aspect(leg, p, q, mode=mode)[told].all()
            stayed += int(clear.sum())
    assert stayed > 20


def test_other_assembly_is_another_aspect() -> None:
    feet = [sample(RIGID, (20,), (1, 1), assembly)[0] for assembly in (-1, 1)]
    assert not same_aspect(RIGID, feet[0][:, None], feet[1], mode=(1, 1)).any()


# oracle


@cache
def plane(leg: FiveBar) -> tuple[Array, Array]:
    """Return a fine grid of foot positions, and their angles in all modes."""
    line = np.linspace(-1.2, 1.2, 301) * leg.size
    foot = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1)
    return foot, kinematics.inverse_all(leg, foot)


@pytest.mark.parametrize("leg", [CLASSIC, RIGID, FiveBar(0.335, 0.6025, 0.6025, 0.335, 0.4925)])
@pytest.mark.parametrize("mode", MODES)
def test_parts_are_those_of_the_foot_plane(leg: FiveBar, mode: Mode) -> None:
    """Components of a fine grid of feet, a chart that the atlas has not; slivers left out."""
    from scipy import ndimage

    foot, every_mode = plane(leg)
    found = assemblies(leg, foot, mode, every_mode)
    seen = []
    for assembly in (-1, 1):
        label = np.zeros(found.shape, dtype=int)
        count = int(ndimage.label(found == assembly, output=label))  # pyright: ignore[reportArgumentType]
        for k in range(1, count + 1):
            nodes = foot[label == k]
            if len(nodes) < 22:
                continue
            here = aspect_at(leg, nodes[:: len(nodes) // 20], mode=mode)
            (part,) = set(here.part.tolist()) - {0}
            seen.append((assembly, part))
    assert len(set(seen)) == len(seen)
    every = all_aspects(leg)
    known = (every.s_A == mode[0]) & (every.s_E == mode[1])
    assert sorted(seen) == sorted(
        zip(every.assembly[known].tolist(), every.part[known].tolist(), strict=True)
    )


@pytest.mark.parametrize(("leg", "count"), [(CLASSIC, 10), (RIGID, 12), (COAXIAL, 2)])
def test_count_does_not_hang_on_the_grid(leg: FiveBar, count: int) -> None:
    for cells in (60, 91):
        assert len(all_aspects(leg, cells=cells).part) == count


@pytest.mark.parametrize("leg", [RIGID, TWO_PARTS])
def test_every_node_of_the_atlas_is_a_corner_of_its_own_cell(leg: FiveBar) -> None:
    """A pose is looked up in the sheet that it was drawn in, in all three charts."""
    atlas = aspects._atlas(leg, 40)
    nodes = np.flatnonzero(atlas.triple.all(axis=-1))
    q = atlas.q[nodes]
    knees = np.stack([q[:, 0], q[:, 1] - q[:, 0], q[:, 2], q[:, 3] - q[:, 2]], axis=-1)
    sheets = aspects._sheets(leg, kinematics.chain_points(leg, knees))
    corners = aspects._corners(q, sheets, 40)
    assert set((nodes // (2 * 40**2)).tolist()) == {0, 1, 2}
    np.testing.assert_array_equal(corners[np.arange(len(nodes)), 4 * (nodes // 3200)], nodes)


def test_batch_is_a_plain_loop() -> None:
    foot = sample(RIGID, (20,))[0]
    rows = [aspect_at(RIGID, row) for row in foot]
    np.testing.assert_array_equal(np.transpose(aspect_at(RIGID, foot)), rows)


# edge


def test_one_triple_two_aspects_in_a_workspace_of_two_parts() -> None:
    """Feet high and low; each part has poses of the triple, and no way leads to the other."""
    height = math.sqrt(0.1**2 - 0.05**2)
    around = 0.02 * np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 41)] * 2), axis=-1).reshape(-1, 2)
    for mode in MODES:
        feet = []
        for z in (-height, height):
            foot = around + np.array([0.0, z])
            triple = assemblies(TWO_PARTS, foot, mode)
            feet.append(foot[(triple == 1) & kept_clear(foot, triple, mode)])
            assert len(feet[-1]) > 5
        assert not same_aspect(TWO_PARTS, feet[0][:, None], feet[1], mode=mode).any()
        for part in feet:
            assert same_aspect(TWO_PARTS, part[0], part, mode=mode).sum() > 1


def kept_clear(foot: Array, triple: Array, mode: Mode) -> Array:
    """Return which feet are within reach and 2 mm from every singularity."""
    clear = np.zeros(len(foot), dtype=bool)
    ok = triple != 0
    clear[ok] = (np.abs(distances_at(TWO_PARTS, foot[ok], mode=mode)) > 0.002).all(axis=0)
    return clear


def test_one_triple_two_aspects_in_one_workspace() -> None:
    """The classic leg's knees out, C above BD: the two are on either side of the motors."""
    every = all_aspects(CLASSIC)
    of = (every.s_A == -1) & (every.s_E == 1) & (every.assembly == 1)
    assert every.part[of].tolist() == [1, 2]
    line = np.linspace(-1.0, 1.0, 101) * CLASSIC.size
    foot = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1)
    foot = foot[assemblies(CLASSIC, foot, (-1, 1)) == 1]
    count = np.bincount(aspect_at(CLASSIC, foot, mode=(-1, 1)).part)
    assert count[1] > count[2] > 0  # the larger comes first


def test_coaxial_leg_walks_all_around_its_motors() -> None:
    p = 0.25 * unit(0.3)
    q = 0.25 * unit(np.linspace(-3.0, 3.0, 13))
    assert same_aspect(COAXIAL, p, q, mode=(-1, 1)).all()
    assert aspect_at(COAXIAL, q, mode=(-1, 1)).part.tolist() == [1] * 13


def test_too_coarse_a_grid_tells_nothing() -> None:
    """Fewer nodes than tell a part from a sliver: no number, and no aspect in common."""
    foot = sample(RIGID, ())[0]
    assert aspect_at(RIGID, foot, cells=3).part == 0
    assert not same_aspect(RIGID, foot, foot, cells=3)
    assert same_aspect(RIGID, foot, foot)


def test_result_is_the_callers_own() -> None:
    foot = sample(RIGID, (3,))[0]
    first = aspect_at(RIGID, foot)
    kept = Aspect(*(each.copy() for each in first))
    for each in first:
        each[...] = 7
    np.testing.assert_array_equal(aspect_at(RIGID, foot), kept)


# refusal


def test_singular_poses_belong_to_no_aspect() -> None:
    both_alike = FiveBar(0.09, 0.162, 0.162, 0.09, 0.0)  # knees on one side: B is on D
    with pytest.raises(SingularError, match=r"must not be 0 m, got .*, loop 0\.0e\+00 m$") as info:
        aspect_at(both_alike, (0.0, 0.2), mode=(1, 1))
    assert info.value.index == ()
    leg = FiveBar(0.25, 0.5, 0.75, 0.375, 0.5)
    with pytest.raises(SingularError, match=r"side_A .* m at index \(1,\)") as info:
        aspect_at(leg, [(-0.1, -0.5), (-0.25, -0.75)], mode=(1, 1))
    assert info.value.index == (1,)
    line = FiveBar(0.25, 0.5, 0.5, 0.25, 0.5)
    with pytest.raises(SingularError):
        aspect(line, (math.pi, 0.0))


def test_wrong_arguments_are_refused() -> None:
    foot = sample(RIGID, (3,))[0]
    with pytest.raises(UnreachableError) as info:
        same_aspect(RIGID, foot, (5.0, 0.0))
    assert info.value.index == ()
    with pytest.raises(LoopOpenError):
        aspect(RIGHT, (math.pi, 0.0))
    with pytest.raises(ArgumentError, match=r"p and q must broadcast, got shapes \(3, 2\)"):
        same_aspect(RIGID, foot, foot[:2])
    with pytest.raises(ArgumentError, match="mode must be one of"):
        aspect_at(RIGID, foot, mode=(1, 0))
    for cells in (2, 10.0, True, "120", [3]):
        with pytest.raises(ArgumentError, match="cells must be a whole number above 2"):
            aspect_at(RIGID, foot, cells=cells)  # pyright: ignore[reportArgumentType]
        with pytest.raises(ArgumentError, match="cells"):
            all_aspects(RIGID, cells=cells)  # pyright: ignore[reportArgumentType]
