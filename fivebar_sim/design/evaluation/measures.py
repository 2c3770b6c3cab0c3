"""What is forbidden: each constraint is a measure of a design that must stay within a range."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.legs import Legs
from fivebar_sim.design.evaluation.motors import Motors
from fivebar_sim.design.evaluation.objectives import CATALOGUE, Driven
from fivebar_sim.design.evaluation.poses import Poses
from fivebar_sim.dynamics.plane import Vector, cross

if TYPE_CHECKING:
    from fivebar_sim.design.task.task import Task

STEP = 1e-9
"""Slack of joint stops, for rounding [rad]."""


NEAR = 0.05
"""Reach in sizes of the leg of which the spare is taken where 0 is asked: of 0 it is nothing."""


class Limit(NamedTuple):
    """The range of a measure.

    Attributes:
        name: Its column.
        unit: SI unit.
        low: Least legal value.
        high: Greatest legal value.
    """

    name: str
    unit: str
    low: float = -np.inf
    high: float = np.inf

    def violation(self, measure: Array) -> Array:
        """Return by how much measures are out of range; NaN stays NaN."""
        return np.maximum(np.maximum(self.low - measure, measure - self.high), 0.0)


def limits(task: Task, *, spare: float = 0.0) -> tuple[Limit, ...]:
    """Return the limits of a task, in the order in which they are looked at.

    Args:
        task: The task.
        spare: How much more is asked of reach, singular and condition, as a fraction.
    """
    c = task.constraints
    found = [
        Limit("closes", "m", low=0.0),
        Limit("reach", "m", low=c.reach + spare * (c.reach or NEAR * task.leg.size)),
        Limit("singular", "", low=min(c.singular * (1.0 + spare), 1.0)),
    ]

    if c.condition is not None:
        found.append(Limit("worst_condition", "", high=max(c.condition * (1.0 - spare), 1.0)))
    found += [Limit(f"stop_{joint}", "rad", high=STEP) for joint in c.stops]
    if c.knees is not None:
        found.append(Limit("knees", "m", low=c.knees))
    if c.apart is not None:
        found.append(Limit("apart", "m", low=c.apart))
    if task.motions and all(servo.limit is not None for servo in task.servos):
        found.append(Limit("line", "", high=c.line))

    found += [Limit(f"most_{k}", CATALOGUE[k].unit, high=v) for k, v in c.most.items()]
    found += [Limit(f"least_{k}", CATALOGUE[k].unit, low=v) for k, v in c.least.items()]
    return tuple(found)


def least_slack(each: list[Poses]) -> Array:
    """Return how near the foot comes to the edge of reach [m], (n,)."""
    return np.minimum.reduce([p.slack.min(axis=1) for p in each])


def least_sine(each: list[Poses]) -> Array:
    """Return the least sine of the angles at B, C and D, (n,)."""
    return np.minimum.reduce([p.sine.min(axis=1) for p in each])


def worst_condition(legs: Legs, p: Poses) -> Array:
    """Return the largest condition number of poses, (n,).

    With a = |d F / d theta_A|, b = |d F / d theta_E| and d their determinant it is
    k + 1/k = (a^2 + b^2) / |d|, where L6 = 0 and with it the sines' own products.
    """
    from fivebar_sim.design.evaluation.poses import slopes

    pose = legs.chain(0.0).coupled(p.e1, p.e2, p.e3, p.e4)
    return slopes(legs, p, pose).condition.max(axis=1)


def line_used(motors: Motors, each: list[Driven]) -> Array:
    """Return how near the motors come to their torque-speed lines, (n,): see `heat.line_used`."""
    parts = [
        np.abs(tau / motors.limit + w / motors.speed).max(axis=1)
        for m in each
        for tau, w in zip(m.torque, m.speed, strict=True)
    ]
    return np.maximum.reduce(parts)


def beyond_stop(joint: str, low: float, high: float, p: Poses) -> Array:
    """Return how far a joint goes beyond its range along a motion [rad], (n,).

    The angle is followed from sample to sample, and then taken in the turn that fits best.
    """
    angle = np.unwrap(_angle(joint, p), axis=1)
    least = angle.min(axis=1)
    most = angle.max(axis=1)
    turn = 2.0 * np.pi
    best = np.full(len(least), np.inf)
    first = np.ceil((low - least) / turn)
    for n in (first, first - 1.0):
        beyond = np.maximum(low - least - turn * n, most + turn * n - high)
        best = np.minimum(best, np.maximum(beyond, 0.0))
    return best


def _angle(joint: str, p: Poses) -> Array:
    """Return a joint's angle [rad], (n, N): of A and E from +x, of the others between two links."""
    if joint in ("A", "E"):
        e = p.e1 if joint == "A" else p.e4
        return np.arctan2(e[1], e[0])
    first, second = {"B": (p.e1, p.e2), "D": (p.e4, p.e3), "C": (p.e3, p.e2)}[joint]
    return np.arctan2(cross(first, second), first[0] * second[0] + first[1] * second[1])


