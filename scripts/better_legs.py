"""./.venv/bin/python scripts/better_legs.py [TASK ...]: legs of the size of known ones, for less.

For the Q8bot's and the Doggo's own gaits: searches the shipped task, takes the design with the
least sum of both objectives relative to the robot's own leg, simulates both in MuJoCo, and prints
what is gained and what is paid for it as a Markdown table.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from fivebar_sim import design
from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.evaluate import evaluate
from fivebar_sim.design.evaluation.objectives import CATALOGUE
from fivebar_sim.design.proof.table import predictions, prove
from fivebar_sim.design.report.axes import Axis
from fivebar_sim.design.search.run import search
from fivebar_sim.design.task.task import Task

TASKS = ("q8bot-gait", "doggo-gait")
PAID = ("size", "mass", "workspace_area", "force", "reflected_inertia", "condition")
"""What may be paid for less torque and heat, besides the distance of the motors."""

WORDS = {
    "torque_peak": "peak torque",
    "torque_rms": "RMS torque",
    "heat": "heat",
    "energy": "work a step",
    "size": "length of a side",
    "mass": "mass of the links",
    "workspace_area": "workspace",
    "force": "least force at the foot",
    "reflected_inertia": "largest reflected inertia",
    "condition": "worst condition number",
}


def own_leg(task: Task) -> Array:
    """Return the robot's own leg as a design, (d,)."""
    return np.array([getattr(task.leg, name.removeprefix("leg.")) for name in task.names])


def found_leg(task: Task, own: Array, folder: Path) -> Array:
    """Return the design of the front with the least sum of objectives relative to the own leg's."""
    front = search(task, folder).front
    assert front is not None
    relative = front.designs.objectives / evaluate(task, own[None]).objectives
    return front.designs.values[int(np.argmin(relative.sum(axis=1)))]


def table(task: Task, both: Array) -> list[str]:
    """Return the lines of a table: own leg, found leg, and the change."""
    proof = prove(task, both)
    for run in proof.runs:
        assert not run.error, run.error
        assert not run.guards, run.guards

    lines = ["| what | own leg | found leg | change |", "| --- | --- | --- | --- |"]
    for name in ("torque_peak", "torque_rms", "heat", "energy"):
        lines.append(line(f"{WORDS[name]}, simulated", name, proof.measured[name]))
    paid = predictions(task, both, PAID)
    return [*lines, *(line(WORDS[name], name, paid[name]) for name in PAID)]


def line(word: str, name: str, pair: Array) -> str:
    """Return a line of a table."""
    unit = CATALOGUE[name].unit
    # Both in the unit that fits the larger one.
    axis = Axis.of("", unit, np.array([0.0, float(pair.max())]), 0.0)
    shown = axis.label.strip(" []")
    own, found = (f"{axis.scale * value:.3g} {shown}".strip() for value in pair.tolist())
    return f"| {word} | {own} | {found} | {100.0 * (pair[1] / pair[0] - 1.0):+.0f} % |"


def lengths(task: Task, row: Array) -> str:
    """Return the lengths of a design in words."""
    told = [
        f"{name.removeprefix('leg.')} {1e3 * value:.1f}"
        for name, value in zip(task.names, row.tolist(), strict=True)
    ]
    return f"{', '.join(told)} mm"


def main() -> None:
    """Print a table for each task."""
    for name in sys.argv[1:] or TASKS:
        task = design.load(name)
        own = own_leg(task)
        with tempfile.TemporaryDirectory() as folder:
            found = found_leg(task, own, Path(folder) / "search")
        print(f"\n{name}: own leg {lengths(task, own)}; found leg {lengths(task, found)}\n")
        print("\n".join(table(task, np.stack([own, found]))))


if __name__ == "__main__":
    main()
