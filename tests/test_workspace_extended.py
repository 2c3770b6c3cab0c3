"""Workspace of legs with an extension: against a search over all radii, on every topology."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from extended_legs import (
    CORNER_CASES,
    TOPOLOGIES,
    Draw,
    any_leg,
    around,
    length,
    search,
)

from fivebar_sim import kinematics, motion, units, workspace
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import ArgumentError, GeometryError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.kinematics.planar import unit
from fivebar_sim.paths import Line
from fivebar_sim.workspace.region import AnyMode

BENT = FiveBar(0.05, 0.04, 0.035, 0.07, 0.09, 0.02, 0.5, 0.3)
MINITAUR = FiveBar.load("minitaur")
EITHER: list[AnyMode] = ["any", (-1, 1), (1, 1)]  # both elbows of side A, and each alone


def check_against_search(leg: FiveBar, p: Array, mode: AnyMode) -> Bools:
    """Compare all answers for p (n, 2); return where the search found the boundary."""
    ok = workspace.reachable(leg, p, mode=mode)
    q = workspace.nearest(leg, p, mode=mode)
    signed = workspace.distance(leg, p, mode=mode)
    assert workspace.reachable(leg, q, mode=mode).all()
    modes = MODES if mode == "any" else [mode]
    solved = kinematics.inverse_all(leg, q)[:, [MODES.index(m) for m in modes]]
    assert np.isfinite(solved).all(axis=-1).any(axis=-1).all()
    np.testing.assert_array_equal(q[ok], p[ok])
    np.testing.assert_array_equal(workspace.nearest(leg, q, mode=mode), q)
    np.testing.assert_array_equal(signed >= 0.0, ok)
    settled = 1e-13 if mode == "any" else 2e-7  # see `nearest`
    np.testing.assert_allclose(length(p - q)[~ok], -signed[~ok], rtol=0, atol=settled * leg.size)

    scanned = search(leg, p, ok, (-1, 1) if mode == "any" else mode[:1])
    assert (np.abs(signed) <= scanned + 1e-12 * leg.size).all()  # never farther
    seen = np.isfinite(scanned)
    assert (scanned <= np.abs(signed) + 1e-5 * leg.size)[seen].all()  # never too near
    return seen


# law


@pytest.mark.parametrize("count", [3, pytest.param(30, marks=pytest.mark.long)])
@pytest.mark.parametrize("draw", TOPOLOGIES)
def test_nearest_and_distance_against_search(draw: Draw, count: int) -> None:
    rng = np.random.default_rng(5)
    found = 0
    for k in range(count):
        leg = draw(rng)
        mode = EITHER[k % 3]
        if mode != "any" and not workspace.boundary(leg, mode=mode):
            mode = "any"  # no foot position has this elbow
        found += int(check_against_search(leg, around(leg, rng, 15), mode).sum())
    assert found > count * 15 * 0.9


@pytest.mark.parametrize("leg", CORNER_CASES.values(), ids=CORNER_CASES.keys())
def test_corner_cases_against_search(leg: FiveBar) -> None:
    rng = np.random.default_rng(3)
    assert check_against_search(leg, around(leg, rng, 15), "any").all()


@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 4), (0,)])
def test_batch_is_a_plain_loop(batch: tuple[int, ...]) -> None:
    p = around(BENT, np.random.default_rng(3), int(np.prod(batch))).reshape(*batch, 2)
    for f, item in ((workspace.reachable, ()), (workspace.distance, ()), (workspace.nearest, (2,))):
        each = [f(BENT, row) for row in p.reshape(-1, 2)]
        expected = np.array(each).reshape((*batch, *item))
        # the iteration ends for all at once, so a single point may have fewer rounds
        np.testing.assert_allclose(f(BENT, p), expected, rtol=0, atol=1e-15)
        assert f(BENT, p).shape == expected.shape


def test_far_point_goes_to_the_support_in_its_direction() -> None:
    """At 1e15 m all distances round alike; the right answer is the largest c . u."""
    u = unit(np.linspace(0.05, 6.2, 40))
    q = workspace.nearest(BENT, 1e15 * u)
    inside = around(BENT, np.random.default_rng(1), 50_000)
    inside = inside[workspace.reachable(BENT, inside)]
    assert ((q * u).sum(axis=-1) >= (inside @ u.T).max(axis=0)).all()


@pytest.mark.parametrize("leg", [BENT, replace(BENT, L6=0.0), replace(BENT, L2=0.05, L6=0.0)])
def test_margin_keeps_away_from_the_boundary(leg: FiveBar) -> None:
    p = around(leg, np.random.default_rng(4), 4000)
    margin = 0.003
    held = workspace.distance(leg, p) >= margin
    assert 0 < held.sum() < workspace.reachable(leg, p).sum()
    np.testing.assert_array_equal(workspace.reachable(leg, p, margin=margin), held)
    if leg.L6 > 0.0:
        return
    q = workspace.nearest(leg, p, margin=margin)
    assert workspace.reachable(leg, q, margin=margin).all()
    np.testing.assert_array_equal(q[held], p[held])
    np.testing.assert_allclose(workspace.distance(leg, q[~held]), margin, rtol=0, atol=1e-16)
    near = length(p[:, None] - p[held]).min(axis=1)
    assert (length(p - q) <= near).all()


# oracle


@pytest.mark.parametrize("L6", [1e-20, 1e-13, 1e-9, 1e-6, 1e-4])
def test_short_extension_is_almost_none(L6: float) -> None:
    """F is within L6 of C, so the region is within L6 of the rings', and its outside too."""
    rng = np.random.default_rng(9)
    for _ in range(2):
        leg = replace(any_leg(rng), L6=L6)
        p = around(leg, rng, 50)
        exact = workspace.distance(replace(leg, L6=0.0), p)
        atol = 3.0 * L6 + 1e-14 * leg.size
        np.testing.assert_allclose(workspace.distance(leg, p), exact, rtol=0, atol=atol)