def knee_height(legs: Legs, p: Poses, ground: float | None) -> Array:
    """Return how high the knees' rims stay above the ground [m], (n,).

    Args:
        legs: The legs.
        p: The poses of a motion.
        ground: Its height [m]; None: the foot's ball stands on it at its lowest.
    """
    E_z = legs.E[1]
    B_z = legs.L1 * p.e1[1] - E_z
    D_z = legs.L4 * p.e4[1] + E_z
    lowest = np.minimum(B_z, D_z).min(axis=1) - legs.radius[:, 0]
    if ground is not None:
        return lowest - ground
    return lowest - (p.F[1].min(axis=1) - legs.foot_radius[:, 0])


def gap(legs: Legs, p: Poses) -> Array:
    """Return the least gap between links that share no joint, less their radii [m], (n,)."""
    E_x, E_z = legs.E
    A = -E_x, -E_z
    B = A[0] + legs.L1 * p.e1[0], A[1] + legs.L1 * p.e1[1]
    D = E_x + legs.L4 * p.e4[0], E_z + legs.L4 * p.e4[1]
    C = B[0] + legs.L2 * p.e2[0], B[1] + legs.L2 * p.e2[1]
    pairs = [(A, B, (E_x, E_z), D), (A, B, D, C), (B, C, (E_x, E_z), D)]
    if (legs.L6 > 0.0).any():
        pairs.append((C, p.F, (E_x, E_z), D))
    least = np.minimum.reduce([_between(*pair).min(axis=1) for pair in pairs])
    return least - 2.0 * legs.radius[:, 0]


def _between(a: Vector, b: Vector, c: Vector, d: Vector) -> Array:
    """Return the distance between the segments ab and cd; 0 where they cross."""
    ends = [_to(a, c, d), _to(b, c, d), _to(c, a, b), _to(d, a, b)]
    u = b[0] - a[0], b[1] - a[1]
    v = d[0] - c[0], d[1] - c[1]
    one = cross(u, (c[0] - a[0], c[1] - a[1])) * cross(u, (d[0] - a[0], d[1] - a[1]))
    other = cross(v, (a[0] - c[0], a[1] - c[1])) * cross(v, (b[0] - c[0], b[1] - c[1]))
    return np.where((one < 0.0) & (other < 0.0), 0.0, np.minimum.reduce(np.broadcast_arrays(*ends)))


def _to(p: Vector, a: Vector, b: Vector) -> Array:
    """Return the distance of a point from the segment ab."""
    u = b[0] - a[0], b[1] - a[1]
    r = p[0] - a[0], p[1] - a[1]
    length = u[0] ** 2 + u[1] ** 2
    share = (u[0] * r[0] + u[1] * r[1]) / np.where(length > 0.0, length, 1.0)
    t = np.clip(share, 0.0, 1.0)
    return np.hypot(r[0] - t * u[0], r[1] - t * u[1])
