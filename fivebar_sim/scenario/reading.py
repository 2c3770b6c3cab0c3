"""Reading a scenario's tables into the objects they describe; errors name file and key."""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from fivebar_sim import control, geometry, paths
from fivebar_sim.checks import check_number
from fivebar_sim.control import Feedback, Setpoints
from fivebar_sim.control.servo import Servo, servo_of
from fivebar_sim.control.servo import read_table as read_servo
from fivebar_sim.errors import ArgumentError, ConfigError, UnknownError, unknown
from fivebar_sim.files import quantities, tables
from fivebar_sim.files.tables import Table
from fivebar_sim.geometry import FiveBar
from fivebar_sim.integrator import ON_BELT, ON_RAIL, Sim
from fivebar_sim.metrics.catalogue import COOLING_KEYS, HEAT_KEYS, LIMIT_KEYS, LINE_KEYS
from fivebar_sim.paths import FootPath
from fivebar_sim.scenario import forces, scenes
from fivebar_sim.scenario.forces import FootForce
from fivebar_sim.scenario.scenes import Ground, Scene, Treadmill

# It names a folder: Windows forbids these characters and cuts a blank off the end, and a leading
# dot would hide it.
NAME = re.compile(r"""(?![. ])[^/\\:*?"<>|]+(?<! )""")
LONGEST_NAME = 200
"""A name may have 255 bytes on most systems, and the run directory's stage adds some."""

SHORT = {"leg": "preset", "servo": "preset", "robot": "preset", "scene": "kind"}
"""Tables that may be given as a string, and the key that the string is short for."""

BY_METRIC = ("limits", "converge")
"""Tables whose keys are metrics."""

KINDS_OF: dict[str, Callable[[], Mapping[str, type[Any]]]] = {
    "path": paths.kinds,
    "scene": lambda: scenes.KINDS,
    "force": lambda: forces.KINDS,
}
"""Tables whose `kind` decides which other keys they have, and the kinds that there are."""


def change(table: Table, parts: list[str], value: Any, where: str) -> None:
    """Apply one change to a scenario's table.

    A change of kind, or of controller.name, keeps only the keys that the new one has too.

    Raises:
        ConfigError: A part of the key is a value, not a table.
    """
    top = parts[0]
    if isinstance(table.get(top), str) and top in SHORT and len(parts) > 1:
        table[top] = {SHORT[top]: table[top]}

    # A metric's dotted key is one key, and the file may have written it as nested tables.
    if top in BY_METRIC and len(parts) > 1:
        if isinstance(table.get(top), dict):
            table[top] = dict(tables.flat(table[top]))
        parts = [top, ".".join(parts[1:])]

    tables.put(table, parts, value, where)
    if not isinstance(value, str):
        return

    # Left in, a key of the old kind would be refused as unknown, though nobody asked for it.
    if top in KINDS_OF and parts == [top, "kind"] and value in (kinds := KINDS_OF[top]()):
        known = tables.keys(kinds[value])
        table[top] = {k: v for k, v in table[top].items() if k in known}

    if parts == ["controller", "name"] and value in control.known():
        known = ["name", *tables.keys(control.find(value))]
        table["controller"] = {k: v for k, v in table["controller"].items() if k in known}


def of_robots() -> Any:
    """Return the class of robots' scenarios."""
    # By name, as controllers are found: it stands above this room, whose parts robots are made of.
    return importlib.import_module("fivebar_sim.robots.scenario").RobotScenario


def name_and_duration(table: Table, where: str) -> tuple[str, float]:
    """Return the scenario's name, fit for a directory, and its duration [s]."""
    name = table.get("name")
    if not isinstance(name, str) or not _is_file_name(name):
        raise ConfigError(
            f"{where}: name must be a plain file name of 1 to {LONGEST_NAME} bytes, got {name!r}"
        )
    duration = quantities.quantity(table.get("duration", 4.0), "s", f"{where}: duration")
    try:
        check_number("duration", duration, "s", low=0.0, strict=True)
    except ArgumentError as error:
        raise ConfigError(f"{where}: {error}") from None
    return name, float(duration)


def _is_file_name(name: str) -> bool:
    """Return whether a name can be a run directory's, on any system."""
    plain = NAME.fullmatch(name) is not None and name.isprintable()
    # File systems count bytes, not characters.
    return plain and len(name.encode()) <= LONGEST_NAME


def leg(value: Any, where: str, folder: Path, armature: float | None = None) -> FiveBar:
    """Return the leg of a preset, of a file beside the scenario, or of a table with changes.

    Args:
        value: A preset's name or a table, as the scenario has it.
        where: The scenario, for messages.
        folder: Where the scenario's files are.
        armature: The servo's rotor inertia [kg m^2]. The scenario's own leg.armature comes before
            it, and so does that of a leg's file; a shipped leg has no motors of its own. None keeps
            the leg's.
    """
    base, own = _preset("leg", geometry.read_table, FiveBar.from_table, value, where, folder)
    rotor = {} if armature is None else {"armature": armature}
    preset = _table("leg", value, where).get("preset", "")
    first, second = (rotor, base) if preset.endswith(".toml") else (base, rotor)
    return FiveBar.from_table({**first, **second, **own}, f"{where}: [leg]")


