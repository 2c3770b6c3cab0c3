"""Hobby servos: steps, ranges, round trips, and the foot error against its bound."""

from __future__ import annotations

import math
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from poses import BATCHES, RIGID, length, random_leg, sample

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.control.hobby import (
    HANGING,
    PUBLISHED,
    HobbyServo,
    ServoTable,
    joint_angles,
    rounding_bound,
    rounding_error,
    servo_angles,
)
from fivebar_sim.errors import ArgumentError, FiveBarError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.kinematics.planar import wrap
from fivebar_sim.kinematics.reach import points_at

SCRIPT = Path(__file__).parents[1] / "scripts" / "servo_rounding.py"
DEGREE = math.pi / 180.0
LEG = FiveBar()
MIXED = ServoTable(  # nothing equal; the ranges do not start at 0
    HobbyServo(0.3, -1, (-2.0, 3.0), 0.05), HobbyServo(-1.1, 1, (-math.pi, math.pi), math.pi / 90.0)
)


def full_turn(rng: np.random.Generator, degrees: float) -> ServoTable:
    """Return servos that reach everything, with steps in random places."""
    servos = [
        HobbyServo(offset, 1 - 2 * k, (-math.pi, math.pi), degrees * DEGREE)
        for k, offset in enumerate(rng.uniform(-3.0, 3.0, 2).tolist())
    ]
    return ServoTable(*servos)


def closed(leg: FiveBar, foot: Array) -> Array:
    """Return the angles of those points that the leg reaches in its mode and assembly."""
    theta = kinematics.inverse_all(leg, foot)[:, MODES.index(leg.mode)]
    ok = np.isfinite(theta[:, 0])
    foot = foot[ok]
    theta = theta[ok]
    right = kinematics.branch(leg, points_at(leg, foot, theta)).assembly == leg.assembly
    return theta[right]


# law


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("leg", [LEG, RIGID], ids=["classic", "tilted"])
def test_joint_angles_of_servo_angles_are_half_a_step_off(
    leg: FiveBar, batch: tuple[int, ...], rng: np.random.Generator
) -> None:
    for table in (HANGING, MIXED):
        u = np.stack([rng.uniform(*servo.range, batch) for servo in (table.A, table.E)], axis=-1)
        theta = joint_angles(leg, u, table)
        assert ((theta > -math.pi) & (theta <= math.pi)).all()
        rounded = servo_angles(leg, theta, table)
        step = np.array([table.A.resolution, table.E.resolution])
        low = np.array([table.A.range[0], table.E.range[0]])
        assert u.shape == theta.shape == rounded.shape == (*batch, 2)
        assert (np.abs(rounded - u) <= 0.5 * step + 1e-9).all()
        np.testing.assert_allclose((rounded - low) / step, np.rint((u - low) / step), atol=1e-9)
        again = joint_angles(leg, rounded, table)
        np.testing.assert_allclose(servo_angles(leg, again, table), rounded, rtol=0, atol=1e-14)
        assert (np.abs(wrap(again - theta)) <= 0.5 * step + 1e-9).all()


def test_rounding_error_is_within_its_bound_over_random_legs() -> None:
    rng = np.random.default_rng(11)
    ratio = 0.0
    over_first = 0.0
    seen = 0
    for _ in range(300):
        leg = random_leg(rng)
        theta = closed(leg, rng.uniform(-1.0, 1.0, (300, 2)) * leg.size)
        table = full_turn(rng, degrees=float(rng.choice([0.5, 1.0, 5.0])))
        bound = rounding_bound(leg, theta, table)
        some = np.isfinite(bound.total)
        error = length(rounding_error(leg, theta[some], table))
        assert (error <= bound.total[some]).all()
        ratio = max(ratio, float((error / bound.total[some]).max(initial=0.0)))
        over_first = max(over_first, float((error / bound.first[some]).max(initial=0.0)))
        seen += int(some.sum())
    assert seen > 10_000
    assert ratio > 0.9  # as tight as a bound by lengths can be
    assert over_first > 1.05  # to first order alone it would not hold


