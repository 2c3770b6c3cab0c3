"""Planned motion: it follows the path, and what becomes of targets that are out of reach."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from fivebar_sim import FiveBar, kinematics, motion, workspace
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, UnreachableError
from fivebar_sim.motion import KNEE_STOP, Motion, edge_margin, plan, rates
from fivebar_sim.paths import Circle, Gait, Hop, Line, Lines, Step

CLASSIC = FiveBar.load("classic")
HOCKEY = FiveBar.load("airhockey")
STUDY = ((0.6, 0.4), (0.5, 0.5), (-0.25, 0.25), (-0.2, 0.6), (0.3, 0.6))
"""The path of a published control study of this leg, [m] from A."""

H = 1e-3
WIDE = Circle(centre=(0.01, -0.072), radius=0.03, frequency=1.0, outside="nearest")
"""It leaves the workspace of CLASSIC below."""


def study(shift: float = 0.0) -> Lines:
    return Lines(
        points=tuple((x - 0.5 * HOCKEY.L5 + shift, z) for x, z in STUDY),
        seconds=1.0,
        outside="refuse",
    )


def nearest(path: Lines) -> Lines:
    return msgspec.structs.replace(path, outside="nearest")


def feet(leg: FiveBar, m: Motion) -> np.ndarray:
    return kinematics.forward(leg, m.q[:, [0, 2]])


# law


@pytest.mark.parametrize(
    "path",
    [
        Gait(centre=(0.0, -0.08), stride=0.03, lift=0.015, frequency=2.0, touchdown=0.1),
        Hop(low=0.05, high=0.085, frequency=2.0, thrust=0.15, flight=0.25),
        Step(start=(-0.02, -0.08), stop=(0.015, -0.07), lift=0.01, seconds=0.5),
        Lines(points=((0.0, -0.08), (0.02, -0.07), (-0.01, -0.06)), seconds=0.5),
    ],
    ids=lambda path: path.__struct_config__.tag,
)
def test_the_new_kinds_are_followed(path: Gait | Hop | Step | Lines) -> None:
    m = plan(CLASSIC, path, 1000, H)
    np.testing.assert_array_equal(m.foot, path.at(m.time).position)
    np.testing.assert_allclose(feet(CLASSIC, m), m.foot, rtol=0.0, atol=1e-15)
    J = kinematics.jacobian(CLASSIC, m.q[:, [0, 2]])
    foot_dot = np.einsum("nij,nj->ni", J, m.q_dot[:, [0, 2]])
    np.testing.assert_allclose(foot_dot, m.foot_dot, rtol=0.0, atol=1e-13)


def test_the_path_of_a_published_study_is_followed() -> None:
    m = plan(HOCKEY, study(), 4200, H)
    np.testing.assert_allclose(feet(HOCKEY, m), m.foot, rtol=0.0, atol=1e-15)
    assert m.q[:, 0].max() == pytest.approx(4.4868, abs=5e-5)  # beyond pi: theta_A winds on
    np.testing.assert_array_equal(m.q_dot[4000:], 0.0)
    assert np.abs(np.diff(m.q, axis=0)).max() < 5.0 * H  # continuous: no joint passes 4 rad/s


@pytest.mark.parametrize(
    "leg", [CLASSIC, HOCKEY, FiveBar.load("extended")], ids=lambda leg: leg.name
)
def test_poses_are_those_that_resting_paths_begin_with(leg: FiveBar) -> None:
    home = kinematics.home(leg)
    middle = kinematics.forward(leg, home[[0, 2]])
    around = np.random.default_rng(5).uniform(-0.1, 0.1, (20, 2)) * leg.size
    wanted = middle + around
    q = motion.poses(leg, wanted)
    for pose, (x, z) in zip(q, wanted.tolist(), strict=True):
        hold = Lines(points=((x, z), (x, z)), seconds=1.0)
        begun = plan(leg, hold, 1, H).q[0]
        np.testing.assert_allclose(pose, begun, rtol=0.0, atol=1e-13)


def test_poses_out_of_reach_are_refused_by_row() -> None:
    feet_wanted = np.array([[0.0, -0.08], [0.0, -0.2]])
    with pytest.raises(UnreachableError, match=r"\(0.00, -200.00\) mm is .* mm out") as caught:
        motion.poses(CLASSIC, feet_wanted)
    assert caught.value.index == (1,)


def test_path_in_millimetres_is_asked_about() -> None:
    path = Circle(centre=(0.0, -72.0), radius=10.0, frequency=1.0)
    with pytest.raises(UnreachableError, match=r"positions are in metres: were these in mm\?$"):
        plan(CLASSIC, path, 100, H)
    near = Circle(centre=(0.0, -0.3), radius=0.01, frequency=1.0)
    with pytest.raises(UnreachableError, match=r"\(0.00, -98.87\) mm$"):
        plan(CLASSIC, near, 100, H)


def test_a_rest_pose_is_the_callers_own() -> None:
    kinematics.home(CLASSIC)[:] = 0.0
    assert kinematics.home(CLASSIC).any()


def test_targets_in_reach_are_left_as_they_are() -> None:
    for leg, path in ((HOCKEY, study()), (FiveBar.load("extended"), _beside_home())):
        for a, b in zip(
            plan(leg, path, 900, H),
            plan(leg, msgspec.structs.replace(path, outside="nearest"), 900, H),
            strict=True,
        ):
            np.testing.assert_array_equal(a, b)


def _beside_home() -> Line:
    leg = FiveBar.load("extended")
    x, z = kinematics.forward(leg, kinematics.home(leg)[[0, 2]]).tolist()
    return Line(start=(x, z), stop=(x + 0.002, z), frequency=1.0)


@pytest.mark.parametrize(
    ("leg", "path"),
    [(HOCKEY, nearest(study(0.4))), (HOCKEY, nearest(study(-0.4))), (CLASSIC, WIDE)],
    ids=["right", "left", "circle"],
)
def test_targets_out_of_reach_go_to_the_nearest_point(leg: FiveBar, path: Lines | Circle) -> None:
    m = plan(leg, path, 2000, H)
    target = path.at(np.arange(2001) * H).position
    margin = edge_margin(leg)
    kept = workspace.distance(leg, target) >= margin
    assert 0.1 < kept.mean() < 0.95
    np.testing.assert_array_equal(m.foot[kept], target[kept])
    np.testing.assert_allclose(feet(leg, m), m.foot, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(workspace.distance(leg, m.foot[~kept]), margin, rtol=1e-9)
    moved = np.hypot(*(m.foot - target).T)[~kept]
    out = -workspace.distance(leg, target[~kept])
    assert np.all(moved >= (out + margin) * (1.0 - 1e-9))  # more at corners, where edges meet
    assert np.mean(np.isclose(moved, out + margin, rtol=1e-9)) > 0.3
    knees = np.abs(np.sin(m.q[:, [1, 3]]))
    assert knees.min() >= np.sin(KNEE_STOP) * (1.0 - 1e-6)


def test_rates_of_a_projected_motion_are_central_differences_of_it() -> None:
    m = plan(CLASSIC, WIDE, 1500, H)
    for values, dot, ddot in ((m.foot, m.foot_dot, m.foot_ddot), (m.q, m.q_dot, m.q_ddot)):
        for k in (1, 400, 777, 1499):
            expected = (values[k + 1] - values[k - 1]) / (2.0 * H)
            np.testing.assert_allclose(dot[k], expected, rtol=1e-12, atol=1e-12)
            expected = (values[k + 1] - 2.0 * values[k] + values[k - 1]) / H**2
            np.testing.assert_allclose(ddot[k], expected, rtol=1e-9, atol=1e-9)
    assert np.all(np.isfinite(np.concatenate([m.q_dot, m.q_ddot])))


# slope


def test_rates_are_exact_for_parabolas_but_at_the_ends() -> None:
    t = 0.5 * np.arange(9, dtype=np.float64)
    p: Array = np.stack([3.0 - 2.0 * t, 1.0 + t + 4.0 * t**2], axis=-1)
    v, a = rates(p, 0.5)
    np.testing.assert_allclose(v[1:-1], np.stack([-2.0 + 0.0 * t, 1.0 + 8.0 * t], -1)[1:-1])
    np.testing.assert_allclose(a[1:-1], [(0.0, 8.0)] * 7, atol=1e-12)
    np.testing.assert_allclose(v[[0, -1]], (p[[1, -1]] - p[[0, -2]]) / 0.5)
    np.testing.assert_allclose(a[[0, -1]], 0.0, atol=1e-12)


# edge


@pytest.mark.parametrize("name", ["airhockey", "classic", "doggo", "q8bot"])
def test_margin_keeps_each_knee_from_being_in_line(name: str) -> None:
    leg = FiveBar.load(name)
    margin = edge_margin(leg)
    assert 0.0 < margin < 0.005 * leg.size
    sines = []
    for near, far in ((leg.L1, leg.L2), (leg.L4, leg.L3)):
        for span in (near + far - margin, abs(near - far) + margin):
            cosine = (near**2 + far**2 - span**2) / (2.0 * near * far)
            sines.append(np.sqrt(1.0 - cosine**2))
    # the tightest of them is just at the stop
    assert min(sines) == pytest.approx(np.sin(KNEE_STOP), rel=1e-9)


def test_sides_that_fold_on_their_axis_need_no_margin_there() -> None:
    equal = FiveBar(L1=0.05, L2=0.05, L3=0.05, L4=0.05, L5=0.03)
    assert edge_margin(equal) == pytest.approx(0.1 * (1.0 - np.cos(0.5 * KNEE_STOP)), rel=1e-6)


# refusal


@pytest.mark.parametrize("shift", [0.4, -0.4])
def test_targets_out_of_reach_are_refused_unless_asked(shift: float) -> None:
    with pytest.raises(UnreachableError, match=r"^path out of reach at t = .* mm out; the nearest"):
        plan(HOCKEY, study(shift), 4200, H)


def test_legs_with_an_extension_are_not_projected() -> None:
    path = Circle(centre=(0.0, -0.09), radius=0.1, frequency=1.0, outside="nearest")
    legal = r'^outside = "nearest" needs a leg with L6 = 0, got 0.025 m$'
    with pytest.raises(ArgumentError, match=legal):
        plan(FiveBar.load("extended"), path, 1000, H)


def test_projections_that_jump_are_refused() -> None:
    """Past the middle of the hole about A the nearest point changes side; over it, it slides."""
    x = -0.5 * HOCKEY.L5
    for beside, down, slides in ((0.03, 0.02, True), (0.012, 0.012, False), (0.03, -0.05, False)):
        points = ((x + beside, 0.5), (x + beside, down))
        path = Lines(points=points, seconds=1.0, outside="nearest")
        if slides:
            assert np.abs(plan(HOCKEY, path, 1000, H).foot_dot).max() < 10.0 * (0.5 - down)
            continue
        with pytest.raises(
            UnreachableError, match=r"^path moves the nearest .* more than 10 times"
        ):
            plan(HOCKEY, path, 1000, H)


def test_stops_hold_for_projected_targets() -> None:
    path = Circle(centre=(0.0, -0.07), radius=0.1, frequency=1.0, outside="nearest")
    with pytest.raises(UnreachableError, match="path winds theta_A beyond its range"):
        motion.plan(CLASSIC, path, 2000, H)
