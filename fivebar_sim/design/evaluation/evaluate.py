"""The evaluation of many designs at once, closed form, on arrays (designs, samples).

What costs least comes first: a design that fails a geometric constraint is dropped before its
torques are computed. Every number of a design depends on its own row alone, so that neither what
is dropped nor how the designs are cut into blocks changes a bit of the others.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.design.evaluation import measures
from fivebar_sim.design.evaluation.legs import Legs, Rows
from fivebar_sim.design.evaluation.measures import Limit, limits
from fivebar_sim.design.evaluation.motors import Motors
from fivebar_sim.design.evaluation.objectives import CATALOGUE, Driven, Found
from fivebar_sim.design.evaluation.poses import Poses, rates, solved, taken, torques
from fivebar_sim.design.task.motions import Moving
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import ArgumentError

TOGETHER = 8192
"""Poses that are computed at once in a thread: their arrays stay in the cache."""


@dataclass(frozen=True, slots=True)
class Evaluated:
    """What became of n designs.

    Attributes:
        values: The designs, (n, d), in the order of `Task.names`.
        objectives: In SI units and the order of `Task.objectives`, (n, m); NaN where a constraint
            had dropped the design before.
        measures: What the constraints limit, in the order of `limits`, (n, k); NaN as above.
        violations: By how much each is out of its range, (n, k); NaN as above.
    """

    values: Array
    objectives: Array
    measures: Array
    violations: Array

    def __len__(self) -> int:
        return len(self.values)

    @property
    def feasible(self) -> Bools:
        """Which designs keep to every constraint, (n,)."""
        # A NaN is not 0: what was dropped is not feasible.
        kept = (self.violations == 0.0).all(axis=1)
        return kept & np.isfinite(self.objectives).all(axis=1)

    def take(self, rows: Rows) -> Evaluated:
        """Return some of the designs."""
        return Evaluated(
            self.values[rows], self.objectives[rows], self.measures[rows], self.violations[rows]
        )

    @classmethod
    def joined(cls, parts: list[Evaluated]) -> Evaluated:
        """Return several as one."""
        return cls(
            np.concatenate([part.values for part in parts]),
            np.concatenate([part.objectives for part in parts]),
            np.concatenate([part.measures for part in parts]),
            np.concatenate([part.violations for part in parts]),
        )


class Column(NamedTuple):
    """A column of designs.parquet: its name, its unit ("" for a pure number) and what it is."""

    name: str
    unit: str
    role: str


def columns(task: Task) -> list[Column]:
    """Return the columns of a task's designs: variables, objectives, then constraints' measures."""
    variables = [Column(name, "", "variable") for name in task.names]
    wanted = [Column(name, CATALOGUE[name].unit, "objective") for name in task.objectives]
    limited = [Column(f"limit.{each.name}", each.unit, "constraint") for each in limits(task)]
    return [*variables, *wanted, *limited]


def evaluate(task: Task, values: Array, *, threads: int = 1, spare: float = 0.0) -> Evaluated:
    """Return objectives and constraints of designs.

    Args:
        task: The task.
        values: The designs, (n, d), in the order of `Task.names`.
        threads: Threads to use; the result is the same with any number.
        spare: How much more than the constraints is asked, as a fraction; see `Search.spare`.

    Raises:
        ArgumentError: Values of another shape, or that are not finite.
    """
    values = np.asarray(values, dtype=np.float64)
    if (
        values.ndim != 2
        or values.shape[1] != len(task.variation.variables)
        or not np.isfinite(values).all()
    ):
        raise ArgumentError(
            f"values must be finite, (n, {len(task.variation.variables)}), got shape {values.shape}"
        )
    bounds = limits(task, spare=spare)
    rows = max(1, TOGETHER // task.samples)
    parts = [values[start : start + rows] for start in range(0, max(len(values), 1), rows)]

    def solve(part: Array) -> Evaluated:
        # Designs out of reach give NaN and inf, which their constraints report.
        with np.errstate(all="ignore"):
            return _Block(task, bounds, part).evaluated()

    if threads == 1 or len(parts) == 1:
        return Evaluated.joined([solve(part) for part in parts])
    with ThreadPoolExecutor(threads) as pool:
        return Evaluated.joined(list(pool.map(solve, parts)))


class _Block:
    """Some designs that are evaluated together.

    Attributes:
        task: The task.
        bounds: Its limits.
        values: The designs, (n, d).
        measures: What is known of them, (n, k).
        measured: Columns of them that are filled.
        rows: Those that no constraint has dropped yet.
        moving: Their foot motions.
    """

    def __init__(self, task: Task, bounds: tuple[Limit, ...], values: Array) -> None:
        self.task = task
        self.bounds = bounds
        self.values = values
        self.measures = np.full((len(values), len(bounds)), np.nan)
        self.measured: set[int] = set()
        self.rows = np.arange(len(values))
        self.moving: list[Moving] = []

    def evaluated(self) -> Evaluated:
        """Return what becomes of the designs."""
        task = self.task
        objectives = np.full((len(self.values), len(task.objectives)), np.nan)
        legs = task.legs(self.values)
        motors = task.motors(self.values)

        self._put("closes", legs.closes)
        legs, _ = self._still(legs, [])
        if len(self.rows):
            self._follow(legs, motors, objectives)

        violations = np.stack(
            [each.violation(self.measures[:, k]) for k, each in enumerate(self.bounds)], axis=1
        )
        return Evaluated(self.values, objectives, self.measures, violations)

    def _follow(self, legs: Legs, motors: Motors, objectives: Array) -> None:
        """Measure all that follows from the poses of legs that can close."""
        values = self.values[self.rows]
        self.moving = [self.task.moving(motion, values) for motion in self.task.motions]
        points = [(each.x, each.z) for each in self.moving]
        points += [self.task.points(cover, values) for cover in self.task.covers]
        poses = [solved(legs, *each) for each in points]
        self._put("reach", measures.least_slack(poses))
        self._put("singular", measures.least_sine(poses))
        legs, poses = self._still(legs, poses)
        if not len(self.rows):
            return

        worst = self._geometric(legs, poses)
        kept = self._kept()
        legs, poses = self._still(legs, poses)
        if len(self.rows):
            found = self._found(legs, motors.take(self.rows), poses, worst[kept])
            self._last(found, objectives)

    def _still(self, legs: Legs, poses: list[Poses]) -> tuple[Legs, list[Poses]]:
        """Drop designs that fail; return the legs and the poses of the others."""
        kept = self._kept()
        if kept.all():
            return legs, poses
        self.rows = self.rows[kept]
        self.moving = [each.take(kept) for each in self.moving]
        return legs.take(kept), [taken(p, kept) for p in poses]

    def _wanted(self) -> set[str]:
        """Return the objectives that are sought or bounded."""
        constraints = self.task.constraints
        return {*self.task.objectives, *constraints.most, *constraints.least}

    def _put(self, name: str, measure: Array) -> None:
        """Keep a measure of the designs that are left, if it is limited."""
        for k, each in enumerate(self.bounds):
            if each.name == name:
                self.measures[self.rows, k] = measure
                self.measured.add(k)

    def _kept(self) -> Bools:
        """Return which of the designs left keep to all that is known of them."""
        done = sorted(self.measured)
        known = self.measures[self.rows][:, done]
        # A measure that came out NaN, as of a singular pose, is kept to by nothing.
        kept = [self.bounds[k].violation(known[:, i]) == 0.0 for i, k in enumerate(done)]
        return np.all(kept, axis=0)

    def _geometric(self, legs: Legs, poses: list[Poses]) -> Array:
        """Measure what needs no torques; return the worst condition number, (n,)."""
        c = self.task.constraints
        moving = poses[: len(self.task.motions)]

        worst = np.full(len(self.rows), np.nan)
        # Only where somebody asks for it: it costs a tenth of everything.
        if c.condition is not None or "condition" in self._wanted():
            worst = np.maximum.reduce([measures.worst_condition(legs, p) for p in poses])
            self._put("worst_condition", worst)
        for joint, (low, high) in c.stops.items():
            parts = [measures.beyond_stop(joint, low, high, p) for p in moving or poses]
            self._put(f"stop_{joint}", np.maximum.reduce(parts))

        if c.knees is not None:
            parts = [measures.knee_height(legs, p, c.ground) for p in poses]
            self._put("knees", np.minimum.reduce(parts))
        if c.apart is not None:
            self._put("apart", np.minimum.reduce([measures.gap(legs, p) for p in poses]))
        return worst

    def _found(self, legs: Legs, motors: Motors, poses: list[Poses], worst: Array) -> Found:
        """Return the designs that are left with the torques of their motions."""
        driven = [
            _driven(motion.weight, legs, motors, p, moving)
            for motion, p, moving in zip(self.task.motions, poses, self.moving, strict=False)
        ]
        return Found(legs, motors, driven, worst)

    def _last(self, found: Found, objectives: Array) -> None:
        """Measure what needs torques, then the objectives."""
        task = self.task
        if any(each.name == "line" for each in self.bounds):
            self._put("line", measures.line_used(found.motors, found.driven))
        measured = {name: CATALOGUE[name].measure(found) for name in sorted(self._wanted())}
        for name in task.constraints.most:
            self._put(f"most_{name}", measured[name])
        for name in task.constraints.least:
            self._put(f"least_{name}", measured[name])
        for k, name in enumerate(task.objectives):
            objectives[self.rows, k] = measured[name]


def _driven(weight: float, legs: Legs, motors: Motors, p: Poses, moving: Moving) -> Driven:
    """Return a foot motion with what its motors do."""
    chain = legs.chain(moving.payload)
    pose = chain.coupled(p.e1, p.e2, p.e3, p.e4)
    turning = rates(legs, p, moving)

    torque = torques(chain, pose, turning, (moving.Fx, moving.Fz), motors.friction)
    return Driven(
        weight=weight,
        seconds=moving.seconds,
        poses=p,
        pose=pose,
        rates=turning,
        torque=torque,
        payload=moving.payload,
    )
