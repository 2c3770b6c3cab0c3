"""The nearest points of `conformance/`: right answers, and the names of faults."""

from __future__ import annotations

import itertools
import math
from types import ModuleType
from typing import Any

import numpy as np

from fivebar_sim.certify import judge, suite
from fivebar_sim.certify.suite import Case, Leg

LEGS = suite.load()


def edge(right: ModuleType, leg: Any) -> np.ndarray:
    """Return feet all along the edge of reach, where a side chain is in line."""
    A, E = right.motors(leg)
    stretch = right.stretch(leg)
    rays = np.exp(1j * np.linspace(-math.pi, math.pi, 400)).tolist()
    feet = []
    for R, ray in itertools.product((leg.L4 + leg.L3, abs(leg.L4 - leg.L3)), rays):
        C = E + R * ray
        knees = [right.meet(A, leg.L1, C, leg.L2, side) for side in (-1.0, 1.0)]
        feet += [B + (C - B) * stretch for B in knees if B is not None]
    for sign, ray in itertools.product((-1.0, 1.0), rays):
        C = A + leg.L1 * ray + sign * leg.L2 * ray * abs(stretch) / stretch
        if abs(leg.L4 - leg.L3) <= abs(C - E) <= leg.L4 + leg.L3:
            feet.append(A + (leg.L1 + sign * leg.L2 * abs(stretch)) * ray)
    return np.array(feet)


def test_nearest_answers_are_in_reach_and_nothing_is_nearer(right: ModuleType) -> None:
    """By the circles of leg_programs/right.py, which knows no coupler curve."""
    modes = list(itertools.product((-1.0, 1.0), repeat=2))
    around = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)).tolist()
    for leg in LEGS:
        numbers = right.Leg(*map(float.fromhex, leg.numbers))
        size = judge.geometry_of(leg).size

        def reached(z: complex, leg: Any = numbers) -> bool:
            found = [right.inverse(leg, [*mode, z.real, z.imag]) for mode in modes]
            return any(each is not None for each in found)

        feet = edge(right, numbers)
        for case in (case for case in leg.cases if case.kind == "nearest" and case.answer):
            p = complex(*map(float.fromhex, case.inputs))
            c = complex(*case.answer)
            gap = abs(c - p)
            if gap == 0.0:
                assert reached(p), case
                continue
            # On the edge rounding decides, and the reach may end there in a corner.
            assert any(reached(c + 1e-6 * size * ray) for ray in around), case
            assert np.abs(feet - p).min() >= gap - max(1e-12 * size, 1e-15 * gap), case


def test_faults_of_nearest_points_have_names() -> None:
    leg = next(leg for leg in LEGS if leg.name == "minitaur")
    case = next(case for case in leg.cases if case.kind == "nearest" and moved(case) > 0.1)
    x, z = case.answer
    size = judge.geometry_of(leg).size
    assert fault(leg, case, [x, z]) is None
    assert fault(leg, case, [*map(float.fromhex, case.inputs)]) == "the point itself, out of reach"
    assert fault(leg, case, [x, -z]) == "z downwards"
    assert fault(leg, case, [x + 1e-5 * size, z], "float32") == "imprecise"
    assert fault(leg, case, [0.0, 0.0]) == "wrong"


def moved(case: Case) -> float:
    """Return how far the answer is from the point asked for [m]."""
    return math.dist([*map(float.fromhex, case.inputs)], case.answer)


def fault(leg: Leg, case: Case, numbers: list[float], precision: str = "float64") -> str | None:
    """Return the kind of fault in an answer of some numbers, or None."""
    line = " ".join(["ok", *map(float.hex, numbers)])
    found = judge.look(judge.geometry_of(leg), case, precision, line)
    return None if found is None else found.kind
