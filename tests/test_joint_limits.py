"""The working mode that joint limits pick, and the rule of the published controller."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from poses import FAR, RIGHT, RIGID, WIDE, random_leg, sample

from fivebar_sim import kinematics
from fivebar_sim.errors import ArgumentError, UnreachableError
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.kinematics.half_angle import PUBLISHED_LIMITS
from fivebar_sim.kinematics.planar import wrap


def test_within_is_the_first_mode_within() -> None:
    """Against all modes and turns of each point; one that none of them fits is refused."""
    rng = np.random.default_rng(8)
    seen = np.zeros(5, dtype=int)
    for _ in range(100):
        leg = random_leg(rng)
        feet = rng.uniform(-1.0, 1.0, (10, 2)) * leg.size
        low = rng.uniform(-8.0, 4.0, 2)
        limits = np.stack([low, low + rng.uniform(0.0, 5.0, 2)], axis=-1)
        every = kinematics.inverse_all(leg, feet)
        turns = every[..., None, :] + 2.0 * np.pi * np.arange(-2, 3)[:, None]
        within = (turns >= limits[:, 0]) & (turns <= limits[:, 1])
        fits = np.asarray(within.any(axis=-2).all(axis=-1))
        some = np.asarray(fits.any(axis=-1))
        for foot in feet[~some][:1]:
            seen[4] += 1
            with pytest.raises(UnreachableError) as info:
                kinematics.inverse_within(leg, [*feet[some], foot], limits)
            assert info.value.index == (some.sum(),)  # the last, and none before it
        first = np.argmax(fits[some], axis=-1)
        np.add.at(seen, first, 1)
        theta = kinematics.inverse_within(leg, feet[some], limits)
        assert ((theta >= limits[:, 0]) & (theta <= limits[:, 1])).all()
        chosen = every[some, first]
        np.testing.assert_allclose(wrap(theta - chosen), 0.0, rtol=0, atol=1e-14)
    assert seen.min() > 5


def test_published_limits_pick_the_knees_outwards_of_an_upright_leg() -> None:
    foot = [(0.0, 0.06), (0.02, 0.08), (0.05, 0.065)]
    theta = kinematics.inverse_within(FiveBar(), foot, PUBLISHED_LIMITS)
    np.testing.assert_array_equal(theta, kinematics.inverse(FiveBar(), foot, (1, -1)))
    low, high = np.array(PUBLISHED_LIMITS).T
    assert ((theta >= low) & (theta <= high)).all()


def published(leg: FiveBar, x: float, y: float, most: float) -> tuple[int, int]:
    """Return the whole degrees of the published controller, from A, upright, term by term.

    Its beta is at most 45 degrees; with more, both of a side's knees are within more often.
    """
    a = 2 * x * leg.L1
    b = 2 * y * leg.L1
    c = x * x + y * y + leg.L1**2 - leg.L2**2
    d = 2 * leg.L4 * (x - leg.L5)
    e = 2 * leg.L4 * y
    f = (x - leg.L5) ** 2 + leg.L4**2 + y * y - leg.L3**2
    alpha_1, alpha_2 = (
        2 * math.atan((b + s * math.sqrt(a * a + b * b - c * c)) / (a + c)) for s in (1, -1)
    )
    beta_1, beta_2 = (
        2 * math.atan((e + s * math.sqrt(d * d + e * e - f * f)) / (d + f)) for s in (1, -1)
    )
    alpha = alpha_1 if alpha_1 >= math.pi / 4 else alpha_2
    beta = beta_1 if 0 <= beta_1 <= most else beta_2
    return int(math.degrees(alpha)), int(math.degrees(beta))


@pytest.mark.parametrize(("most", "least"), [(math.pi / 4, 0), (math.pi, 50)])
def test_published_rule_is_that_of_its_controller(most: float, least: int) -> None:
    """alpha_1 where both roots are within, whole degrees by truncation; "modes" takes alpha_2."""
    leg = FiveBar()
    rng = np.random.default_rng(17)
    limits = (PUBLISHED_LIMITS[0], (0.0, most))
    feet = []
    modes = []
    for foot in rng.uniform((-0.06, 0.02), (0.06, 0.1), (300, 2)):
        with suppress(UnreachableError):
            modes.append(kinematics.inverse_within(leg, foot, limits))
            feet.append(foot)

    theta = kinematics.inverse_within(leg, feet, limits, rule="published")
    own = [published(leg, x + 0.5 * leg.L5, z, most) for x, z in np.array(feet).tolist()]
    np.testing.assert_allclose(np.degrees(theta), own, rtol=0, atol=1e-9)
    both = np.abs(modes - theta).max(axis=-1) > math.radians(1.0)
    assert both.sum() >= least  # points where the two rules take different knees


def test_truncation_goes_towards_zero_and_keeps_whole_degrees() -> None:
    limits = ((-7.0, 7.0), (-7.0, 7.0))
    foot = sample(RIGID, (200,))[0]
    theta = np.degrees(kinematics.inverse_within(RIGID, foot, limits, rule="published"))
    np.testing.assert_allclose(theta, np.rint(theta), rtol=0, atol=1e-9)
    # pi is 180 degrees, also where rounding leaves it a bit below; -106.3 becomes -106
    foot_of = kinematics.forward(RIGHT, np.array([-2.0 * math.atan2(4.0, 3.0), math.pi]))
    np.testing.assert_allclose(foot_of, (0.0, -0.04), atol=1e-15)
    at_pi = ((-4.0, -1.0), (3.0, 4.0))
    right = kinematics.inverse_within(RIGHT, (0.0, -0.04), at_pi, rule="published")
    np.testing.assert_allclose(np.degrees(right), (-106.0, 180.0), rtol=0, atol=1e-9)
    with pytest.raises(ArgumentError, match=r"^unknown rule 'first'; known: modes, published"):
        kinematics.inverse_within(RIGID, foot, limits, rule="first")  # pyright: ignore[reportArgumentType]


def test_limits_are_closed_and_kept_to_rounding_and_fewest_turns_are_taken() -> None:
    # angles (-2a or 0, pi or 2a - pi)
    foot = (0.0, -0.04)
    a = math.atan2(4.0, 3.0)
    for turn in (-2.0 * math.pi, 0.0, 4.0 * math.pi):
        limits = ((turn, turn), (turn + 3.0, turn + math.pi))
        theta = kinematics.inverse_within(RIGHT, foot, limits)
        np.testing.assert_allclose(theta, (turn, turn + math.pi), rtol=0, atol=1e-13)
    theta = kinematics.inverse_within(RIGHT, foot, WIDE)  # all modes: the first
    np.testing.assert_array_equal(theta, kinematics.inverse(RIGHT, foot, MODES[0]))
    assert theta[0] == pytest.approx(-2.0 * a)


def test_within_names_the_limit() -> None:
    foot = np.full((2, 2, 2), [0.0, -0.04])
    foot[1, 0] = (0.0, -0.06)
    angle = kinematics.inverse_all(RIGHT, foot[0, 0])
    A = (float(angle[0, 0]),) * 2
    E = (float(angle[0, 1]),) * 2
    for limits, side, unnamed in (((A, (-4.0, 4.0)), "A", "E"), (((-4.0, 4.0), E), "E", "A")):
        with pytest.raises(
            UnreachableError, match=rf"^1 of 4 .*theta_{side} must be in .*deg\), got .* or"
        ) as info:
            kinematics.inverse_within(RIGHT, foot, limits)
        assert info.value.index == (1, 0)
        assert f"theta_{unnamed}" not in str(info.value)
    every = kinematics.inverse_all(RIGID, sample(RIGID, ())[0])
    apart = [(x - 1e-3, x + 1e-3) for x in (every[0, 0], every[2, 1])]
    with pytest.raises(
        UnreachableError, match=r"^the point .*theta_A .* and theta_E .* in one mode"
    ):
        kinematics.inverse_within(RIGID, sample(RIGID, ())[0], apart)


def test_within_refuses_what_no_mode_reaches_and_only_that() -> None:
    with pytest.raises(UnreachableError, match=r"^2 of 6 .*\|AF\|") as info:
        kinematics.inverse_within(RIGHT, FAR, WIDE)
    assert info.value.index == (1, 0)
    foot = np.random.default_rng(9).uniform(-0.15, 0.15, (1000, 2))
    found = np.isfinite(kinematics.inverse_all(RIGID, foot)[..., 0])
    some = found.any(axis=-1)
    own = found[:, MODES.index(RIGID.mode)]
    others = foot[some & ~own]  # with L6 > 0 reach depends on the mode
    kinematics.inverse_within(RIGID, others, WIDE)
    mixed = np.concatenate([others, foot[~some]])
    with pytest.raises(UnreachableError, match=rf"^{(~some).sum()} of ") as info:
        kinematics.inverse_within(RIGID, mixed, WIDE)
    assert info.value.index == (len(others),)
    assert len(others) > 1


def test_limits_are_refused() -> None:
    some = (0.0, 1.0)
    bad: list[Any] = [some, (some,), ((1.0, 0.0), some), ((0.0, np.nan), some), "ab"]
    for limits in bad:
        with pytest.raises(ArgumentError, match="limits must"):
            kinematics.inverse_within(RIGHT, (0.0, -0.04), limits)
