"""Certificates: what they promise holds at every point, and a dip between samples is refused."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from fivebar_sim import FiveBar, design, kinematics
from fivebar_sim.analysis import quality, singularity
from fivebar_sim.arrays import Array
from fivebar_sim.design.certificate import interval, stretches
from fivebar_sim.design.certificate.bounds import bounds, end_cosine
from fivebar_sim.design.certificate.certify import certify, certify_motion, certify_region
from fivebar_sim.design.certificate.interval import Interval
from fivebar_sim.design.task.motions import Box, FootMotion, HalfDisc
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

LEGS = [
    FiveBar.load("classic"),
    FiveBar.load("extended"),
    FiveBar.load("doggo"),
    FiveBar(L1=0.03, L2=0.05, L3=0.06, L4=0.045, L5=0.02, L6=0.02, bend=-0.4, tilt=0.3),
]


def test_operations_hold_the_exact_result(rng: np.random.Generator) -> None:
    low = rng.normal(size=(2, 200))
    width = rng.random((2, 200)) * 10.0 ** rng.integers(-16, 1, (2, 200))
    a, b = (Interval(low[k], low[k] + width[k]) for k in (0, 1))
    # The ends themselves, where rounding counts most.
    x = np.where(rng.random(200) < 0.5, a.low, a.high)
    y = np.where(rng.random(200) < 0.5, b.low, b.high)
    for op, got in (
        (lambda p, q: p + q, a + b),
        (lambda p, q: p - q, a - b),
        (lambda p, q: p * q, a * b),
        (lambda p, q: p / q, a / b),
    ):
        for k in range(200):
            exact = op(Fraction(float(x[k])), Fraction(float(y[k])))
            if math.isfinite(got.low[k]) and math.isfinite(got.high[k]):
                assert Fraction(float(got.low[k])) <= exact <= Fraction(float(got.high[k]))
            else:
                assert b.low[k] <= 0.0 <= b.high[k]


@pytest.mark.parametrize("name", ["sine", "cosine", "square", "root", "arccosine"])
def test_functions_hold_all_between(rng: np.random.Generator, name: str) -> None:
    exact = {"sine": np.sin, "cosine": np.cos, "square": np.square, "root": np.sqrt}
    wide = rng.random(300) * 4.0 * 10.0 ** rng.integers(-6, 1, 300)
    low = 8.0 * (rng.random(300) - 0.5)
    if name == "root":
        low = np.abs(low)
    if name == "arccosine":
        low = low / 4.0
    x = Interval(low, low + wide)
    got = getattr(interval, name)(x)
    for share in np.linspace(0.0, 1.0, 21):
        at = low + share * wide
        at = np.clip(at, -1.0, 1.0) if name == "arccosine" else at
        value = exact.get(name, np.arccos)(at.astype(np.longdouble))
        assert np.all((got.low <= value) & (value <= got.high))
    # Not by saying nothing: of what is a point it knows all digits.
    thin = getattr(interval, name)(Interval(low, low))
    assert np.all(thin.high - thin.low < 1e-13)


def truth(leg: FiveBar, foot: Array) -> tuple[Array, Array, Array]:
    """Return slack, least sine and condition number at points, by the functions for one leg."""
    theta = kinematics.inverse(leg, foot)
    p = kinematics.closed_points(leg, theta)
    A, E = kinematics.bases(leg)
    rho = math.hypot(*leg.foot_offset)
    slacks = []
    # The pose of the mode, in whichever assembly it is.
    for at, d, near, far in ((A, foot, leg.L1, rho), (E, _C(leg, foot, theta), leg.L4, leg.L3)):
        r = np.hypot(*(d - at).T)
        hole = abs(near - far)
        slacks.append(np.minimum(r - hole if hole > 0.0 else np.inf, near + far - r))
    d = np.stack(singularity.distances_at(leg, foot))
    signed = d * np.array([[leg.mode[0]], [leg.mode[1]], [leg.assembly]])
    sine = (signed / np.array(singularity.shorter_links(leg))[:, None]).min(axis=0)
    own = np.hypot(*(p.F - foot).T) < 1e-9
    condition = np.where(own, quality.condition(leg, theta), np.nan)
    return np.minimum(*slacks), sine, condition


def _C(leg: FiveBar, foot: Array, theta: Array) -> Array:
    A, _ = kinematics.bases(leg)
    B = A + leg.L1 * np.stack([np.cos(theta[:, 0]), np.sin(theta[:, 0])], axis=-1)
    along, across = leg.foot_offset
    turn = (foot - B) @ np.array([[along, -across], [across, along]]) / math.hypot(along, across)
    return B + leg.L2 * turn / math.hypot(along, across)


@pytest.mark.parametrize("leg", LEGS, ids=lambda leg: leg.name + str(leg.L6))
def test_bounds_hold_in_every_box(rng: np.random.Generator, leg: FiveBar) -> None:
    rest = kinematics.chain_points(leg, kinematics.home(leg)).F
    low = rest + 0.5 * leg.size * (rng.random((400, 2)) - 0.5)
    size = leg.size * 10.0 ** rng.uniform(-4.0, -1.0, (400, 1))
    high = low + size * rng.random((400, 2))
    with np.errstate(all="ignore"):
        sure = bounds(leg, low, high)
    for _ in range(8):
        foot = low + (high - low) * rng.random(low.shape)
        reached = ~np.isnan(kinematics.inverse_all(leg, foot)).any(axis=(1, 2))
        # Where the foot is out of reach no slack was promised.
        assert np.all(reached | (sure.reach <= 0.0))
        slack, sine, condition = truth(leg, foot[reached])
        assert np.all(sure.reach[reached] <= slack + 1e-15)
        assert np.all(sure.singular[reached] <= sine + 1e-12)
        known = ~np.isnan(condition)
        assert np.all(sure.condition[reached][known] >= condition[known] * (1.0 - 1e-9))
    assert np.mean(np.isfinite(sure.condition)) > 0.2
    assert np.mean(sure.reach > 0.0) > 0.2


def test_cosine_at_the_far_end_is_least_within(rng: np.random.Generator) -> None:
    """Where the far link is the longer one its angle is widest at some distance, not at an end."""
    near = rng.uniform(0.02, 0.05, 200)
    far = near * rng.uniform(0.8, 2.0, 200)
    turn = np.sqrt(np.maximum(far**2 - near**2, 0.0))
    low = np.maximum(turn * rng.uniform(0.8, 1.02, 200), np.abs(near - far))
    high = np.minimum(np.maximum(turn * rng.uniform(1.0, 1.3, 200), 1.01 * low), near + far)
    got = end_cosine(Interval(low, high), Interval.of(near), Interval.of(far))
    for share in np.linspace(0.0, 1.0, 41):
        d = (low + share * (high - low)).astype(np.longdouble)
        cosine = (d**2 + np.longdouble(far) ** 2 - np.longdouble(near) ** 2) / (2.0 * d * far)
        # At the very edge of reach the distance was rounded, and the angle may not exist.
        cosine = np.clip(cosine, -1.0, 1.0)
        assert np.all((got.low <= cosine) & (cosine <= got.high))
    assert np.sum((low < turn) & (turn < high)) > 50


def kinds(folder: Path) -> list[FootPath]:
    csv = folder / "path.csv"
    rows = [f"{0.1 * k},{10 * math.cos(k):.3f},{-80 + 5 * math.sin(2 * k):.3f}" for k in range(9)]
    csv.write_text("\n".join(["time_s,x_mm,z_mm", *rows]), encoding="utf-8")
    at = {"centre": (0.01, -0.08), "frequency": 2.0}
    return [
        Circle(radius=0.01, **at),
        Ellipse(radii=(0.02, 0.008), **at),
        FigureEight(radii=(0.01, 0.008), **at),
        Gait(stride=0.04, lift=0.015, duty=0.6, touchdown=0.05, **at),
        Gait(stride=-0.03, lift=0.01, duty=0.4, running=True, **at),
        Sine(stride=0.04, lift=0.01, push=0.004, duty=0.4, **at),
        Hop(low=0.07, high=0.085, thrust=0.3, flight=0.3, tuck=0.005, frequency=2.0),
        Line(start=(-0.01, -0.07), stop=(0.01, -0.08), frequency=1.0),
        Lines(points=((0.0, -0.08), (0.01, -0.07), (0.0, -0.07)), seconds=(0.5, 0.25)),
        Step(start=(-0.01, -0.08), stop=(0.01, -0.08), lift=0.01, seconds=0.4),
        Csv(file=str(csv), ramp=0.1),
        Csv(file=str(csv), ramp=0.1, periodic=True),
    ]


@pytest.mark.parametrize("k", range(12))
def test_boxes_hold_the_path(tmp_path: Path, k: int) -> None:
    path = kinds(tmp_path)[k]
    pieces = stretches.pieces(path)
    whole = path.period if path.period is not None else min(path.moves, path.span)
    assert pieces[0].start == 0.0
    assert pieces[-1].stop == pytest.approx(whole)
    for piece in pieces:
        ends = np.linspace(piece.start, piece.stop, 5)
        steepest = np.tile(piece.steepest, (4, 1))
        low, high = stretches.boxes(path, ends[:-1], ends[1:], steepest)
        share = np.linspace(0.0, 1.0, 60)[:, None]
        at = path.nominal(ends[:-1] + share * np.diff(ends)).position
        assert np.all((low <= at) & (at <= high))
        # Half the bulge is too little for some: the bound is no larger than it must be by far.
        inner = path.nominal(ends[0] + np.linspace(0.01, 0.99, 99) * (ends[-1] - ends[0]))
        most = np.abs(inner.acceleration).max(axis=0)
        assert np.all(
            piece.steepest <= 4.0 * most + 2.0 * 9.81 * getattr(path, "running", 0) + 1e-6
        )


def test_path_of_another_kind_cannot_be_certified() -> None:
    class Mine(FootPath, frozen=True, tag="mine"):
        pass

    with pytest.raises(ArgumentError, match='kind "mine" cannot be certified; these can: circle'):
        stretches.pieces(Mine())


@pytest.mark.parametrize("leg", LEGS[:2], ids=lambda leg: leg.name)
def test_truth_lies_between_what_is_certain_and_what_was_found(leg: FiveBar) -> None:
    centre = (0.0, -0.08) if leg.name == "classic" else (0.02, -0.09)
    path = Ellipse(centre=centre, radii=(0.012, 0.006), frequency=1.0)
    got = certify_motion(leg, FootMotion("walk", path))
    foot = path.nominal(np.linspace(0.0, 1.0, 1000)).position
    region = HalfDisc(centre=centre, radius=0.004, side="down")
    for each, points in (
        (got, foot),
        (certify_region(leg, region, "work"), region.points(1000)),
    ):
        slack, sine, condition = truth(leg, points)
        assert each.reach <= slack.min() <= each.found[0] + 1e-4
        assert each.singular <= sine.min() <= each.found[1] + 2e-3
        assert each.found[2] * 0.998 <= condition.max() <= each.condition
        # It gives away no more than it says.
        assert each.reach >= each.found[0] - 1.1e-3 * leg.size
        assert each.singular >= each.found[1] - 1.1e-3
        assert each.condition <= each.found[2] * 1.0011


def test_region_with_a_singular_curve_is_not_certified() -> None:
    leg = FiveBar.load("classic")
    got = certify_region(leg, Box(low=(-0.03, -0.04), high=(0.03, 0.02)), "across")
    assert got.singular <= 0.0
    assert got.condition == math.inf


DIP = """
samples = 4
leg = "classic"
objectives = ["torque_peak"]
vary.leg.L1 = [0.03, 0.05]

[motion.swing.path]
kind = "ellipse"
centre = [0.0, -0.078]
radii = [0.002, 0.012]
frequency = 1.0
ramp = 0.0

[constraints]
reach = {reach}
"""


def test_dip_between_samples_is_refused(tmp_path: Path) -> None:
    """The samples are at 45 deg and so on: none is at the lowest point, which is the farthest."""
    path = tmp_path / "task.toml"
    path.write_text(DIP.format(reach=0.0), encoding="utf-8")
    task = design.load(path)
    row = np.array([0.04])
    at_samples = design.evaluate(task, row[None]).measures[0, 1]
    (sure,) = certify(task, row)
    assert sure.refusal(task.constraints) == ""
    assert sure.found[0] < at_samples - 1e-3

    path.write_text(DIP.format(reach=0.5 * (at_samples + sure.found[0])), encoding="utf-8")
    task = design.load(path)
    assert design.evaluate(task, row[None]).feasible.all()
    (sure,) = certify(task, row)
    assert sure.refusal(task.constraints).startswith("motion.swing: reach is certain to 0.0")
