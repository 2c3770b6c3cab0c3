"""Certificates of one design: how near it comes, at worst, to what it must not do.

A motion is cut in time, a region in boxes. Where the bounds of a part are not yet as good as what
was found at points, to a tolerance, the part is cut further. What is certified is the worst bound
of all parts, so it holds however early the cutting ends: only how much is given away depends on it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.design.certificate import stretches
from fivebar_sim.design.certificate.bounds import Bounds, bounds
from fivebar_sim.design.evaluation.legs import Legs, columns, numbers
from fivebar_sim.design.evaluation.measures import worst_condition
from fivebar_sim.design.evaluation.poses import solved
from fivebar_sim.design.task.motions import FootMotion, Region
from fivebar_sim.design.task.options import Constraints
from fivebar_sim.design.task.task import Task
from fivebar_sim.geometry import FiveBar

TOLERANCE = 1e-3
"""How much may be given away: of the reach in sizes of the leg, of a sine, and of the condition
number relative to it."""

FIRST = 256
"""Parts that a motion is cut into at first, at least."""

CELLS = 24
"""Cells along each side of a region's box at first."""

DEEPEST = 12
"""How often a part may be halved, in each direction."""

MOST = 200_000
"""Parts at a time; of a leg that needs more the bounds stay as they are."""


class Certified(NamedTuple):
    """What surely holds in a whole motion or region, beside the worst that was found at points.

    Attributes:
        name: "motion.NAME" or "region.NAME".
        reach: The slack is at least that [m].
        singular: The sines at B, C and D are at least that.
        condition: The condition number is at most that.
        found: The worst of each that was found at points; the truth lies between.
        parts: Parts that it took.
    """

    name: str
    reach: float
    singular: float
    condition: float
    found: tuple[float, float, float]
    parts: int

    def refusal(self, constraints: Constraints) -> str:
        """Return which constraint is not certain to hold, in words; "" if all hold."""
        at_least = (
            ("reach", self.reach, self.found[0], constraints.reach),
            ("singular", self.singular, self.found[1], constraints.singular),
        )
        for name, sure, found, asked in at_least:
            if not sure >= asked:
                return (
                    f"{self.name}: {name} is certain to {sure:.4g} (found {found:.4g}), asked "
                    f"{asked:g}"
                )

        most = constraints.condition
        if most is not None and not self.condition <= most:
            return (
                f"{self.name}: condition is certain to {self.condition:.4g} (found "
                f"{self.found[2]:.4g}), asked {most:g}"
            )
        return ""


def certify(task: Task, row: Array) -> list[Certified]:
    """Return the certificates of a design (d,), one for each motion and each region.

    Raises:
        ArgumentError: A kind of path of which no bounds are known.
    """
    leg = task.leg_of(row)
    found = [certify_motion(leg, motion) for motion in task.motions_of(row)]
    found += [certify_region(leg, each.region, each.name) for each in task.covers_of(row)]
    return found


