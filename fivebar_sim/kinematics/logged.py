"""Whether measured motor angles can be a leg's: where they cannot, when, by how much, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array, Bools
from fivebar_sim.errors import LoopOpenError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.closure import branch, chain_points, closed_points, knees
from fivebar_sim.kinematics.home import home
from fivebar_sim.kinematics.planar import perp, unit

SLACK = 1e-9
"""How far past the edge of reach still counts as closed, of the leg's size: rounding."""


MOSTLY = 0.9
"""Part of the rows that must fit a leg whose numbers are not known well."""


def check_closes(leg: FiveBar, time: Array, theta: Array, where: str) -> None:
    """Raise unless a leg's loop can close, in its own working mode, at all measured angles.

    Args:
        leg: The leg.
        time: [s], (n,).
        theta: (theta_A, theta_E) [rad], (n, 2).
        where: The log, for messages.

    Raises:
        LoopOpenError: Says when first, how often and by how much, and guesses why: motors swapped,
            degrees read as radians, angles counted the other way round.
    """
    gap = gaps(leg, theta)
    is_open = gap > SLACK * leg.size
    if is_open.any():
        k = int(np.argmax(is_open))
        worst = int(np.argmax(gap))
        raise LoopOpenError(
            f"{where}: the loop of the leg {leg.name} cannot close in {_part(is_open)} of rows: "
            f"first at t = {time[k]:.6g} s, where the knees are {_mm(gap[k])} too far apart or too "
            f"near, worst at t = {time[worst]:.6g} s by {_mm(gap[worst])}{_guess(leg, theta)}",
            (k,),
        )

    other = ~in_mode(leg, theta)
    if other.any():
        k = int(np.argmax(other))
        raise LoopOpenError(
            f"{where}: {_part(other)} of rows, first at t = {time[k]:.6g} s, are in another "
            f"working mode than the leg's {leg.mode}{_guess(leg, theta)}",
            (k,),
        )
    beyond = ~on_side(leg, theta)
    # A foot may come up to its hip, but does not work there.
    if beyond.mean() > 0.5:
        k = int(np.argmax(beyond))
        raise LoopOpenError(
            f"{where}: in {_part(beyond)} of rows, first at t = {time[k]:.6g} s, the foot would be "
            f"on the other side of the motors than the leg's own{_guess(leg, theta)}",
            (k,),
        )


def check_mostly(leg: FiveBar, time: Array, theta: Array, where: str) -> None:
    """Raise as `check_closes` does, unless nearly all angles can be the leg's.

    For legs whose numbers are not known well: a few poses may be just out of their reach.
    """
    closes = gaps(leg, theta) <= SLACK * leg.size
    fits = closes.copy()
    fits[closes] = in_mode(leg, theta[closes]) & on_side(leg, theta[closes])
    if fits.mean() < MOSTLY:
        check_closes(leg, time, theta, where)


def gaps(leg: FiveBar, theta: Array) -> Array:
    """Return how far B and D are beyond the distances at which L2 and L3 meet [m], (n,).

    0 where the loop closes; NaN angles give 0.
    """
    B, D = knees(leg, theta)
    apart = np.hypot(*(D - B).T)
    low = abs(leg.L2 - leg.L3)
    high = leg.L2 + leg.L3
    return np.nan_to_num(np.maximum(np.maximum(apart - high, low - apart), 0.0))


def in_mode(leg: FiveBar, theta: Array) -> Bools:
    """Return where closed poses are in the leg's own working mode, (n,); NaN counts as such."""
    there = np.isfinite(theta).all(axis=-1)
    found = np.ones(len(theta), dtype=bool)
    signs = branch(leg, closed_points(leg, theta[there]))
    # A straight side is in both.
    found[there] = (signs.s_A * leg.mode[0] >= 0) & (signs.s_E * leg.mode[1] >= 0)
    return found


def on_side(leg: FiveBar, theta: Array) -> Bools:
    """Return where the foot is on the side of the line through the motors that it has at home."""
    there = np.isfinite(theta).all(axis=-1)
    found = np.ones(len(theta), dtype=bool)
    across = perp(unit(leg.tilt))
    own = chain_points(leg, home(leg)).F @ across
    found[there] = closed_points(leg, theta[there]).F @ across * own >= 0.0
    return found


def _part(rows: Bools) -> str:
    return f"{units.text(100.0 * float(rows.mean()), '%', 3)}"


def _mm(length: float) -> str:
    return units.text(1e3 * float(length), "mm", 3)


def _mistakes() -> Iterator[tuple[str, Callable[[Array], Array]]]:
    """Yield what logs are often read wrongly by, and what undoes it."""
    turn = np.pi
    yield "A and E swapped: exchange theta_A and theta_E", lambda q: q[:, ::-1]
    yield "degrees read as radians, a factor of 57.3: unit = 'deg'", lambda q: np.radians(q)
    yield "radians read as degrees, a factor of 57.3: unit = 'rad'", lambda q: np.degrees(q)
    yield "angles that count clockwise: sign = -1 for both", lambda q: -q

    for name, k in (("A", 0), ("E", 1)):
        flip = np.where(np.arange(2) == k, -1.0, 1.0)
        yield f"an angle that counts clockwise: sign = -1 for theta_{name}", lambda q, f=flip: f * q

    yield "angles from the other end: offset = '180 deg' for both", lambda q: q + turn
    yield "angles from straight down: offset = '-90 deg' for both", lambda q: q - 0.5 * turn
    yield "swapped and clockwise: exchange A and E, sign = -1 for both", lambda q: -q[:, ::-1]

    # As on the other side of a robot.
    yield (
        "A and E swapped and seen from behind: exchange them, sign = -1, offset = '180 deg'",
        lambda q: turn - q[:, ::-1],
    )


def _guess(leg: FiveBar, theta: Array) -> str:
    """Return what the angles would fit with, as a guess; "" if nothing does."""
    for said, undo in _mistakes():
        tried = undo(theta)
        if (gaps(leg, tried) > SLACK * leg.size).any():
            continue
        if in_mode(leg, tried).all() and on_side(leg, tried).mean() > 0.5:
            return f"; a guess, since all rows would then fit: {said}; or the log is another leg's"
    return "; a log of another leg, or of other zeros of the motors (offset)?"
