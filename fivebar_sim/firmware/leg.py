"""A leg as the firmware keeps it: `fivebar_leg` and `fivebar_prepare` of the C code."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fivebar_sim.errors import GeometryError
from fivebar_sim.firmware.elementary import Real, magnitude, numbers, square_root, unit
from fivebar_sim.firmware.status import Status, Statuses, first_of
from fivebar_sim.geometry import FiveBar

SMALLEST = 1e-4
LARGEST = 1e3
"""Least and greatest size of a leg, the longer of its side chains [m]."""

SHORTEST = 1e-3
"""Least length of L1..L4 and of |BF|, as a part of the size."""

LENGTHS = ("L1", "L2", "L3", "L4", "L5", "L6")


class Chain(NamedTuple):
    """How far the end of two links may be from their start: `fivebar_chain`, each (...)."""

    inner: Real
    outer: Real
    low: Real
    high: Real
    least: Real
    most: Real
    product: Real


class Leg(NamedTuple):
    """A leg, or many: `fivebar_leg`. Every field is an array (...), vectors are (..., 2)."""

    L1: Real
    L2: Real
    L3: Real
    L4: Real
    L5: Real
    L6: Real
    bend: Real
    tilt: Real
    s_A: NDArray[np.int32]
    s_E: NDArray[np.int32]
    assembly: NDArray[np.int32]
    A: Real
    foot: Real
    back: Real
    to_foot: Chain
    to_C: Chain
    knee_knee: Chain
    apart2: Real


def prepare(fields: dict[str, ArrayLike], kind: type[Any] = np.float32) -> tuple[Leg, Statuses]:
    """Return what `fivebar_prepare` makes of legs, and its status for each.

    Args:
        fields: L1..L6 [m], bend, tilt [rad], and the signs s_A, s_E, assembly, each (...).
        kind: np.float32, or np.float64 for -DFIVEBAR_DOUBLE.

    Returns:
        The legs, whose derived fields mean something only where the status is OK.
    """
    reals = {key: np.asarray(fields[key], dtype=kind) for key in (*LENGTHS, "bend", "tilt")}
    signs = {key: np.asarray(fields[key], dtype=np.int32) for key in ("s_A", "s_E", "assembly")}
    with np.errstate(all="ignore"):
        return _prepare(reals, signs)


def of(leg: FiveBar, kind: type[Any] = np.float32) -> Leg:
    """Return a leg as the firmware keeps it.

    Raises:
        GeometryError: The firmware's arithmetic cannot hold the leg.
    """
    fields: dict[str, ArrayLike] = {key: getattr(leg, key) for key in (*LENGTHS, "bend", "tilt")}
    s_A, s_E = leg.mode
    made, status = prepare({**fields, "s_A": s_A, "s_E": s_E, "assembly": leg.assembly}, kind)
    if status != Status.OK:
        raise GeometryError(
            f"the firmware cannot hold the leg {leg.name}: the longer side chain must be in "
            f"[{SMALLEST:g}, {LARGEST:g}] m, got {leg.size:g} m, and L1, L2, L3, L4 and |BF| at "
            f"least {SHORTEST:g} of it, got "
            f"{min(leg.L1, leg.L2, leg.L3, leg.L4, float(np.hypot(*leg.foot_offset))):g} m"
        )
    return made


def _prepare(r: dict[str, Real], signs: dict[str, NDArray[np.int32]]) -> tuple[Leg, Statuses]:
    """Return the legs of checked types, with their statuses."""
    kind = r["L1"].dtype.type
    L1, L2, L3, L4, L5, L6 = (r[key] for key in LENGTHS)
    left = L1 + L2 + L6
    right = L4 + L3
    size = np.where(left > right, left, right)
    shortest = kind(SHORTEST) * size
    status = _status(r, signs, size, shortest)

    # Where the leg is refused its numbers must not spoil the arithmetic of the others.
    good = status == Status.OK
    turned = unit(np.where(good, r["bend"], kind(0.0)))
    along = L2 + L6 * turned[..., 0]
    across = L6 * turned[..., 1]
    radius2 = along * along + across * across
    extended = L6 > 0.0
    # Without an extension exactly L2, which the root of its square may miss.
    radius = np.where(extended, square_root(radius2), L2)
    short = good & ~(radius >= shortest)
    status = np.where(short, np.int32(Status.BAD_LEG), status)

    turned = unit(np.where(good, r["tilt"], kind(0.0)))
    half = kind(0.5) * L5
    A = np.stack([-half * turned[..., 0], -half * turned[..., 1]], axis=-1)
    foot = np.stack([along / L2, across / L2], axis=-1)
    back_x = np.where(extended, L2 * along / radius2, kind(1.0))
    back_z = np.where(extended, -(L2 * across) / radius2, kind(0.0))
    slack = (kind(4.0) * kind(numbers(L1).epsilon)) * (size + L5)
    apart = kind(4.0) * slack

    return (
        Leg(
            **r,
            **signs,
            A=A,
            foot=foot,
            back=np.stack([back_x, back_z], axis=-1),
            to_foot=_chain(L1, radius, slack),
            to_C=_chain(L4, L3, slack),
            knee_knee=_chain(L2, L3, slack),
            apart2=apart * apart,
        ),
        status,
    )


def _status(
    r: dict[str, Real], signs: dict[str, NDArray[np.int32]], size: Real, shortest: Real
) -> Statuses:
    """Return the status of legs before |BF| is known."""
    kind = size.dtype.type
    L5 = r["L5"]
    L6 = r["L6"]
    total = r["L1"] + r["L2"] + r["L3"] + r["L4"] + L5
    slack = kind(1.0) + kind(8.0) * kind(numbers(size).epsilon)
    pi = kind(numbers(size).pi)
    links = [r[key] for key in LENGTHS[:4]]
    infinite = [~np.isfinite(value) for value in r.values()]
    unsigned = [(s != 1) & (s != -1) for s in signs.values()]

    return first_of(
        (np.any(infinite, axis=0), Status.NOT_FINITE),
        (np.any(unsigned, axis=0), Status.BAD_ARGUMENT),
        (~((size >= kind(SMALLEST)) & (size <= kind(LARGEST))), Status.BAD_LEG),
        (np.any([~(L >= shortest) for L in links], axis=0), Status.BAD_LEG),
        (~((L5 >= 0.0) & (L6 >= 0.0)), Status.BAD_LEG),
        (np.any([~((total - L) * slack >= L) for L in (*links, L5)], axis=0), Status.BAD_LEG),
        (~((magnitude(r["bend"]) <= pi) & (magnitude(r["tilt"]) <= pi)), Status.BAD_LEG),
    )


def _chain(near: Real, far: Real, slack: Real) -> Chain:
    """Return what `prepare_chain` makes of two links."""
    inner = magnitude(near - far)
    outer = near + far
    hole = np.where(inner > slack, inner - slack, slack.dtype.type(0.0))
    reach = outer + slack

    return Chain(
        inner=inner,
        outer=outer,
        low=inner * inner,
        high=outer * outer,
        least=hole * hole,
        most=reach * reach,
        product=(near - far) * outer,
    )
