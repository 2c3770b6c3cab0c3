"""What the leg programs of the tests share: they read questions and write answers, a line each."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import NamedTuple


class Leg(NamedTuple):
    """A leg: lengths [m] and angles [rad]."""

    L1: float
    L2: float
    L3: float
    L4: float
    L5: float
    L6: float
    bend: float
    tilt: float


Numbers = list[float]
Solver = Callable[[Leg, Numbers], Numbers | None]
"""Returns the numbers that answer a question, or None where there are none."""


def speak(precision: str, solvers: dict[str, Solver], *, plain: bool = False) -> None:
    """Answer all questions; what has no solver is not supported, and neither, if plain, is L6."""
    leg: Leg | None = None
    for line in sys.stdin:
        kind, *words = line.split()
        if kind == "fivebar":
            said = precision
        elif kind == "leg":
            leg = Leg(*map(float.fromhex, words))
            said = "unsupported" if plain and leg.L6 > 0.0 else "ok"
        elif kind not in solvers or leg is None:
            said = "unsupported"
        else:
            said = answer(solvers[kind], leg, [float.fromhex(word) for word in words])
        sys.stdout.write(said + "\n")


def answer(solver: Solver, leg: Leg, numbers: Numbers) -> str:
    """Return the line that answers a question."""
    found = solver(leg, numbers) if all(map(math.isfinite, numbers)) else None
    return "refused" if found is None else " ".join(["ok", *map(float.hex, found)])
