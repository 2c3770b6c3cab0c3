"""Reading a design task's file; errors name the file and the key."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fivebar_sim.checks import check_number, is_finite
from fivebar_sim.control.servo import Servo
from fivebar_sim.design.evaluation import objectives
from fivebar_sim.design.evaluation.legs import numbers
from fivebar_sim.design.task.motions import Cover
from fivebar_sim.design.task.options import Constraints, Search
from fivebar_sim.design.task.parts import motion, region
from fivebar_sim.design.task.variables import read
from fivebar_sim.design.task.variation import Variation
from fivebar_sim.errors import ArgumentError, ConfigError, unknown
from fivebar_sim.files import resources, tables
from fivebar_sim.files.tables import Table
from fivebar_sim.geometry import FiveBar, read_table
from fivebar_sim.scenario import reading

KEYS = (
    *("name", "leg", "servo", "gear", "samples", "vary", "motion", "region"),
    *("objectives", "constraints", "search"),
)


def load(source: str | Path) -> dict[str, Any]:
    """Return the fields of `Task`, of a file or of a shipped task's name; see `Task.load`."""
    known = resources.shipped("designs")
    path = known.get(str(source), Path(source))
    if path.suffix != ".toml":
        raise ConfigError(f"{unknown('design task', str(source), known)}; or a path to a .toml")
    table = tables.read(path, "design task")
    return from_table(table, str(path), path.parent, path.stem)


def from_table(table: Table, where: str, folder: Path, stem: str) -> dict[str, Any]:
    """Return the fields of `Task` of a TOML table.

    Args:
        table: The table.
        where: The file, for messages.
        folder: Where the files that it names are.
        stem: The name of a task without one.
    """
    tables.check_keys(table, KEYS, where)
    tables.check_finite(table, where)
    name, _ = reading.name_and_duration({"name": table.get("name", stem)}, where)
    motions = [
        motion(key, each, where, folder) for key, each in _tables(table, "motion", where).items()
    ]
    covers = [
        Cover(key, region(key, each, where))
        for key, each in _tables(table, "region", where).items()
    ]
    if not motions and not covers:
        raise ConfigError(f"{where}: a task needs a [motion.NAME] or a [region.NAME]")

    leg = reading.leg(table.get("leg", "classic"), where, folder)
    variation = _variation(table, leg, where)
    servos = _servos(table, variation, where, folder)
    wanted = objectives.read(table.get("objectives", ["torque_peak"]), where)
    limited = tables.convert(table.get("constraints", {}), Constraints, "constraints", where)
    bounded = (*limited.most, *limited.least)
    objectives.check((*wanted, *bounded), bool(motions), servos, where)
    return dict(
        name=name,
        where=where,
        table=table,
        leg=leg,
        rotor=_own_rotor(table.get("leg"), variation, folder),
        servos=servos,
        gear=_positive(table, "gear", 1.0, where),
        motions=tuple(motions),
        covers=tuple(covers),
        variation=variation,
        objectives=wanted,
        constraints=limited,
        search=tables.convert(table.get("search", {}), Search, "search", where),
        samples=_samples(table, where),
    )


def _tables(table: Table, key: str, where: str) -> Table:
    found = table.get(key, {})
    if not isinstance(found, dict):
        raise ConfigError(f"{where}: {key} must be tables [{key}.NAME], got {found!r}")
    return found


def _variation(table: Table, leg: FiveBar, where: str) -> Variation:
    """Return what varies."""
    own = [key for key in numbers(leg) if not key.startswith("mode.")]
    known = [f"leg.{key}" for key in (*own, "mode")] + ["gear", "servo"]
    for top in ("motion", "region"):
        for name, each in _tables(table, top, where).items():
            known += [f"{top}.{name}.{key}" for key in _keys(each)]
    variables, ties = read(table.get("vary"), known, where)
    for variable in variables:
        if variable.key in ("servo", "leg.mode") and not variable.choice:
            raise ConfigError(f"{where}: [vary]: {variable.key} varies by choice = [...] only")
    return Variation(variables, ties)


def _keys(table: Mapping[str, Any]) -> list[str]:
    """Return the dotted keys of all numbers in a table, with the index of those in arrays."""
    found = []
    for key, value in tables.flat(table):
        # Another kind would have other keys, and what a motion counts is no part of a design.
        if key.split(".")[-1] not in ("kind", "weight"):
            found.append(key)
        if isinstance(value, list):
            found += [f"{key}.{k}" for k, each in enumerate(value) if is_finite(each)]
    return found


def _servos(table: Table, variation: Variation, where: str, folder: Path) -> tuple[Servo, ...]:
    choice = next((v.choice for v in variation.variables if v.key == "servo"), ())
    names = choice or (table.get("servo", {}),)
    return tuple(reading.servo(each, where, folder) for each in names)


def _own_rotor(leg: Any, variation: Variation, folder: Path) -> bool:
    """Return whether the leg's armature is its own: a shipped leg has no motors of its own."""
    if "leg.armature" in variation.keys:
        return True
    given = leg if isinstance(leg, dict) else {"preset": str(leg or "classic")}
    preset = str(given.get("preset", ""))
    file = read_table(folder / preset) if preset.endswith(".toml") else {}
    return "armature" in given or "armature" in file


def _positive(table: Table, key: str, usual: float, where: str) -> float:
    try:
        check_number(key, table.get(key, usual), "", low=0.0, strict=True)
    except ArgumentError as error:
        raise ConfigError(f"{where}: {error}") from None
    return float(table.get(key, usual))


def _samples(table: Table, where: str) -> int:
    samples = table.get("samples", 64)
    if isinstance(samples, bool) or not isinstance(samples, int) or not 2 <= samples <= 10_000:
        raise ConfigError(f"{where}: samples must be an integer in [2, 10000], got {samples!r}")
    return samples