@pytest.mark.parametrize("leg", [BENT, MINITAUR])
def test_reachable_is_inverse_to_the_last_bit(leg: FiveBar) -> None:
    rng = np.random.default_rng(11)
    p = np.concatenate([around(leg, rng, 2000), workspace.nearest(leg, around(leg, rng, 300))])
    p = np.concatenate([p] + [p * (1.0 + k * 2.0**-52) for k in range(-12, 13, 3)])
    solved = np.isfinite(kinematics.inverse_all(leg, p)[..., 0])
    np.testing.assert_array_equal(workspace.reachable(leg, p), solved.any(axis=-1))
    for mode in MODES:
        own = solved[:, MODES.index(mode)]
        np.testing.assert_array_equal(workspace.reachable(leg, p, mode=mode), own)


# edge


def test_coaxial_leg_has_circles() -> None:
    """|AC| = L3 + L4 or L4 - L3 leaves one angle at B to either side, so |AF| is known."""
    leg = FiveBar(0.05, 0.06, 0.01, 0.08, 0.0, 0.03, 0.9)
    k = [math.acos((c**2 - leg.L1**2 - leg.L2**2) / (2.0 * leg.L1 * leg.L2)) for c in (0.07, 0.09)]
    offset = complex(*leg.foot_offset)
    left, right = (sorted(abs(leg.L1 + offset * np.exp(1j * s * x)) for x in k) for s in (1, -1))
    assert left[1] < right[0]  # two rings
    for r, d in (
        (left[0] - 0.001, -0.001),
        (left[1] - 0.001, 0.001),
        (0.5 * (left[1] + right[0]), 0.5 * (left[1] - right[0])),
        (right[1] + 0.1, -0.1),
    ):
        around_it = workspace.distance(leg, r * unit(np.linspace(0.0, 6.0, 20)))
        np.testing.assert_allclose(around_it, d, rtol=0, atol=1e-15)


def test_minitaur_reaches_a_whole_ring() -> None:
    pieces = workspace.boundary(MINITAUR)
    assert [float(length(x).mean()) for x in pieces] == pytest.approx([0.1195, 0.3435], rel=1e-13)
    bent = replace(MINITAUR, bend=0.6)  # C on its outer circle is amid the ring, yet no boundary
    assert len(workspace.boundary(bent)) == 2
    np.testing.assert_allclose(workspace.nearest(MINITAUR, (0.0, 0.0)), (-0.1195, 0.0), atol=1e-15)


def test_fully_stretched_links_leave_one_point_or_circle() -> None:
    leg = FiveBar(0.125, 0.25, 0.5, 0.25, 1.125, 0.125, 0.5 * math.pi)
    for p in ((0.0, 0.0), (3.0, -1.0), (-0.1875, 2.0)):
        np.testing.assert_allclose(workspace.nearest(leg, p), (-0.1875, 0.125), rtol=0, atol=2e-8)
    leg = FiveBar(0.13, 0.06, 0.03, 0.04, 0.0, 0.03, 0.9, 0.3)
    p = around(leg, np.random.default_rng(0), 200)  # C on a circle, with L2 to L4 folded
    radius = abs(leg.L1 - complex(*leg.foot_offset))
    np.testing.assert_allclose(length(workspace.nearest(leg, p)), radius, rtol=0, atol=2e-8)


