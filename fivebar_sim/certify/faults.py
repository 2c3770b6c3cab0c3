"""What is wrong with an answer: the kind of the fault, in the words of who has to mend it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fivebar_sim.certify import exact
from fivebar_sim.certify.suite import Case
from fivebar_sim.geometry import MODES, FiveBar

TURN = 2.0 * math.pi

NEAR = 2e-3
"""How near [rad, or relative] an answer has to be to a known wrong one to be called that."""

HALF_STEP = 0.5
"""Rounding of whole degrees [deg]."""

IMPRECISE = 1e-2
"""Up to this much [rad, or relative] an answer is called imprecise; beyond it, wrong."""

NAMES = {
    "inverse": ("theta_A", "theta_E"),
    "forward": ("x", "z"),
    "knees": ("B_x", "B_z", "D_x", "D_z"),
    "jacobian": ("dx/dA", "dx/dE", "dz/dA", "dz/dE"),
    "torque": ("tau_A", "tau_E"),
    "nearest": ("x", "z"),
}
"""The numbers of an answer."""


class Fault(NamedTuple):
    """What is wrong with an answer.

    Attributes:
        kind: The kind, as a phrase.
        case: The question.
        got: The line that came.
        name: The number that is off most, or "".
        expected: What it should be.
        came: What it is.
        own: The firmware's own answer, where its bits are what is wrong.
    """

    kind: str
    case: Case
    got: str
    name: str = ""
    expected: float = 0.0
    came: float = 0.0
    own: str = ""


def not_refused(case: Case, numbers: tuple[float, ...]) -> str:
    """Return the kind of an answer that should have been a refusal."""
    what = {
        "inverse": "out of reach",
        "jacobian": "singular or open",
        "torque": "singular or open",
        "nearest": "not finite",
    }
    where = what.get(case.kind, "loop open")
    if any(map(math.isnan, numbers)):
        return f"{where}: not refused, answered NaN"
    # One side may be out of reach and the other not.
    if 0.0 in numbers:
        return f"{where}: not refused, answered 0"
    return f"{where}: not refused"


def difference(case: Case, precision: str, numbers: tuple[float, ...]) -> tuple[int, float]:
    """Return which number is off most, and by how much beyond its tolerance; <= 0 is right.

    Angles that differ by whole turns are equal here; `whole_turn` looks at that.
    """
    for k, number in enumerate(numbers):
        if not math.isfinite(number):
            return k, math.inf

    within = case.within[1] if precision == "float64" else case.within[0]
    expected = case.answer
    turn = TURN
    if case.kind == "inverse" and precision == "degrees":
        turn = 360.0
        expected = tuple(map(math.degrees, expected))
        within = HALF_STEP + math.degrees(within)

    # Plain floats: of two to four numbers each, NumPy would take ten times as long.
    off = [abs(a - b) for a, b in zip(numbers, expected, strict=True)]
    if case.kind == "inverse":
        off = [abs((each + 0.5 * turn) % turn - 0.5 * turn) for each in off]
    worst = off.index(max(off))
    return worst, off[worst] - within


def whole_turn(case: Case, precision: str, numbers: tuple[float, ...]) -> bool:
    """Return whether an angle is outside of half a turn to either side."""
    if case.kind != "inverse":
        return False
    within = case.within[1] if precision == "float64" else case.within[0]
    half = 180.0 + HALF_STEP if precision == "degrees" else math.pi
    return max(map(abs, numbers)) > half + within


def kind(leg: FiveBar, case: Case, precision: str, numbers: tuple[float, ...]) -> str:
    """Return the kind of a fault in numbers that are wrong."""
    if not all(map(math.isfinite, numbers)):
        return "NaN" if any(map(math.isnan, numbers)) else "infinite"
    if case.kind == "inverse":
        return _angles_kind(leg, case, precision, numbers)

    got = np.array(numbers)
    expected = np.array(case.answer)
    scale = float(np.abs(expected).max())
    for name, other in _vectors(case, expected):
        if np.abs(got - other).max() <= NEAR * float(np.abs(other).max()):
            return name
    return "imprecise" if np.abs(got - expected).max() <= IMPRECISE * scale else "wrong"


def _vectors(case: Case, expected: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the known ways in which points, Jacobians and torques go wrong."""
    if case.kind == "nearest":
        yield "the point itself, out of reach", np.array([*map(float.fromhex, case.inputs)])
    if not np.any(expected):
        return
    yield "wrong sign", -expected
    yield "millimetres", 1000.0 * expected

    if case.kind == "jacobian":
        yield "transposed", expected[[0, 2, 1, 3]]
        yield "A and E exchanged", expected[[1, 0, 3, 2]]
    if case.kind == "torque":
        yield "A and E exchanged", expected[::-1]
    if case.kind == "knees":
        yield "A and E exchanged", expected[[2, 3, 0, 1]]
    if case.kind in ("forward", "knees", "nearest"):
        flipped = expected.copy()
        flipped[1::2] *= -1.0
        yield "z downwards", flipped


def _angles_kind(leg: FiveBar, case: Case, precision: str, got: Sequence[float]) -> str:
    expected = case.answer
    if precision == "degrees":
        degrees = list(map(math.degrees, expected))
        cut = (list(map(math.trunc, degrees)), list(map(math.floor, degrees)))
        if list(got) in cut:
            return "truncated, not rounded"
        got = list(map(math.radians, got))

    # An exact hit first: near full stretch the branches lie close together.
    exactly = math.radians(HALF_STEP) if precision == "degrees" else 0.0
    exactly += case.within[1] if precision == "float64" else case.within[0]
    loosely = max(NEAR, exactly)
    known = []
    for name, other in _known(leg, case, expected):
        if _apart(got, other) <= exactly:
            return name
        known.append((name, other))
    if case.may_refuse and 0.0 in got:
        return "on the edge: answered 0"
    if _apart(got, expected) <= loosely:
        return "a whole turn off" if max(map(abs, got)) > math.pi else "imprecise"
    for name, other in known:
        if _apart(got, other) <= loosely:
            return name
    # Degrees are compared without whole turns: 2 pi deg is nothing special.
    off = [abs(math.radians(a) - b) for a, b in zip(got, expected, strict=True)]
    if max(off) <= NEAR:
        return "degrees"
    return "imprecise" if _apart(got, expected) <= IMPRECISE else "wrong"


def _known(
    leg: FiveBar, case: Case, expected: Sequence[float]
) -> Iterator[tuple[str, Sequence[float]]]:
    """Yield the known ways in which angles go wrong."""
    values = [float.fromhex(word) for word in case.inputs[2:]]
    asked = (int(case.inputs[0]), int(case.inputs[1]))
    for mode in MODES:
        if mode != asked:
            found = exact.answer(leg, "inverse", [*mode, *values])
            sides = [side for side, a, b in zip("AE", asked, mode, strict=True) if a != b]
            if found.numbers:
                yield f"wrong branch of {' and '.join(sides)}", found.numbers

    yield "wrong sign", [-theta for theta in expected]
    yield "A and E exchanged", expected[::-1]
    yield "tilt left out", [theta - leg.tilt for theta in expected]
    yield "90 deg + angle, as a servo's", [theta + 0.5 * math.pi for theta in expected]


def _apart(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the larger difference of two pairs of angles, whole turns aside [rad]."""
    turned = [(a - b + math.pi) % TURN - math.pi for a, b in zip(one, other, strict=True)]
    return max(map(abs, turned))
