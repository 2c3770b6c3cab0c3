"""The best designs of a front: spread over it, each certified, written as presets of legs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fivebar_sim import units
from fivebar_sim.arrays import Array
from fivebar_sim.design.certificate.certify import Certified, certify
from fivebar_sim.design.evaluation.objectives import CATALOGUE
from fivebar_sim.design.search.front import Front, costs
from fivebar_sim.design.task.task import Task
from fivebar_sim.errors import ArgumentError
from fivebar_sim.files import whole_file

FOLDER = "best"
TABLE = "best.json"

TRIES = 5
"""Designs that are tried for each one that is asked for: a front may be full of refused ones."""


SHOWN = {"N m": ("mN m", 1e3), "kg": ("g", 1e3), "m": ("mm", 1e3), "m^2": ("cm2", 1e4)}
"""Units in which people read the numbers of a leg, and how many of them are one in SI."""


def shown(value: float, unit: str, digits: int = 4) -> str:
    """Return a number of SI with the unit that people read it in: "52.9 mN m"."""
    name, factor = SHOWN.get(unit, (unit, 1.0))
    return units.text(factor * value, name, digits)


class Best(NamedTuple):
    """A design of the front that keeps to its constraints between the samples too.

    Attributes:
        row: Which row of designs.parquet it is.
        values: Its values, (d,).
        objectives: In SI units, (m,).
        certified: What is certain of it; empty where the kind of a path is not known.
    """

    row: int
    values: Array
    objectives: Array
    certified: list[Certified]


class Chosen(NamedTuple):
    """The best designs, and why others of the front are none.

    Attributes:
        best: Them; the first is the one nearest to the best of every objective.
        refused: Why each refused one is no part of them, in words.
        unknown: Why nothing could be certified, in words; "" if it could.
    """

    best: list[Best]
    refused: list[str]
    unknown: str = ""


def choose(task: Task, front: Front) -> Chosen:
    """Return the best designs of a front, at most as many as the task asks for."""
    best: list[Best] = []
    refused: list[str] = []
    unknown = ""
    for k in spread(costs(task, front.designs), TRIES * task.search.best):
        if len(best) == task.search.best:
            break

        values = front.designs.values[k]
        try:
            certified = certify(task, values)
        except ArgumentError as error:
            unknown = str(error)
            certified = []
        reasons = [each.refusal(task.constraints) for each in certified]
        reason = next((each for each in reasons if each), "")
        if reason:
            refused.append(reason)
            continue
        best.append(Best(int(front.rows[k]), values, front.designs.objectives[k], certified))
    return Chosen(best, refused, unknown)


def spread(cost: Array, count: int) -> list[int]:
    """Return rows of a front that are spread over it.

    The first is the nearest to the least of all columns, with each scaled to its range; each
    further one is the farthest from all before.

    Args:
        cost: Of which less is better, (n, m).
        count: How many.
    """
    if not len(cost):
        return []
    low = cost.min(axis=0)
    span = cost.max(axis=0) - low
    scaled = (cost - low) / np.where(span > 0.0, span, 1.0)
    chosen = [int(np.argmin(np.linalg.norm(scaled, axis=1)))]
    far = np.linalg.norm(scaled - scaled[chosen[0]], axis=1)
    while len(chosen) < min(count, len(cost)):
        chosen.append(int(np.argmax(far)))
        far = np.minimum(far, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
        # Those that are taken are at no distance from themselves.
        far[chosen] = -1.0
    return chosen


def write(task: Task, chosen: Chosen, folder: Path) -> list[Path]:
    """Write the best designs as presets, and what is certain of them as JSON.

    Returns:
        The presets, in the order of the best.
    """
    place = folder / FOLDER
    for old in place.glob("*.toml"):
        old.unlink()

    files = []
    for k, each in enumerate(chosen.best):
        files.append(place / f"{task.name}-{k + 1:02d}.toml")
        whole_file.write(files[-1], _comment(task, each) + task.preset(each.values))

    table = [_told(task, each, file) for each, file in zip(chosen.best, files, strict=True)]
    written = {"best": table, "refused": chosen.refused, "unknown": chosen.unknown}
    whole_file.write(folder / TABLE, json.dumps(written, indent=2) + "\n")
    return files


def _comment(task: Task, each: Best) -> str:
    """Return the first lines of a preset: what it is good for, and what is certain."""
    lines = [f"# Design {each.row} of the task {task.name}."]
    for name, value in zip(task.objectives, each.objectives.tolist(), strict=True):
        lines.append(f"# {name}: {shown(value, CATALOGUE[name].unit)}")

    for name, value in task.settings(each.values).items():
        if not name.startswith("leg."):
            lines.append(f"# {name} = {value}")
    for sure in each.certified:
        lines.append(
            f"# {sure.name}: certain are {1e3 * sure.reach:.3g} mm to the edge of reach, sines of "
            f"at least {sure.singular:.3g}, a condition number of at most {sure.condition:.4g}."
        )
    return "\n".join(lines) + "\n"


def _told(task: Task, each: Best, file: Path) -> dict[str, Any]:
    return {
        "file": f"{FOLDER}/{file.name}",
        "row": each.row,
        "settings": task.settings(each.values),
        "objectives": dict(zip(task.objectives, each.objectives.tolist(), strict=True)),
        "certified": [_plain(sure) for sure in each.certified],
    }


def _plain(sure: Certified) -> dict[str, Any]:
    """Return a certificate without infinities, which JSON has no word for."""
    numbers = {"reach": sure.reach, "singular": sure.singular, "condition": sure.condition}
    told = {key: value if np.isfinite(value) else None for key, value in numbers.items()}
    return {"name": sure.name, **told, "parts": sure.parts}
