"""Workspace: against a dense search over its boundary, on legs of every topology."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from fivebar_sim import kinematics, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, GeometryError, UnreachableError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.planar import unit

CLASSIC = FiveBar()
RIGID = FiveBar(L1=0.04, L2=0.07, L3=0.05, L4=0.025, L5=0.03, tilt=0.3)  # both rings have holes

Draw = Callable[[np.random.Generator], FiveBar]


def of_lengths(L: Array, L5: float, tilt: float = 0.0) -> FiveBar:
    L1, L2, L3, L4 = L.tolist()
    return FiveBar(L1, L2, L3, L4, float(L5), tilt=float(tilt), scale="any")


def any_leg(rng: np.random.Generator) -> FiveBar:
    L = rng.uniform(0.02, 0.1, 4)
    L5 = rng.uniform(max(0.0, 2.0 * L.max() - L.sum()), L.sum())
    return of_lengths(L, L5, rng.uniform(-3.0, 3.0))


def no_hole(rng: np.random.Generator) -> FiveBar:
    a, b, c = rng.uniform(0.03, 0.1, 3)
    return FiveBar(a, a, b, b, c * min(a, b) / 0.1, tilt=float(rng.uniform(-3.0, 3.0)))


def coaxial(rng: np.random.Generator) -> FiveBar:
    return of_lengths(rng.uniform(0.05, 0.1, 4), 0.0)  # the longest is below the other three's sum


def containing(rng: np.random.Generator) -> FiveBar:
    """Return a leg whose ring about E lies wholly inside the disc about A."""
    a, c, d, gap = rng.uniform(0.1, 0.12), *rng.uniform(0.02, 0.04, 2), rng.uniform(0.01, 0.1)
    return FiveBar(a, a, c, d, gap, tilt=float(rng.uniform(-3.0, 3.0)))


def two_parts(rng: np.random.Generator) -> FiveBar:
    """Return a leg of two narrow rings, which cross in two separate quadrangles."""
    a, b = rng.uniform(0.09, 0.11, 2)
    c, d = rng.uniform(0.01, 0.015, 2)
    return FiveBar(a, c, d, b, float(rng.uniform(0.09, 0.12)), tilt=float(rng.uniform(-3.0, 3.0)))


def sliver(rng: np.random.Generator) -> FiveBar:
    """Return a leg that is stretched, or nested, to within 1e-3 to 1e-9 of its size."""
    a, b, c, d = rng.uniform(0.02, 0.1, 4).tolist()
    thin = 1.0 - 10.0 ** float(rng.uniform(-9.0, -3.0))
    if rng.random() < 0.5:
        return FiveBar(a, b, c, d, thin * (a + b + c + d), tilt=float(rng.uniform(-3.0, 3.0)))
    return FiveBar(a + b + c + d, b, c, d, a / thin)  # E's ring just out of the hole about A


TOPOLOGIES = [any_leg, no_hole, coaxial, containing, two_parts, sliver]


def rings(leg: FiveBar) -> list[tuple[Array, float, float]]:
    A, E = kinematics.bases(leg)
    return [
        (A, abs(leg.L1 - leg.L2), leg.L1 + leg.L2),
        (E, abs(leg.L4 - leg.L3), leg.L4 + leg.L3),
    ]


def search(leg: FiveBar, p: Array) -> Array:
    """Return the least distance of p (n, 2) to the boundary, by scanning the four circles.

    2001 angles of each, those outside the other ring left out, and three times 41 angles within
    two steps of the best. Every point of the scan is in the workspace, without any slack.
    """
    best = np.full(len(p), np.inf)
    left, right = rings(leg)
    for (centre, *radii), (other, low, high) in ((left, right), (right, left)):
        for radius in radii:
            if radius < 1e-9:
                continue
            angle = np.linspace(-np.pi, np.pi, 2001)[None, :]
            width = 2.0 * np.pi / 2000
            for _ in range(4):
                # Each coordinate by itself, and squares: a third of the time.
                x, z = centre[:, None, None] + radius * np.stack([np.cos(angle), np.sin(angle)])
                r = np.hypot(x - other[0], z - other[1])
                d = (p[:, :1] - x) ** 2 + (p[:, 1:] - z) ** 2
                d = np.where((low <= r) & (r <= high), d, np.inf)
                k = d.argmin(axis=1)
                best = np.minimum(best, np.sqrt(d.min(axis=1)))
                middle = np.broadcast_to(angle, d.shape)[np.arange(len(p)), k]
                angle = middle[:, None] + width * np.linspace(-2.0, 2.0, 41)
                width /= 10.0
    return best


def around(leg: FiveBar, rng: np.random.Generator, count: int) -> Array:
    return rng.uniform(-1.3, 1.3, (count, 2)) * (leg.size + 0.5 * leg.L5)


def length(v: Array) -> Array:
    return np.hypot(v[..., 0], v[..., 1])


# law


@pytest.mark.parametrize("count", [20, pytest.param(334, marks=pytest.mark.long)])
@pytest.mark.parametrize("draw", TOPOLOGIES)
def test_nearest_and_distance_against_search(draw: Draw, count: int) -> None:
    rng = np.random.default_rng(5)
    found = 0
    for _ in range(count):
        leg = draw(rng)
        p = around(leg, rng, 40)
        ok = workspace.reachable(leg, p)
        q = workspace.nearest(leg, p)
        signed = workspace.distance(leg, p)
        assert workspace.reachable(leg, q).all()
        kinematics.inverse(leg, q)  # takes them all
        np.testing.assert_array_equal(q[ok], p[ok])
        np.testing.assert_array_equal(workspace.nearest(leg, q), q)
        np.testing.assert_array_equal(signed >= 0.0, ok)
        # the settling on a floating-point neighbour is all that sets the two apart
        np.testing.assert_allclose(length(p - q)[~ok], -signed[~ok], rtol=0, atol=1e-14)

        scanned = search(leg, p)
        assert (np.abs(signed) <= scanned + 1e-9 * leg.size).all()  # never farther
        seen = np.isfinite(scanned)
        found += int(seen.sum())
        if draw is not sliver:  # whose corners the scan may miss; else it misses by a step at most
            assert (scanned <= np.abs(signed) + 4e-3 * leg.size)[seen].all()  # never too near
    assert found > (0 if draw is sliver else count * 40 * 0.9)


def test_topologies_are_what_they_say() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        (A, low_A, high_A), (E, low_E, high_E) = rings(no_hole(rng))
        assert low_A == low_E == 0.0
        (A, low_A, high_A), (E, low_E, high_E) = rings(containing(rng))
        assert low_A == 0.0
        assert length(A - E) + high_E < high_A
        leg = two_parts(rng)
        u = (
            np.linspace(-1.0, 1.0, 401)[:, None]
            * 2.0
            * leg.size
            * kinematics.bases(leg)[1]
            / (0.5 * leg.L5)
        )
        assert not workspace.reachable(leg, u).any()  # nothing on the line of the motors


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_links_of_very_different_lengths(scale: float) -> None:
    """Where one ring is finer than the other's rounding, the answer still is reachable."""
    rng = np.random.default_rng(7)
    for _ in range(100):
        L = 10.0 ** rng.uniform(-6.0, 0.0, 4) * scale
        L5 = rng.uniform(max(0.0, 2.0 * L.max() - L.sum()), L.sum())
        leg = of_lengths(L, L5, rng.uniform(-3.0, 3.0))
        q = workspace.nearest(leg, around(leg, rng, 20))
        assert workspace.reachable(leg, q).all()
        kinematics.inverse(leg, q)