def servo(value: Any, where: str, folder: Path) -> Servo:
    """Return the servo of a preset, of a file beside the scenario, or of a table with changes."""
    base, own = _preset("servo", read_servo, servo_of, value, where, folder)
    gear = base.get("friction")
    changed = own.get("friction")
    if isinstance(gear, dict) and isinstance(changed, dict) and "model" not in changed:
        own["friction"] = {**gear, **changed}
    return servo_of({**base, **own}, where)


def check_servo_limits(limits: Iterable[str], servo: Servo) -> None:
    """Raise if a limit is on a metric that needs more of the servo than its table says.

    Raises:
        ConfigError: Names the limit and the servo's keys that are missing.
    """
    needs = (
        (HEAT_KEYS, servo.kt, "servo.kt and servo.resistance"),
        (COOLING_KEYS, servo.thermal_resistance, "servo.thermal_resistance and what goes with it"),
        (LINE_KEYS, servo.speed, "servo.speed"),
    )
    for keys, given, what in needs:
        for key in limits:
            if key in keys and given is None:
                raise ConfigError(f"limits.{key} needs {what}: this servo has none")


def sim(value: Any, scene: Scene, where: str) -> Sim:
    """Return the table [sim]; on a ground the default timestep is one that the integrator holds."""
    if isinstance(value, dict) and isinstance(scene, Ground):
        fine = value.get("integrator") == "implicitfast"
        holds = ON_BELT if isinstance(scene, Treadmill) else ON_RAIL
        value = {"timestep": holds, **value} if fine else value
    return tables.convert(value, Sim, "sim", where)


def converge(value: Any, where: str, known: Iterable[str] = LIMIT_KEYS) -> dict[str, float]:
    """Return the table [converge]: relative errors by metric, each one of the known.

    Raises:
        ConfigError: Not a table, an unknown key, or an error that is not a number of at least 0.
    """
    allowed = tables.bounds(value, known, "converge", where)
    for key, (low, high) in allowed.items():
        if low != -math.inf or not high >= 0.0:
            raise ConfigError(
                f"{where}: converge.{key} must be a relative error in [0, inf), got "
                f"{high if low == -math.inf else [low, high]}"
            )
    return {key: high for key, (_, high) in allowed.items()}


def _table(name: str, value: Any, where: str) -> Table:
    """Return a copy of a table, or the table that a string is short for."""
    if isinstance(value, str):
        value = {SHORT[name]: value}
    if not isinstance(value, dict):
        raise ConfigError(
            f"{where}: {name} must be the name of a {SHORT[name]} or a table, got {value!r}"
        )
    return dict(value)


def _preset(
    name: str,
    read: Callable[[str | Path], Table],
    check: Callable[[Table, str], object],
    value: Any,
    where: str,
    folder: Path,
) -> tuple[Table, Table]:
    """Return the table of a shipped preset, or of a file beside the scenario, and the changes.

    The preset must be legal by itself; its errors say that they are the preset's.
    """
    own = _table(name, value, where)
    preset = own.pop("preset", None)
    if preset is None:
        return {}, own
    if not isinstance(preset, str) or "\0" in preset:
        raise ConfigError(f"{where}: {name}.preset must be a preset's name, got {preset!r}")

    source = folder / preset if preset.endswith(".toml") else preset
    try:
        table = read(source)
        tables.check_finite(table, str(source))
        # Before the changes, so that nobody looks for the file's error in the scenario.
        check(table, str(source))
    except ConfigError as error:
        raise type(error)(f"{where}: {name}.preset: {error}") from None

    return table, own


def _kind(name: str, value: Any, where: str) -> type[Any]:
    """Return the class named by a table's `kind`."""
    known = KINDS_OF[name]()
    if not isinstance(value, dict) or "kind" not in value:
        raise ConfigError(f"{where}: [{name}] needs a kind; known: {', '.join(sorted(known))}")
    kind = value["kind"]
    if not isinstance(kind, str) or kind not in known:
        raise UnknownError(f"{where}: {name}.kind: {unknown(name, str(kind), known)}")
    return known[kind]


def path(value: Any, where: str, folder: Path) -> FootPath:
    """Return the foot's path, with its file read."""
    kind = _kind("path", value, where)
    return tables.convert(value, kind, "path", where).resolve(folder)


def force(value: Any, where: str, folder: Path) -> FootForce | None:
    """Return the foot's force profile, with its file read; None if there is no [force]."""
    if value is None:
        return None
    kind = _kind("force", value, where)
    return tables.convert(value, kind, "force", where).resolve(folder)


def scene(value: Any, where: str) -> Scene:
    """Return the scene of a kind's name, such as "rail", or of a table."""
    if isinstance(value, str) and value not in scenes.KINDS:
        raise UnknownError(f"{where}: {unknown('scene', value, scenes.KINDS)}")
    own = _table("scene", value, where)
    return tables.convert(own, _kind("scene", own, where), "scene", where)


def controller(value: Any, where: str) -> tuple[str, Setpoints | Feedback]:
    """Return the controller's name and the controller."""
    if not isinstance(value, dict):
        raise ConfigError(f"{where}: controller must be a table, got {value!r}")
    own = dict(value)
    name = own.pop("name", "servo")
    try:
        kind = control.find(str(name))
    except ConfigError as error:
        raise type(error)(f"{where}: controller.name: {error}") from None
    return str(name), tables.convert(own, kind, "controller", where)