def test_bound_shrinks_to_its_first_order(rng: np.random.Generator) -> None:
    theta = sample(RIGID, (50,))[1]
    coarse, fine = (
        rounding_bound(RIGID, theta, full_turn(rng, degrees)) for degrees in (0.1, 0.001)
    )
    np.testing.assert_allclose(fine.first, coarse.first / 100.0, rtol=1e-12)
    np.testing.assert_allclose(fine.remainder * 1e4, coarse.remainder, rtol=0.1)
    assert (fine.remainder < 1e-2 * fine.first).all()


def test_whole_degrees_on_the_classic_leg() -> None:
    """Worst 0.547 mm on a grid of 0.25 mm; of a coarser one each point is within the bound."""
    script = runpy.run_path(str(SCRIPT))
    r = script["measure"](LEG, 1e-3)
    assert (r.error <= r.total).all()
    clear = r.margin_deg >= 30.0
    assert clear.sum() > 5000
    assert 0.5e-3 < r.error[clear].max() < r.total[clear].max() < 0.72e-3
    assert r.first[clear].max() == pytest.approx(0.699e-3, rel=5e-3)
    assert "30 deg" in script["report"](r)


# slope


def test_bound_to_first_order_is_the_jacobian_times_half_a_degree() -> None:
    theta = sample(RIGID, (20,))[1]
    step = 1e-6
    slopes = [
        (kinematics.forward(RIGID, theta + e) - kinematics.forward(RIGID, theta - e)) / (2.0 * step)
        for e in step * np.eye(2)
    ]
    first = sum(length(slope) for slope in slopes) * 0.5 * DEGREE
    # central differences: step^2 C'''/6 and eps |F| / step, both below 1e-9 of 0.1 m
    np.testing.assert_allclose(rounding_bound(RIGID, theta).first, first, rtol=1e-7)


# oracle


def test_rounding_error_is_the_shift_of_the_foot() -> None:
    """Angles -130.4 and -49.7 deg are sent as 94.6 and 85.3, so 95 and 85 deg."""
    theta = np.radians([-130.4, -49.7])
    sent = servo_angles(LEG, theta)
    np.testing.assert_allclose(sent, np.radians([95.0, 85.0]), rtol=1e-14)
    shift = kinematics.forward(LEG, np.radians([-130.0, -50.0])) - kinematics.forward(LEG, theta)
    np.testing.assert_allclose(rounding_error(LEG, theta), shift, rtol=0, atol=1e-15)


def test_published_servos_are_sent_90_deg_plus_the_angle() -> None:
    for angle in ((45.0, 0.0), (90.0, 45.0), (-90.0, -90.0)):
        sent = servo_angles(LEG, np.radians(angle), PUBLISHED)
        np.testing.assert_allclose(sent, np.radians(angle) + math.pi / 2.0, rtol=0, atol=1e-15)
    with pytest.raises(UnreachableError, match=r"at A must be .* got -40 deg"):
        servo_angles(LEG, np.radians([-130.0, -50.0]), PUBLISHED)  # a hanging leg


def test_hanging_servos_are_near_mid_range_at_rest() -> None:
    rest = kinematics.home(LEG)[[0, 2]]
    np.testing.assert_allclose(servo_angles(LEG, rest), math.pi / 2.0, rtol=0, atol=2.5 * DEGREE)


# edge


@pytest.mark.parametrize("direction", [-1, 1])
def test_half_a_step_goes_up_whichever_way_the_angle_was_made(direction: int) -> None:
    servo = HobbyServo(math.pi / 2.0, direction)
    table = ServoTable(servo, servo)
    for degrees in range(180):
        theta = direction * math.radians(degrees + 0.5 - 90.0)
        for near in (theta, np.nextafter(theta, 9.0), np.nextafter(theta, -9.0)):
            sent = servo_angles(LEG, (near, near), table)
            np.testing.assert_allclose(sent / DEGREE, degrees + 1, rtol=0, atol=1e-12)
        below = servo_angles(LEG, (theta - direction * 1e-6, 0.0), table)
        assert below[0] / DEGREE == pytest.approx(degrees, abs=1e-12)


def test_direction_minus_one_turns_against_theta() -> None:
    mirrored = ServoTable(HobbyServo(1.25 * math.pi, -1), HobbyServo(0.75 * math.pi, -1))
    theta = np.radians([[-130.0, -50.0], [-100.2, -20.4]])
    upright = servo_angles(LEG, -theta, mirrored)  # the hanging leg seen in a mirror
    np.testing.assert_allclose(upright, np.radians([[95.0, 85.0], [125.0, 115.0]]), rtol=1e-14)
    np.testing.assert_allclose(
        joint_angles(LEG, upright, mirrored), np.radians([[130.0, 50.0], [100.0, 20.0]])
    )