@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 4), (0,)])
def test_batch_is_a_plain_loop(batch: tuple[int, ...]) -> None:
    p = around(RIGID, np.random.default_rng(3), int(np.prod(batch))).reshape(*batch, 2)
    for f, item in ((workspace.reachable, ()), (workspace.distance, ()), (workspace.nearest, (2,))):
        each = [f(RIGID, row) for row in p.reshape(-1, 2)]
        expected = np.array(each).reshape((*batch, *item))
        np.testing.assert_array_equal(f(RIGID, p), expected)
        assert f(RIGID, p).shape == expected.shape


def test_far_point_goes_to_the_support_in_its_direction() -> None:
    """At 1e15 m all distances round alike; the right answer is the largest c . u."""
    angle = np.linspace(0.05, 6.2, 40)
    u = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    q = workspace.nearest(RIGID, 1e15 * u)
    inside = around(RIGID, np.random.default_rng(1), 200_000)
    inside = inside[workspace.reachable(RIGID, inside)]
    assert ((q * u).sum(axis=-1) >= (inside @ u.T).max(axis=0)).all()


# oracle


@pytest.mark.parametrize("leg", [CLASSIC, RIGID])
def test_reachable_is_inverse_to_the_last_bit(leg: FiveBar) -> None:
    rng = np.random.default_rng(11)
    p = np.concatenate([around(leg, rng, 8000), workspace.nearest(leg, around(leg, rng, 2000))])
    p = np.concatenate([p] + [p * (1.0 + k * 2.0**-52) for k in range(-12, 13)])
    solved = ~np.isnan(kinematics.inverse_all(leg, p)).any(axis=(-2, -1))
    np.testing.assert_array_equal(workspace.reachable(leg, p), solved)


# edge


def test_point_on_annulus_centre_goes_away_from_the_other_motor() -> None:
    leg = FiveBar(L1=0.04, L2=0.07, L3=0.06, L4=0.05, L5=0.04)  # a hole of 30 mm about A
    A = kinematics.bases(leg)[0]
    for p in (A, A + np.array([0.0, 1e-18])):  # to rounding
        np.testing.assert_allclose(workspace.nearest(leg, p), A - [0.03, 0.0], rtol=0, atol=1e-16)