def certify_motion(leg: FiveBar, motion: FootMotion) -> Certified:
    """Return the certificate of a leg along a whole foot motion."""
    path = motion.path
    pieces = stretches.pieces(path)
    each = max(2, FIRST // len(pieces))
    start = np.concatenate([_cut(p.start, p.stop, each)[:-1] for p in pieces])
    stop = np.concatenate([_cut(p.start, p.stop, each)[1:] for p in pieces])
    steepest = np.concatenate([np.tile(p.steepest, (each, 1)) for p in pieces])

    def box(part: Array) -> tuple[Array, Array]:
        return stretches.boxes(path, part[:, 0], part[:, 1], part[:, 2:])

    def points(part: Array) -> Array:
        return path.nominal(0.5 * (part[:, 0] + part[:, 1])).position

    def halves(part: Array) -> Array:
        middle = 0.5 * (part[:, :1] + part[:, 1:2])
        before = np.hstack([part[:, :1], middle, part[:, 2:]])
        return np.concatenate([before, np.hstack([middle, part[:, 1:]])])

    parts = np.hstack([start[:, None], stop[:, None], steepest])
    return _worst(leg, f"motion.{motion.name}", parts, box, points, halves)


def certify_region(leg: FiveBar, region: Region, name: str) -> Certified:
    """Return the certificate of a leg all over a region."""
    low, high = region.box()
    lines = [_cut(a, b, CELLS) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    corner = np.stack(np.meshgrid(*(line[:-1] for line in lines)), axis=-1).reshape(-1, 2)
    # The next line of the grid itself, so that no gap is left by rounding.
    other = np.stack(np.meshgrid(*(line[1:] for line in lines)), axis=-1).reshape(-1, 2)

    def within(part: Array) -> Array:
        return part[~region.misses(part[:, :2], part[:, 2:])]

    def points(part: Array) -> Array:
        middle = 0.5 * (part[:, :2] + part[:, 2:])
        return middle[~region.misses(middle, middle)]

    def quarters(part: Array) -> Array:
        middle = 0.5 * (part[:, :2] + part[:, 2:])
        found = []
        for right in (False, True):
            for up in (False, True):
                pick = np.array([right, up])
                first = np.where(pick, middle, part[:, :2])
                found.append(np.hstack([first, np.where(pick, part[:, 2:], middle)]))
        return within(np.concatenate(found))

    parts = within(np.hstack([corner, other]))
    box = lambda part: (part[:, :2], part[:, 2:])  # noqa: E731
    return _worst(leg, f"region.{name}", parts, box, points, quarters)


Boxes = Callable[[Array], tuple[Array, Array]]
Cut = Callable[[Array], Array]


def _worst(leg: FiveBar, name: str, parts: Array, box: Boxes, points: Cut, cut: Cut) -> Certified:
    """Return the certificate over parts, cut as far as it takes.

    Args:
        leg: The leg.
        name: The certificate's.
        parts: What it is made of at first, a row each.
        box: Returns the boxes that hold the foot in parts.
        points: Returns foot positions in parts.
        cut: Returns smaller parts that make up parts.
    """
    sure = [np.inf, np.inf, -np.inf]
    found = [np.inf, np.inf, -np.inf]
    taken = 0
    # An overflow or a NaN counts as a bound that says nothing.
    with np.errstate(all="ignore"):
        for depth in range(DEEPEST + 1):
            taken += len(parts)
            seen = _at(leg, points(parts))
            found = [min(found[0], seen[0]), min(found[1], seen[1]), max(found[2], seen[2])]
            each = bounds(leg, *box(parts))
            open_parts = _unsettled(leg, each, found)
            last = depth == DEEPEST or 4 * int(open_parts.sum()) > MOST
            closed = np.ones(len(parts), dtype=bool) if last else ~open_parts
            if closed.any():
                sure[0] = min(sure[0], float(each.reach[closed].min()))
                sure[1] = min(sure[1], float(each.singular[closed].min()))
                sure[2] = max(sure[2], float(each.condition[closed].max()))
            if closed.all():
                break
            parts = cut(parts[open_parts])

    return Certified(name, *sure, found=(found[0], found[1], found[2]), parts=taken)


def _unsettled(leg: FiveBar, each: Bounds, found: list[float]) -> Bools:
    """Return the parts whose bounds are worse than what was found by more than the tolerance."""
    # Of a leg that does not even do it at the points nothing needs to be known to a digit.
    if found[0] < 0.0 or not found[1] > 0.0:
        return np.zeros(len(each.reach), dtype=bool)
    reach = each.reach < found[0] - TOLERANCE * leg.size
    singular = each.singular < found[1] - TOLERANCE
    return reach | singular | (each.condition > found[2] * (1.0 + TOLERANCE))


def _at(leg: FiveBar, foot: Array) -> tuple[float, float, float]:
    """Return the least slack, the least sine and the largest condition number at points (n, 2)."""
    if not len(foot):
        return np.inf, np.inf, -np.inf
    legs = Legs(columns(numbers(leg), {}, 1))
    p = solved(legs, foot[None, :, 0], foot[None, :, 1])
    condition = float(worst_condition(legs, p)[0])
    slack = float(p.slack.min())
    return slack, float(p.sine.min()), condition if slack >= 0.0 else np.inf


def _cut(start: float, stop: float, parts: int) -> Array:
    """Return the ends of equal parts, (parts + 1,), the first and the last exact."""
    ends = np.linspace(start, stop, parts + 1)
    ends[-1] = stop
    return ends