def test_path_out_of_reach_names_the_nearest_point_of_its_own_mode() -> None:
    """The path leaves what s_A = -1 reaches for where only s_A = +1 does."""
    start = kinematics.forward(BENT, kinematics.home(BENT)[[0, 2]], assembly=-1)
    p = around(BENT, np.random.default_rng(1), 3000)
    p = p[workspace.reachable(BENT, p) & ~workspace.reachable(BENT, p, mode=BENT.mode)]
    stop = p[length(p - start).argmin()]
    path = Line(frequency=1.0, start=tuple(start.tolist()), stop=tuple(stop.tolist()))
    with pytest.raises(UnreachableError, match=r"nearest reachable point is \(") as error:
        motion.plan(BENT, path, 1000, 1e-3)
    lost = path.at(np.array([1e-3 * error.value.index[0]]))[0][0]
    assert workspace.reachable(BENT, lost)
    out = -workspace.distance(BENT, lost, mode=BENT.mode)
    assert out > 0.0
    assert f"is {units.text(1e3 * float(out), 'mm', 3)} out" in str(error.value)


# refusal


@pytest.mark.parametrize("f", [workspace.reachable, workspace.nearest, workspace.distance])
def test_arguments_are_refused(f: Callable[..., object]) -> None:
    for foot in ((0.0, 0.0, 0.0), 1.0, "ab"):
        with pytest.raises(ArgumentError, match=r"foot must .*shape \(\.\.\., 2\)"):
            f(BENT, foot)
    for leg in (BENT, FiveBar()):
        with pytest.raises(ArgumentError, match=r"mode must be .any. or one of .*, got \(0, 1\)"):
            f(leg, (0.0, -0.08), mode=(0, 1))
        with pytest.raises(ArgumentError, match="got None"):  # elsewhere it is the leg's own
            f(leg, (0.0, -0.08), mode=None)


@pytest.mark.parametrize("margin", [-1e-3, np.nan, np.inf, "1"])
def test_margin_is_refused(margin: float) -> None:
    for leg in (BENT, FiveBar()):
        for f in (workspace.reachable, workspace.nearest):
            with pytest.raises(ArgumentError, match=r"margin must be in \[0, inf\) m, got"):
                f(leg, (0.0, -0.08), margin=margin)


def test_margin_of_an_extended_leg_has_no_nearest() -> None:
    with pytest.raises(ArgumentError, match=r"margin must be 0 m .* L6 > 0, got 0\.001 m"):
        workspace.nearest(BENT, (0.0, -0.08), margin=1e-3)


@pytest.mark.parametrize("leg", [FiveBar(), FiveBar(L1=0.06, L4=0.06)])
def test_margin_beyond_the_width_leaves_nothing(leg: FiveBar) -> None:
    p = around(leg, np.random.default_rng(0), 1000)
    assert not workspace.reachable(leg, p, margin=0.5).any()
    with pytest.raises(GeometryError, match=r"less a margin of 0\.5 m is empty to rounding"):
        workspace.nearest(leg, p, margin=0.5)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_not_finite_is_not_reachable_and_has_no_nearest(bad: float) -> None:
    p = [[0.0, -0.03], [0.0, bad]]
    assert not workspace.reachable(BENT, p)[1]
    for f in (workspace.nearest, workspace.distance):
        with pytest.raises(ArgumentError, match=r"finite, below 1e\+150 m, got .* at index \(1,\)"):
            f(BENT, p)


def test_foot_on_B_and_an_elbow_without_reach_are_refused() -> None:
    with pytest.raises(GeometryError, match=r"L6: the foot is on B; .* above 1.*e-10 m, got"):
        workspace.nearest(FiveBar(L6=0.06 * (1.0 + 1e-10), bend=math.pi), (0.0, 0.0))
    stretched = FiveBar(0.05, 0.06, 0.03, 0.04, 0.18, 0.03, 0.9)
    with pytest.raises(GeometryError, match=r"workspace with s_A = \+1 is empty"):
        workspace.distance(stretched, (0.0, 0.0), mode=(1, 1))
