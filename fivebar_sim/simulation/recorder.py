"""The record of a run, made of its states as they come: the states themselves are not kept."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools, blocks
from fivebar_sim.dynamics.chain import Pose
from fivebar_sim.errors import DivergedError
from fivebar_sim.kinematics.closure import directions
from fivebar_sim.metrics import branch, energy, ground
from fivebar_sim.metrics.columns import Record
from fivebar_sim.metrics.tracking import left_path
from fivebar_sim.simulation import jolts, record
from fivebar_sim.simulation.measure import Unrecorded
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.simulation.steps import States, fault


class Recorder:
    """Keeps the record of one simulation, and of each step what else the metrics need.

    Args:
        planned: The plan that is simulated.

    Attributes:
        error: Why the simulation broke down; None while it has not. Later steps are not kept.
    """

    def __init__(self, planned: Plan) -> None:
        steps = planned.scenario.steps
        self.error: DivergedError | None = None
        self._planned = planned
        self._done = 0
        self._before = planned.start

        # Of every step: what the record is made of, and what the metrics need besides.
        self._columns: Record = {}
        self._heights: Record = {}
        self._signs: NDArray[np.int8] = np.empty((3, steps), dtype=np.int8)
        # Of the links, (x, z) each: before the first step too.
        self._along: Array = np.empty((4, 2, steps + 1))
        self._along[..., 0] = directions(planned.start[-4:])
        # Column by column in memory, as all else.
        self._constraint: Array = np.empty((planned.model.nv, steps)).T
        self._saturated: Bools = np.empty((steps, 2), dtype=bool)
        self._unsolved: Bools = np.empty(steps, dtype=bool)
        self._warnings = 0

    def add(self, states: States) -> None:
        """Take the next states of this one simulation."""
        for rows in blocks(states.time.shape[1]):
            if self.error is None:
                self._add(states.part(rows).by_columns())

        # The warnings are counted at the end of all these states.
        self._warnings = int(states.warnings[0])
        if self.error is None and self._warnings:
            self.error = DivergedError(
                f"MuJoCo gave {self._warnings} warnings in the last step",
                self._done * self._planned.motion.timestep,
            )

    def _add(self, states: States) -> None:
        """Take a few states."""
        planned = self._planned
        self.error = fault(states, planned.motion.timestep, self._done)
        part = record.Part(states, self._done, self._before)
        rows = slice(self._done, self._done + states.time.shape[1])
        # The states of a breakdown may overflow; such an angle counts as off the path.
        with np.errstate(all="ignore") if self.error is not None else nullcontext():
            along = self._directed(states.qpos[0, :, -4:], rows)
            points = record.points(planned, part, along)
            self._fill(self._columns, rows, record.columns(planned, part, points))
            # Of the same sines and cosines: the energies, the branch, and depths in the floor.
            self._signs[:, rows] = branch.signs(planned.scenario.leg, points)
            if "ground_z" in self._columns:
                self._fill(self._heights, rows, ground.joint_heights(planned.scenario.leg, points))
            self._saturated[rows] = record.saturated(planned, part)
            self._constraint[rows] = record.forces(planned, part)

        self._unsolved[rows] = states.iterations[0] >= planned.model.opt.iterations
        self._before = states.qpos[0, -1].copy()
        self._done = rows.stop

    def _directed(self, q: Array, rows: slice) -> tuple[Array, Array, Array, Array]:
        """Return the `directions` of joint angles, (n, 2) each, and keep them."""
        angles = (q[:, 0], q[:, 0] + q[:, 1], q[:, 2] + q[:, 3], q[:, 2])
        kept = self._along[..., rows.start + 1 : rows.stop + 1]
        for (x, z), angle in zip(kept, angles, strict=True):
            np.cos(angle, out=x)
            np.sin(angle, out=z)
        one, two, three, four = kept
        return one.T, two.T, three.T, four.T

    def _fill(self, columns: Record, rows: slice, parts: Record) -> None:
        """Fill rows of columns, each of which lies in one piece of memory of its own."""
        for name, values in parts.items():
            if name not in columns:
                columns[name] = np.empty(self._planned.scenario.steps)
            columns[name][rows] = values

    @property
    def record(self) -> Record:
        """The columns of rollout.parquet, of the steps so far."""
        return {name: column[: self._done] for name, column in self._columns.items()}

    @property
    def unrecorded(self) -> Unrecorded:
        """The per-step data that the metrics need and the record leaves out."""
        planned = self._planned
        record_so_far = self.record
        before = Pose(*((x[:-1], z[:-1]) for x, z in self._along))

        return Unrecorded(
            steps=energy.Steps(planned.start, self._constraint, planned.pushes, before),
            saturated=self._saturated,
            unsolved=self._unsolved,
            warnings=self._warnings,
            ranges=record.ranges(planned.model),
            trunk=record.lowest(planned.model),
            growth=record.growth(planned, record_so_far),
            jolts=jolts.jolts(planned, record_so_far),
            signs=self._signs,
            heights=self._heights,
        )

    def broken(self, error: DivergedError) -> DivergedError:
        """Return the error of a run that broke down: when the foot left its path, and the cause."""
        scenario = self._planned.scenario
        left = 0.0
        if self._done:
            # Distances of a breakdown may overflow too.
            with np.errstate(all="ignore"):
                left = left_path(scenario.leg, self.record, error.time)
        why = f"{scenario.name}: the foot left its path at t = {left:g} s; {error}"
        return DivergedError(why, left)