def test_whole_turns_count_for_nothing_and_both_ends_are_legal() -> None:
    ends = np.radians([[-225.0, -135.0], [-45.0, 45.0]])
    for turns in (-4.0 * math.pi, 0.0, 2.0 * math.pi):
        sent = servo_angles(LEG, ends + turns)
        np.testing.assert_allclose(sent, [[0.0, 0.0], [math.pi, math.pi]], rtol=0, atol=1e-14)
    np.testing.assert_allclose(joint_angles(LEG, [0.0, math.pi]), np.radians([135.0, 45.0]))


def test_angles_are_from_the_tilted_base() -> None:
    tilted = FiveBar(tilt=0.3)
    theta = np.radians([-130.4, -49.7])
    np.testing.assert_allclose(servo_angles(tilted, theta + 0.3), servo_angles(LEG, theta))
    np.testing.assert_allclose(
        joint_angles(tilted, (1.0, 2.0)), joint_angles(LEG, (1.0, 2.0)) + 0.3
    )


def test_bound_is_infinite_where_rounding_may_straighten_the_lower_links() -> None:
    leg = FiveBar(0.03, 0.04, 0.04, 0.03, 0.06)
    straight = np.array([math.pi - 1.2309594173407747, 1.2309594173407747])  # |BD| = 80 mm
    inner = straight + np.radians([-1.5, 1.5])  # by 1 deg of each it would be reached
    for theta, finite in ((straight + np.radians([-0.4, 0.4]), False), (inner, True)):
        assert np.isfinite(rounding_bound(leg, theta).total) == finite


# refusal


def test_beyond_the_range_names_index_and_both_units() -> None:
    theta = np.full((2, 3, 2), np.radians([-130.0, -50.0]))
    theta[1, 0, 1] = np.radians(50.0)
    theta[1, 2, 0] = np.radians(100.0)
    with pytest.raises(
        UnreachableError,
        match=r"^2 of 6 poses are .* at E must be in \[0, 180\] deg "
        r"\(\[0, 3\.14159\] rad\), got 185 deg \(3\.22886 rad\) at index \(1, 0\)$",
    ) as info:
        servo_angles(LEG, theta)
    assert info.value.index == (1, 0)
    with pytest.raises(UnreachableError, match=r"^the pose is .* at A .* got -5 deg") as info:
        joint_angles(LEG, np.radians([-5.0, 90.0]))
    assert info.value.index == ()
    for f in (rounding_error, servo_angles):
        for theta_A, came in ((130.0, "-5"), (-40.0, "185")):
            with pytest.raises(UnreachableError, match=rf"at A .* got {came} deg"):
                f(LEG, np.radians([theta_A, -50.0]))


def test_arguments_are_refused() -> None:
    calls: list[Any] = [servo_angles, joint_angles, rounding_error, rounding_bound]
    for f in calls:
        for bad in (1.0, (0.0, 0.0, 0.0), "ab", None):
            with pytest.raises(ArgumentError, match=r"must .*\(\.\.\., 2\)"):
                f(LEG, bad)
        with pytest.raises(ArgumentError, match=r"must be finite \[rad\], got .* \(1,\)"):
            f(LEG, [(-2.3, -0.8), (np.nan, 0.0)])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"offset": np.nan}, "offset must"),
        ({"direction": 0}, "direction must be -1 or 1, got 0"),
        ({"direction": 1.0}, "direction must be -1 or 1"),
        ({"range": (0.0, 0.0)}, "range must be in"),
        ({"range": (0.0, 7.0)}, "range must be in"),
        ({"range": (0.0, np.inf)}, "range must be in"),
        ({"range": 3.0}, "range must be"),
        ({"resolution": 0.0}, "resolution must be"),
        ({"resolution": np.nan}, "resolution must be"),
        ({"resolution": 0.7 * DEGREE}, "whole number of steps"),
        ({"resolution": 4.0}, "resolution must be"),
    ],
)
def test_servos_that_cannot_be_are_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(FiveBarError, match=message):
        HobbyServo(**{"offset": 0.0, **changed})