def test_point_on_annulus_centre_goes_to_a_corner_where_away_is_out_of_reach() -> None:
    leg = FiveBar(L1=0.04, L2=0.07, L3=0.03, L4=0.02, L5=0.05)  # E's ring ends at A
    A, E = kinematics.bases(leg)
    q = workspace.nearest(leg, A)
    assert length(q - A) == pytest.approx(0.03, rel=1e-14)
    assert length(q - E) == pytest.approx(0.05, rel=1e-14)
    assert q[1] < 0.0  # of two mirrored corners the first is to the right of A -> E: below


def test_coaxial_centre_goes_down() -> None:
    leg = FiveBar(L1=0.03, L2=0.05, L3=0.055, L4=0.03, L5=0.0)
    np.testing.assert_allclose(workspace.nearest(leg, (0.0, 0.0)), (0.0, -0.025), rtol=1e-15)


@pytest.mark.parametrize("tilt", np.linspace(-1.5, 1.5, 13))
def test_tie_on_the_symmetry_axis_goes_to_the_side_where_the_leg_hangs(tilt: float) -> None:
    leg = FiveBar(L1=0.1, L2=0.012, L3=0.012, L4=0.1, L5=0.11, tilt=tilt)
    along = unit(tilt)
    down = unit(tilt - 0.5 * math.pi)
    part = math.sqrt(0.088**2 - 0.055**2) * down
    for x in np.linspace(-0.03, 0.03, 21):
        for above, expected in ((0.0, part), (1e-9, -part)):
            q = workspace.nearest(leg, x * along - above * down)
            np.testing.assert_allclose(q, expected, rtol=0, atol=1e-15)


def test_classic_leg_below_its_reach_is_stretched() -> None:
    q = workspace.nearest(CLASSIC, (0.0, -0.2))
    np.testing.assert_allclose(q, (0.0, -np.sqrt(0.1**2 - 0.015**2)), rtol=1e-14, atol=1e-17)
    assert workspace.distance(CLASSIC, q) == pytest.approx(0.0, abs=1e-16)


def test_boundary_point_stays_and_has_no_distance() -> None:
    p = kinematics.bases(CLASSIC)[0] + [0.06, -0.08]
    assert workspace.reachable(CLASSIC, p)
    np.testing.assert_array_equal(workspace.nearest(CLASSIC, p), p)
    assert workspace.distance(CLASSIC, p) == pytest.approx(0.0, abs=1e-16)


def test_fully_stretched_links_leave_one_point() -> None:
    leg = FiveBar(L1=0.125, L2=0.25, L3=0.5, L4=0.25, L5=1.125)
    for p in ((0.0, 0.0), (3.0, -1.0), (-0.1875, 2.0)):
        np.testing.assert_allclose(
            workspace.nearest(leg, p), (-0.1875, 0.0), rtol=1e-14, atol=1e-15
        )
    np.testing.assert_allclose(workspace.distance(leg, (-0.1875, 2.0)), -2.0, rtol=1e-15)


def test_equal_links_leave_no_hole() -> None:
    A = kinematics.bases(CLASSIC)[0]
    leg = FiveBar(L1=0.05, L2=0.05, L3=0.06, L4=0.04, L5=0.03)
    assert workspace.reachable(leg, A)
    assert workspace.distance(leg, A) == pytest.approx(0.03 - 0.02, rel=1e-14)  # E's hole


# refusal


@pytest.mark.parametrize("f", [workspace.reachable, workspace.nearest, workspace.distance])
def test_shapes_are_refused(f: Callable[..., object]) -> None:
    for foot in ((0.0, 0.0, 0.0), 1.0, "ab"):
        with pytest.raises(ArgumentError, match=r"foot must .*shape \(\.\.\., 2\)"):
            f(CLASSIC, foot)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_not_finite_is_not_reachable_and_has_no_nearest(bad: float) -> None:
    p = [[0.0, -0.08], [0.0, bad]]
    np.testing.assert_array_equal(workspace.reachable(CLASSIC, p), [True, False])
    for f in (workspace.nearest, workspace.distance):
        with pytest.raises(ArgumentError, match=r"finite, below 1e\+150 m, got .* at index \(1,\)"):
            f(CLASSIC, p)


def test_empty_workspace_is_refused() -> None:
    leg = FiveBar()
    object.__setattr__(leg, "L5", 0.3)  # FiveBar itself refuses this
    assert not workspace.reachable(leg, (0.0, -0.08))
    with pytest.raises(UnreachableError):
        kinematics.inverse(leg, (0.0, -0.08))
    with pytest.raises(GeometryError, match=r"empty to rounding: \[0\.02, 0\.1\] m from A"):
        workspace.nearest(leg, (0.0, -0.08))
