"""The exported leg as C: the definition of FIVEBAR_LEG."""

from __future__ import annotations

from typing import Any

import numpy as np

from fivebar_sim.firmware.elementary import Real
from fivebar_sim.firmware.leg import LENGTHS, Chain, Leg, of
from fivebar_sim.geometry import FiveBar

HEADING = "/* ---- The exported leg"
"""How the last part of the source begins, which an export replaces."""


def with_leg(source: str, leg: FiveBar) -> str:
    """Return the C source with the definition of a leg in place of the one that it has.

    Raises:
        GeometryError: The firmware's arithmetic cannot hold the leg.
    """
    return source[: source.index(HEADING)] + definition(leg)


def definition(leg: FiveBar) -> str:
    """Return FIVEBAR_LEG in C, in both arithmetics."""
    # Printable names may still have what ends a comment, or letters that a compiler refuses.
    name = leg.name.encode("ascii", "backslashreplace").decode().replace("*/", "* /")
    heading = f"{HEADING}: {name} "
    return (
        f"{heading:-<94} */\n\n"
        f"const fivebar_leg FIVEBAR_LEG = {{\n"
        f"#ifdef FIVEBAR_DOUBLE\n{_fields(of(leg, np.float64))}"
        f"#else\n{_fields(of(leg, np.float32))}"
        f"#endif\n}};\n"
    )


def number(value: Any) -> str:
    """Return a number as a C constant of its own type that reads back as the same bits."""
    # The shortest digits that tell it from its neighbours; whole numbers have a point, too.
    digits = str(np.asarray(value)[()])
    return f"{digits}f" if np.asarray(value).dtype == np.float32 else digits


def _fields(leg: Leg) -> str:
    """Return the initialisers of a leg, a line for each part of the struct."""
    lengths = ", ".join(number(getattr(leg, key)) for key in LENGTHS)
    rows = [
        (lengths, "L1..L6 [m]"),
        (f"{number(leg.bend)}, {number(leg.tilt)}", "bend, tilt [rad]"),
        (f"{int(leg.s_A)}, {int(leg.s_E)}, {int(leg.assembly)}", "s_A, s_E, assembly"),
        (_vector(leg.A), "A"),
        (_vector(leg.foot), "foot"),
        (_vector(leg.back), "back"),
        (_chain(leg.to_foot), "to_foot"),
        (_chain(leg.to_C), "to_C"),
        (_chain(leg.knee_knee), "knee_knee"),
    ]
    lines = [f"    {values}, /* {name} */\n" for values, name in rows]

    return "".join([*lines, f"    {number(leg.apart2)} /* apart2 */\n"])


def _vector(v: Real) -> str:
    return f"{{{number(v[..., 0])}, {number(v[..., 1])}}}"


def _chain(chain: Chain) -> str:
    return f"{{{', '.join(number(value) for value in chain)}}}"
