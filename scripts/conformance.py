"""./.venv/bin/python scripts/conformance.py: writes conformance/*.txt anew.

Every input is a float32, so that a program of either precision is asked the very same question.
The answers are those of `fivebar_sim.kinematics`; equal machines give equal bytes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array
from fivebar_sim.certify import exact, suite
from fivebar_sim.errors import FiveBarError
from fivebar_sim.files import resources
from fivebar_sim.geometry import MODES, FiveBar, Mode
from fivebar_sim.kinematics.reach import foot_radius_and_angle

OUT = Path(__file__).resolve().parent.parent / suite.FOLDER

U = 2.0**-7
"""Unit of the legs whose edges are exact in binary [m]."""

TRAPS = {
    "unequal": FiveBar(L1=0.031, L2=0.067, L3=0.058, L4=0.044, L5=0.027, tilt=-0.4),
    "turned": FiveBar(L1=0.04, L2=0.07, L3=0.05, L4=0.045, L5=0.03, L6=0.04, bend=-2.2, tilt=2.6),
    "exact": FiveBar(L1=5 * U, L2=5 * U, L3=8 * U, L4=3 * U, L5=4 * U),
    "flat": FiveBar(L1=2 * U, L2=5 * U, L3=5 * U, L4=2 * U, L5=10 * U),
    "coaxial": FiveBar(L1=4 * U, L2=7 * U, L3=7 * U, L4=4 * U, L5=0.0),
}
"""Legs that are made for the traps; the shipped presets come with them."""

HEAD = """\
# Conformance of a five-bar leg, format 1: docs/conformance.md. Written by scripts/conformance.py.
#
#   leg NAME L1 L2 L3 L4 L5 L6 [m] bend tilt [rad]
#   TRAP inverse s_A s_E x z = ok theta_A theta_E within FLOAT32 FLOAT64
#   TRAP forward assembly theta_A theta_E = ok x z ...
#   TRAP knees assembly theta_A theta_E = ok B_x B_z D_x D_z ...
#   TRAP jacobian assembly theta_A theta_E = ok dx/dA dx/dE dz/dA dz/dE ...
#   TRAP torque assembly theta_A theta_E F_x F_z = ok tau_A tau_E ...
#   TRAP nearest x z = ok x z ...
"""


def drawn(seed: int) -> np.random.Generator:
    """Return the random numbers of a leg."""
    return np.random.default_rng(seed)


def single(values: Array | float) -> Array:
    """Return numbers rounded to float32."""
    return np.asarray(values, dtype=np.float32).astype(float)


def legs() -> dict[str, FiveBar]:
    """Return the legs, every length a float32."""
    named = {name: FiveBar.load(name) for name in resources.shipped("models/legs")} | TRAPS
    rounded = {}
    for name, leg in named.items():
        numbers: dict[str, Any] = {k: float(single(getattr(leg, k))) for k in exact.KEYS}
        rounded[name] = FiveBar(**numbers, mode=leg.mode, assembly=leg.assembly, scale="any")
    return rounded


def points(leg: FiveBar, rng: np.random.Generator) -> Iterator[tuple[str, Array]]:
    """Yield foot positions with the name of their trap."""
    A, E = kinematics.bases(leg)
    rho, _ = foot_radius_and_angle(leg)
    reach = 1.1 * leg.size
    for foot in rng.uniform(-reach, reach, (24, 2)):
        yield "anywhere", foot

    for angle in rng.uniform(-np.pi, np.pi, 3):
        e = np.array([np.cos(angle), np.sin(angle)])
        for name, centre, near, far in (("A", A, leg.L1, rho), ("E", E, leg.L4, leg.L3)):
            yield f"edge-{name}", centre + (near + far) * e
            yield f"near-edge-{name}", centre + (near + far) * (1.0 - 1e-4) * e
            yield f"beyond-{name}", centre + (near + far) * (1.0 + 1e-3) * e
            yield f"fold-{name}", centre + abs(near - far) * e
            yield f"near-fold-{name}", centre + (abs(near - far) + 1e-4 * leg.size) * e

    # The knee points straight to the left: theta is half a turn, whose sign must not flip.
    for side, near, far in ((A, leg.L1, rho), (E, leg.L4, leg.L3)):
        for angle in (-1.2, -1.9, 1.4):
            yield "half-turn", side - [near, 0.0] + far * np.array([np.cos(angle), np.sin(angle)])

    yield "on-A", A
    yield "on-E", E
    yield "far", np.array([1e3, -1e3])
    yield "overflow", np.array([3e38, 3e38])
    yield "nan", np.array([np.nan, -leg.L2])
    yield "infinite", np.array([0.0, -np.inf])


def exact_points(name: str) -> Iterator[tuple[str, Array]]:
    """Yield positions at the very edge that binary numbers hold exactly: no refusal is right."""
    if name == "exact":
        # A = (-2, 0) U: full stretch along +-x and z; half a turn by the triangle 3, 4, 5.
        for foot in ((8.0, 0.0), (-2.0, -10.0), (-2.0, 10.0), (-4.0, -4.0), (-10.0, -4.0)):
            yield "exact-edge", U * np.array(foot)
    if name == "flat":
        for foot in ((2.0, 0.0), (-2.0, 0.0), (0.0, 0.0)):
            yield "exact-edge", U * np.array(foot)
    if name == "coaxial":
        for foot in ((11.0, 0.0), (0.0, -11.0), (-11.0, 0.0), (3.0, 0.0), (0.0, -3.0), (0.0, 3.0)):
            yield "exact-edge", U * np.array(foot)


def around(leg: FiveBar, rng: np.random.Generator) -> Iterator[tuple[str, Array]]:
    """Yield points, most of them out of reach, with the name of their trap."""
    A, E = kinematics.bases(leg)
    for foot in rng.uniform(-1.5, 1.5, (12, 2)) * leg.size:
        yield "anywhere", foot
    for foot in rng.uniform(-0.4, 0.4, (8, 2)) * leg.size:
        yield "inside", foot
    yield "on-A", A
    yield "on-E", E
    yield "far", np.array([1e3, -1e3])
    yield "nan", np.array([np.nan, -leg.L2])
    yield "infinite", np.array([0.0, -np.inf])


def angles(leg: FiveBar, rng: np.random.Generator) -> Iterator[tuple[str, Array]]:
    """Yield motor angles with the name of their trap."""
    for theta in rng.uniform(-np.pi, np.pi, (12, 2)):
        yield "anywhere", theta
    for theta in rng.uniform(-4.0 * np.pi, 4.0 * np.pi, (4, 2)):
        yield "turns", theta
    for theta in ((0.0, 0.0), (np.pi, 0.0), (-np.pi, np.pi), (-np.pi / 2, -np.pi / 2)):
        yield "axis", np.array(theta)
    yield "nan", np.array([np.nan, 0.0])


def written(values: Array | Sequence[float]) -> list[str]:
    """Return numbers as hex floats, without the zeros at the end."""
    return [re.sub(r"\.?0+p", "p", float(value).hex()) for value in values]


def line(leg: FiveBar, trap: str, kind: str, signs: tuple[int, ...], values: Array) -> str | None:
    """Return a case as a line; None where rounding alone decides what is right."""
    found = exact.answer(leg, kind, [*signs, *values])
    words = [trap, kind, *map(str, signs), *written(values), "="]
    if not found.numbers:
        return " ".join([*words, "refused"])
    # An angle that is any angle by rounding asks nothing.
    if found.within[0] > 0.1 * max(1e-3, max(map(abs, found.numbers))):
        return None

    tolerances = [f"{value:.2g}" for value in found.within]
    words += [suite.OK, *written(found.numbers), "within", *tolerances]
    if found.may_refuse and trap != "exact-edge":
        words += ["or", "refused"]
    return " ".join(words)


def cases(name: str, leg: FiveBar, rng: np.random.Generator) -> Iterator[str | None]:
    """Yield the lines of a leg."""
    for trap, foot in [*points(leg, rng), *exact_points(name)]:
        # What no mode reaches is asked in one of them.
        one = trap.startswith(("beyond", "far", "overflow", "nan", "infinite"))
        for mode in [leg.mode] if one else MODES:
            yield line(leg, trap, "inverse", mode, single(foot))

    poses = list(angles(leg, rng))
    # Poses that close, as the foot's positions give them, in their own assembly mode.
    for foot in rng.uniform(-leg.size, leg.size, (30, 2)):
        poses += [("closed", theta) for theta in _closed(leg, foot, leg.mode)]
    for trap, theta in poses:
        for assembly in (-1, 1):
            yield from _pose(leg, trap, assembly, single(theta), rng)
    for trap, foot in around(leg, rng):
        yield line(leg, trap, "nearest", (), single(foot))


def _pose(
    leg: FiveBar, trap: str, assembly: int, theta: Array, rng: np.random.Generator
) -> Iterator[str | None]:
    """Yield the questions about one pose."""
    force = single(rng.uniform(-10.0, 10.0, 2))
    yield line(leg, trap, "forward", (assembly,), theta)
    yield line(leg, trap, "jacobian", (assembly,), theta)
    yield line(leg, trap, "torque", (assembly,), np.concatenate([theta, force]))
    if assembly == leg.assembly:
        yield line(leg, trap, "knees", (assembly,), theta)


def _closed(leg: FiveBar, foot: Array, mode: Mode) -> list[Array]:
    """Return the angles that put the foot somewhere, if it reaches."""
    try:
        return [kinematics.inverse(leg, foot, mode)]
    except FiveBarError:
        return []


if __name__ == "__main__":
    OUT.mkdir(exist_ok=True)
    for seed, (name, leg) in enumerate(sorted(legs().items())):
        lines = [HEAD + " ".join(["leg", name, *written([getattr(leg, k) for k in exact.KEYS])])]
        lines += [one for one in cases(name, leg, drawn(seed)) if one is not None]
        path = OUT / f"{name}.txt"
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        print(f"wrote {path.name}: {len(lines) - 1} cases, {path.stat().st_size / 1e3:.0f} kB")
