"""A design study: what a search found, with what becomes of its best designs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.design.certificate.best import Best, Chosen, spread
from fivebar_sim.design.proof.table import Proof, prove
from fivebar_sim.design.robust.sensitivity import Sensitivity, sensitivities
from fivebar_sim.design.robust.tolerance import Yield, tolerance_yield
from fivebar_sim.design.search.front import Front, costs
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import FiveBarError
from fivebar_sim.files import whole_file
from fivebar_sim.workers.here import Workers

SIMULATED = "simulated.parquet"
"""A row a simulated design: what was predicted of it, and what MuJoCo measured."""

BUILT = "built.json"
"""What becomes of each of the best when it is built."""


class Built(NamedTuple):
    """What becomes of a best design when it is built.

    Attributes:
        within: How far each dimension is off [m].
        made: The share of legs that keep to the constraints.
        sensitivities: By objective; empty where they were not asked for.
        why: Why there are none, in words; "" if there are.
    """

    within: float
    made: Yield
    sensitivities: list[Sensitivity]
    why: str = ""


class Study(NamedTuple):
    """All that the page tells.

    Attributes:
        task: The task.
        front: The front.
        best: The best designs, (n, d); the first is the one to take.
        presets: Where each of them is as a preset, relative to the page.
        sure: What is certain of each, in words.
        built: What becomes of each when it is built; empty if it was not asked.
        proof: The best in MuJoCo; None if they were not simulated.
    """

    task: Task
    front: Front
    best: Array
    presets: list[str]
    sure: list[str]
    built: list[Built]
    proof: Proof | None


def study(
    task: Task,
    front: Front,
    chosen: Chosen,
    presets: list[str],
    *,
    simulate: int,
    tolerance: float,
    workers: Workers | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> Study:
    """Return a study of a search: its best designs in MuJoCo, and built a little off.

    Args:
        task: The task.
        front: The front that was found.
        chosen: The best designs.
        presets: Where each of them is as a preset.
        simulate: How many designs of the front are simulated: the best, then others spread over it.
        tolerance: How far lengths and holes may be off [m]; 0 asks nothing of that.
        workers: Who simulates; None is this process.
        watch: Is told how many designs are simulated, and how many there are.
    """
    values = np.array([each.values for each in chosen.best]).reshape(-1, len(task.names))
    proof = None
    if simulate and task.motions:
        proof = prove(task, to_simulate(task, front, values, simulate), workers, watch)

    built = []
    if tolerance:
        built = [_built(task, row, tolerance, first=k == 0) for k, row in enumerate(values)]
    return Study(
        task=task,
        front=front,
        best=values,
        presets=presets,
        sure=[_sure(each) for each in chosen.best],
        built=built,
        proof=proof,
    )


def to_simulate(task: Task, front: Front, best: Array, count: int) -> Array:
    """Return the designs to simulate: the best ones, then others spread over the front, (n, d)."""
    known = {row.tobytes() for row in best}
    order = spread(costs(task, front.designs), len(front.rows) if count > len(best) else 0)
    others = [row for row in front.designs.values[order] if row.tobytes() not in known]
    rows = [*best, *others][:count]
    return np.array(rows).reshape(-1, len(task.names))


def _built(task: Task, row: Array, tolerance: float, *, first: bool) -> Built:
    """Return what becomes of a design; sensitivities of the first alone, which take longer."""
    made = tolerance_yield(task, row, tolerance)
    if not first:
        return Built(tolerance, made, [])
    try:
        return Built(tolerance, made, sensitivities(task, row, tolerance))
    except FiveBarError as error:
        return Built(tolerance, made, [], str(error))


def _sure(best: Best) -> str:
    """Return what is certain of a design, in words."""
    if not best.certified:
        return "not certified between the samples"
    reach = 1e3 * min(sure.reach for sure in best.certified)
    sine = min(sure.singular for sure in best.certified)
    condition = max(sure.condition for sure in best.certified)
    return (
        f"surely at least {reach:.3g} mm inside its reach, sines at B, C and D at least "
        f"{sine:.3g}, condition number at most {condition:.4g}"
    )


def write_tables(study: Study, folder: Path) -> list[Path]:
    """Write what was simulated and what becomes of built legs; return the files."""
    files = []
    if study.proof is not None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        files.append(folder / SIMULATED)
        with whole_file.stage(files[-1]) as place:
            pq.write_table(pa.Table.from_pylist(study.proof.rows(study.task)), place)
    if study.built:
        files.append(folder / BUILT)
        told = [
            {"preset": preset, **_told(built)}
            for preset, built in zip(study.presets, study.built, strict=True)
        ]
        whole_file.write(files[-1], json.dumps(told, indent=2) + "\n")
    return files


def _told(built: Built) -> dict[str, Any]:
    """Return what becomes of a design, for JSON."""
    return {
        "tolerance": built.within,
        "yield": built.made.share,
        "error": built.made.error,
        "broken": built.made.broken,
        "spread": {name: list(ends) for name, ends in built.made.spread.items()},
        "sensitivities": [each._asdict() for each in built.sensitivities],
    }
